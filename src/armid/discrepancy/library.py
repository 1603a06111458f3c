"""The candidate effects, compiled a few at a time and ready to be tried on the evidence.

Compiling takes long however few effects a model holds (measured on the arm: 8 s with none, 13 s with 6, 18 s with 24,
31 s with 37), while every effect that is carried along slows a simulation a little (16, 42, 124, 208 us). So candidates
are compiled in bundles: a model with thirteen of them, twelve at their null values, is the model with the one.
Thirty-seven effects alone, in pairs and in threes then need 7 compiled models instead of thousands.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.evidence import Evidence, WhiteRecords, white_records
from armid.discrepancy.names import LOOSE, base, forms_of, own_name, renamed, shown_name
from armid.model import ArmidError, Effect, Manoeuvre, Model, Parameter
from armid.problem import Replay, Space, space_of
from armid.record import Override, Record
from armid.simulation import STANDARD, Calibration, Schedule, probes, simulate
from armid.simulation.calibrate import ALLOWED, MARGIN, difference, switch_weights

Array = NDArray[np.float64]
BUNDLE = 13
N_PROBES = 16
NEAR = 2.0
SUBSTEPS = (1, 2, 4, 8)


@dataclass(frozen=True, eq=False)
class Library:
    """Hold the declared model, the candidates that apply to it, and what is known of the parameters.

    candidates: key -> effect; a second form has a key of its own. bundles: keys that are compiled together. overrides,
    bounds, fixed: as `space_of` takes them, of the declared model and of candidates alike. told: called with a sentence
    before something that takes long.
    """

    declared: Model
    candidates: Mapping[str, Effect]
    originals: Mapping[str, Effect]
    evidence: Evidence
    bundles: tuple[tuple[str, ...], ...]
    overrides: Mapping[str, Override]
    bounds: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, float]
    threads: int
    told: Callable[[str], None]
    _wide: dict[tuple[str, ...], Model] = field(default_factory=dict)
    _problems: dict[frozenset[str], WhiteRecords] = field(default_factory=dict)

    def public(self, key: str) -> str:
        """Return the name of the effect that a key stands for, whatever its form."""
        return shown_name(self.originals[base(key)].name)

    def can_join(self, key: str, active: Sequence[str]) -> bool:
        """Tell whether a candidate is not in a model yet, in any form."""
        return self.public(key) not in {self.public(other) for other in active}

    def exact(self, active: Sequence[str]) -> Model:
        """Return the declared model with some candidates added, under their public names, in the order given."""
        return Model(self.declared.plant, (*self.declared.effects, *(self.originals[base(n)] for n in active)))

    def problem(self, active: Sequence[str], near: Mapping[str, float] | None = None) -> WhiteRecords:
        """Return the least-squares problem of the declared model with some candidates, on all of the evidence.

        near: values about which the engine is calibrated when the problem is asked for first; a box may reach to
        masses a thousand times too light, which would ask for steps that nothing else needs.
        """
        key = frozenset(active)
        if key not in self._problems:
            model = self.wide(active)
            self._problems[key] = self.posed(model, self.space(model, key), near or {})
        return self._problems[key]

    def posed(self, model: Model, space: Space, near: Mapping[str, float]) -> WhiteRecords:
        """Return a problem with the engine calibrated about some values."""
        return white_records(self.replays(self.evidence.records, model, space, near), space, self.evidence)

    def recalibrated(self, active: Sequence[str], values: Mapping[str, float]) -> WhiteRecords | None:
        """Return the problem with finer steps where those at hand are too coarse at some values, else None."""
        records = self.problem(active)
        again = self.posed(records.replays[0].model, records.space, values)
        coarse = [
            new.schedule.substeps > old.schedule.substeps
            for a, b in zip(again.replays, records.replays, strict=True)
            for new, old in zip(a.calibrations, b.calibrations, strict=True)
        ]
        if not any(coarse):
            return None
        self._problems[frozenset(active)] = again
        return again

    def wide(self, active: Sequence[str]) -> Model:
        """Return a model that holds the bundles of some candidates, or just them where bundles run in a circle."""
        wanted = {base(n) for n in active}
        names = tuple(chain.from_iterable(bundle for bundle in self.bundles if set(bundle) & wanted))
        if names not in self._wide:
            self.told(f"preparing a model with {len(names) or 'no'} candidates (compiled at its first use)")
            try:
                self._wide[names] = self.composed(names)
            except ArmidError:
                names = tuple(sorted(wanted))
                self._wide.setdefault(names, self.composed(names))
        return self._wide[names]

    def composed(self, keys: Sequence[str]) -> Model:
        """Return the declared model with candidates under their keys, so that two forms can stand side by side."""
        return Model(self.declared.plant, (*self.declared.effects, *(self.candidates[k] for k in keys)))

    def space(self, model: Model, active: frozenset[str]) -> Space:
        """Return the space of a wide model in which the candidates that are not active rest at their null."""
        mine = set(model.parameters)
        space = space_of(
            model, self.overrides, {n: b for n, b in self.bounds.items() if n in mine},
            {n: v for n, v in self.fixed.items() if n in mine},
        )  # fmt: skip
        wanted = {base(n) for n in active}
        for name, parameter in model.parameters.items():
            owner = name.partition(".")[0]
            if owner in self.candidates and owner not in wanted:
                space = space.with_fixed(name, idle(parameter))
            elif owner + LOOSE in active and name in self.loosened(owner):
                space = space.with_bounds(name, parameter.low, parameter.high)
        return space

    def loosened(self, key: str) -> tuple[str, ...]:
        """Return the parameters of a candidate that are fixed by declaration alone, such as the width of a sign."""
        told = {*self.bounds, *self.fixed, *(n for n, o in self.overrides.items() if o.fixed is not None)}
        names = [f"{key}.{p.name}" for p in self.candidates[base(key)].parameters if p.fixed is not None]
        return tuple(n for n in names if n not in told)

    def replays(
        self, records: Sequence[Record], model: Model, space: Space, near: Mapping[str, float]
    ) -> tuple[Replay, ...]:
        """Make records ready to be simulated, on the engine's standard accuracy: the evidence's noise hides its error.

        near: values about which it is calibrated.
        """
        spread = space.complete(probes(*neighbourhood(space, near), N_PROBES))
        known: dict[object, Calibration] = {}
        ready = []
        for record in records:
            pieces = tuple(p.until_window_end() for p in record.pieces)
            keys = [p.manoeuvre.likeness() for p in pieces]
            for key, piece in zip(keys, pieces, strict=True):
                if key not in known:
                    known[key] = quickly_calibrated(model, piece.manoeuvre, spread)
            ready.append(Replay(record, model, pieces, tuple(known[key] for key in keys), self.threads))
        return tuple(ready)


def neighbourhood(space: Space, near: Mapping[str, float]) -> tuple[Array, Array]:
    """Return bounds of the free parameters, those with a known value within a factor of 2 of it."""
    low, high = space.low[space.free].copy(), space.high[space.free].copy()
    for i, name in enumerate(space.free_names):
        if name in near:
            ends = sorted((near[name] / NEAR, near[name] * NEAR))
            low[i], high[i] = max(low[i], ends[0]), min(high[i], ends[1])
    return low, np.maximum(high, low)


def quickly_calibrated(model: Model, manoeuvre: Manoeuvre, spread: Array) -> Calibration:
    """Return the coarsest of few schedules whose error on the candidates stays within half of the standard one.

    `calibrate` would go on to steps that a screening of candidates cannot pay (a ripple so fine that the motion is a
    matter of chance asks for 128 in a sample), and would look for steps over several samples.
    """
    allowed = ALLOWED[STANDARD] * model.plant.scales.speed
    runs = {n: simulate(model, manoeuvre, spread, Schedule(n)) for n in SUBSTEPS[:2]}
    for n in SUBSTEPS:
        runs[2 * n] = runs.get(2 * n) or simulate(model, manoeuvre, spread, Schedule(2 * n))
        error = difference(runs[n], runs[2 * n]) * 16 / 15
        if error <= MARGIN * allowed and not (runs[n].failed & ~runs[2 * n].failed).any():
            break
    return Calibration(Schedule(n, weights=switch_weights(spread, runs[n])), error, bool(error <= allowed))


def idle(parameter: Parameter) -> float:
    """Return where a parameter of an effect that is not in use rests."""
    known = [v for v in (parameter.null, parameter.fixed, parameter.nominal) if v is not None]
    return float(known[0] if known else 0.5 * (parameter.low + parameter.high))


def library_of(
    declared: Model,
    candidates: Mapping[str, Effect],
    evidence: Evidence,
    overrides: Mapping[str, Override],
    bounds: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float],
    threads: int = 1,
    told: Callable[[str], None] = lambda _: None,
) -> Library:
    """Return the candidates that apply to the declared model: those whose ports and names its plant offers.

    Raises ArmidError for bounds or a fixed value of a parameter that neither the model nor a candidate has.
    """
    check_names(declared, candidates, [*bounds, *fixed])
    present = {e.name for e in declared.effects}
    forms = {k: e for effect in candidates.values() if effect.name not in present for k, e in forms_of(effect).items()}
    originals = {k: e for k, e in forms.items() if applies(declared, e)}
    keyed = {k: replace(e, name=k, forms=()) for k, e in originals.items()}
    bundles = bundled(declared, keyed)
    told_of = (renamed(overrides, originals), renamed(bounds, originals), renamed(fixed, originals))
    return Library(declared, keyed, originals, evidence, bundles, *told_of, threads, told)


def applies(model: Model, effect: Effect) -> bool:
    """Tell whether an effect can be added to a model."""
    try:
        return bool(model + effect)
    except ArmidError:
        return False


def check_names(declared: Model, candidates: Mapping[str, Effect], names: Sequence[str]) -> None:
    """Refuse a parameter that neither the declared model nor a candidate has."""
    offered = [own_name(e.name, p.name) for c in candidates.values() for e in c.every_form for p in e.parameters]
    none = np.empty(0)
    space = Space(tuple(dict.fromkeys([*declared.parameters, *offered])), (), none, none, none)
    for name in names:
        space.index(name)


def bundled(declared: Model, effects: Mapping[str, Effect]) -> tuple[tuple[str, ...], ...]:
    """Return keys of candidates in bundles that compose without a circle.

    Those without states of their own come first, so that the most used bundles stay the fastest.
    """
    bundles: list[tuple[Model, list[str]]] = []
    for effect in sorted(effects.values(), key=lambda e: (len(e.states), e.name)):
        for i, (model, names) in enumerate(bundles):
            if len(names) < BUNDLE and applies(model, effect):
                bundles[i] = (model + effect, [*names, effect.name])
                break
        else:
            bundles.append((declared + effect, [effect.name]))
    return tuple(tuple(names) for _, names in bundles)


def with_evidence(records: WhiteRecords, evidence: Evidence) -> WhiteRecords:
    """Return a problem that sees other samples."""
    return replace(records, evidence=evidence)
