"""The candidate effects, compiled together and ready to be tried on the evidence.

Compiling takes long however few effects a model holds (measured on the arm: 8 s with none, 32 s with all 38), so all
candidates that compose without a circle are compiled as one model: with all but two at their null values it is the
model with the two. What rests at its null is passed over (`armid.engine.generate`), so that it costs little: 0.12 ms
for eight candidates and 1.5 s of motion with no effect in the model, 0.4 ms with 38, where it was 1.9 ms.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, product
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.loop.fit import joined, made_ready, side_by_side
from armid.loop.whitening import Evidence, WhiteRecords, white_records
from armid.model import Effect, Model, Parameter
from armid.problem.replay import Replay
from armid.problem.space import Space, space_of
from armid.record import Override, Record

T = TypeVar("T")
LOOSE = "+"
# What the names of empirical terms begin with: no effect of a library may claim it.
UNNAMED, SHOWN_AS = "unnamed_", "unnamed:"


def base(key: str) -> str:
    """Return a key without the mark."""
    return key.removesuffix(LOOSE)


def loose(active: Iterable[str], name: str) -> tuple[str, ...]:
    """Return keys with the mark on one of them.

    >>> loose(("coulomb", "tilt"), "coulomb")
    ('coulomb+', 'tilt')
    """
    return tuple(key + LOOSE if key == name else key for key in active)


def is_empirical(name: str) -> bool:
    """Tell whether a name stands for an empirical term, which claims no physical effect."""
    return name.startswith(UNNAMED)


def shown_name(name: str) -> str:
    """Return the name of an effect as reports show it: `unnamed:torque` for an empirical term at that port.

    >>> shown_name("unnamed_torque_by_theta"), shown_name("coulomb")
    ('unnamed:torque', 'coulomb')
    """
    return f"{SHOWN_AS}{name.removeprefix(UNNAMED).split('_by_')[0]}" if is_empirical(name) else name


def own_name(effect: str, parameter: str) -> str:
    """Return the qualified name of an effect's parameter."""
    return f"{effect}.{parameter}"


def forms_of(effect: Effect) -> dict[str, Effect]:
    """Return key -> form: the effect's name for its first form, name and word for the others."""
    return {effect.name if e is effect else f"{effect.name}_{e.form}": e for e in effect.every_form}


def renamed(given: Mapping[str, T], originals: Mapping[str, Effect]) -> dict[str, T]:
    """Return what is told of parameters, repeated for the keys of every form that has a parameter of that name."""
    found = dict(given)
    for key, effect in originals.items():
        names = {own_name(effect.name, p.name): own_name(key, p.name) for p in effect.parameters}
        found |= {names[n]: value for n, value in given.items() if n in names}
    return found


Array = NDArray[np.float64]
# Strengths that are tried, as shares of the way from the null to a bound; shapes: points along each of 1, 2, 3 ranges.
LEVELS, LEVELS_OF_SHAPES = (0.03, 0.1, 0.3, 1.0), (0.05, 0.4)
SHAPES = {0: (), 1: (8,), 2: (7, 3), 3: (5, 3, 2)}
WIDE = 5.0


@dataclass(frozen=True, eq=False)
class Ray:
    """Hold one way to switch an effect on: values at full strength, those of the null, and the share that is tried."""

    full: dict[str, float]
    null: dict[str, float]
    level: float

    def at(self, share: float) -> dict[str, float]:
        """Return the parameters of the effect at a share of its full strength."""
        return {n: self.null[n] + share * (v - self.null[n]) if n in self.null else v for n, v in self.full.items()}


def rays(records: WhiteRecords, model_name: str) -> tuple[list[Ray], int]:
    """Return the grid over strengths and shapes of one effect, and the number of its shapes.

    Strengths are the free parameters with a null value: each alone, and all together where there are several.
    """
    space, declared = records.space, records.replays[0].model.parameters
    mine = [n for n in space.free_names if n.startswith(f"{model_name}.")]
    null = {n: float(v) for n in mine if (v := declared[n].null) is not None}
    bound = {n: (space.low[space.index(n)], space.high[space.index(n)]) for n in mine}
    shapes = [n for n in mine if n not in null]
    counts = SHAPES.get(len(shapes), (2,) * len(shapes))
    grids = [grid(*bound[n], count) for n, count in zip(shapes, counts, strict=True)]
    points = [dict(zip(shapes, map(float, p), strict=True)) for p in product(*grids)]
    chosen = [(n,) for n in null] + ([tuple(null)] if len(null) > 1 else [])
    found = []
    for names, side, shape in product(chosen, (1, 0), points):
        full = {n: float(bound[n][side]) if n in names else null[n] for n in null}
        if all(full[n] != null[n] for n in names):
            found += [Ray(shape | full, null, level) for level in (LEVELS_OF_SHAPES if shapes else LEVELS)]
    return found, len(points)


def grid(low: float, high: float, count: int) -> Array:
    """Return points inside a range, even in the logarithm where the range is wide."""
    shares = (np.arange(count) + 0.5) / count
    if low > 0.0 and high > WIDE * low:
        return np.asarray(low * (high / low) ** shares)
    return np.asarray(low + (high - low) * shares)


# More than the library holds: a model that grew for ever would take for ever to compile.
BUNDLE = 60


def applies(model: Model, effect: Effect) -> bool:
    """Tell whether an effect can be added to a model."""
    try:
        return bool(model + effect)
    except ArmidError:
        return False


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


S = TypeVar("S")


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
