"""The candidate effects, compiled together and ready to be tried on the evidence.

Compiling takes long however few effects a model holds (measured on the arm: 8 s with none, 32 s with all 38), so all
candidates that compose without a circle are compiled as one model: with all but two at their null values it is the
model with the two. What rests at its null is passed over (`armid.simulation.passing`), so that it costs little: 0.12 ms
for eight candidates and 1.5 s of motion with no effect in the model, 0.4 ms with 38, where it was 1.9 ms.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TypeVar

import numpy as np

from armid.discrepancy.bundles import applies, bundled
from armid.discrepancy.evidence import Evidence, WhiteRecords, white_records
from armid.discrepancy.names import LOOSE, base, forms_of, own_name, renamed, shown_name
from armid.discrepancy.ready import joined, made_ready
from armid.discrepancy.side_by_side import side_by_side
from armid.model import ArmidError, Effect, Model, Parameter
from armid.problem import Replay, Space, space_of
from armid.record import Override, Record

S = TypeVar("S")
T = TypeVar("T")


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
            space = self.space(model, key)
            alone = [self._problems.get(frozenset((n,))) or self._problems.get(frozenset((base(n),))) for n in active]
            ready = joined(alone, model)
            known = None if ready is None else white_records(ready, space, self.evidence)
            self._problems[key] = known or self.posed(model, space, near or {})
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
        held = [bundle for bundle in self.bundles if set(bundle) & wanted]
        names = tuple(chain.from_iterable(held or self.bundles[:1]))
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
        """Make records ready to be simulated (see `made_ready`); near: values about which it is calibrated."""
        return made_ready(records, model, space, near)

    def each(self, work: Callable[[S], T], items: Iterable[S]) -> list[T]:
        """Return the work of each item, in order, the items shared among the threads."""
        return side_by_side(work, items, self.threads)


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


def check_names(declared: Model, candidates: Mapping[str, Effect], names: Sequence[str]) -> None:
    """Refuse a parameter that neither the declared model nor a candidate has."""
    offered = [own_name(e.name, p.name) for c in candidates.values() for e in c.every_form for p in e.parameters]
    none = np.empty(0)
    space = Space(tuple(dict.fromkeys([*declared.parameters, *offered])), (), none, none, none)
    for name in names:
        space.index(name)


def with_evidence(records: WhiteRecords, evidence: Evidence) -> WhiteRecords:
    """Return a problem that sees other samples."""
    return replace(records, evidence=evidence)
