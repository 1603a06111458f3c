"""The candidate effects, compiled together and ready to be tried on the train records.

Compiling takes long however few effects a model holds (measured on the arm: 5 s with none, 36 s with all 47), so all
candidates that compose without a circle are compiled as one model: with all but two at their null values it is the
model with the two. An effect at its null is skipped by the engine, so that it costs little: 0.1 ms for eight
candidates and 1.4 s of motion with no effect in the model, 0.25 ms with the 32 that have no states of their own, 0.6 ms
with all.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armid.engine import STANDARD, Calibration, Schedule, Simulation, accuracy_against, probes, simulate
from armid.engine.calibrate import ALLOWED, MARGIN_OF_STEPS, difference, switch_weights, with_rough_samples
from armid.estimation.least_squares import side_by_side
from armid.inference.candidates import (
    ERROR_OF,
    PROBE,
    Active,
    Double,
    EffectKey,
    bump_at,
    bundled,
    compiled,
    declared_keys,
    idle,
    joined,
)
from armid.inference.whitening import WhitenedData, WhiteRecords
from armid.model import EFFECTS, Array, Effect, Manoeuvre, Model, Parameter, distinct
from armid.model.parameter import powers_of
from armid.problem.problem import ReadyRecord, Replay, by_record
from armid.problem.space import Space, space_of
from armid.problem.starts import fits_starts
from armid.record import Override, Record

# Units of a wave number.
OF_WAVES = ("1/rad", "1/m")
# How many standard deviations a constant may be off; its sign stays.
FARTHEST, LEAST_ERROR = 3.0, -0.95
S = TypeVar("S")
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Library:
    """Hold the declared model, the candidates that apply to it, and what is known of the parameters.

    candidates: as registered. bundles: keys that are compiled together. overrides, bounds, fixed: as `space_of` takes
    them, of the declared model and of candidates alike. tolerances: of the constants, relative. misfit: rms residual of
    the best model so far in units of the noise, at least 1. say: called with a sentence before something that takes
    long. priors: probabilities of effects before the records. known: mean and deviation of parameters, SI, likewise.
    as_read: the data whose inputs count as exact, where in `data` they count as measured with noise, else None.
    reach: by which factor strengths that scale with the machine may exceed their declared range. widened: ranges of
    strengths of the declared model that were too narrow. doubles: effects that are the law of a free parameter of the
    declared model, or of a constant within its tolerance. least_waves: smallest wave number of a candidate that repeats
    with position. own_shapes_free: whether the shapes of the declared model's effects, which it fixes, are free.
    as_declared: the declared model with its effects in the forms that the user gave.
    """

    declared: Model
    as_declared: Model
    candidates: Mapping[EffectKey, Effect]
    data: WhitenedData
    bundles: tuple[Active, ...]
    overrides: Mapping[str, Override]
    bounds: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, float]
    threads: int
    say: Callable[[str], None]
    tolerances: Mapping[str, float] = field(default_factory=dict)
    misfit: float = 1.0
    priors: Mapping[str, float] = field(default_factory=dict)
    known: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    as_read: WhitenedData | None = None
    reach: float = 1.0
    widened: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    doubles: Mapping[EffectKey, Double] = field(default_factory=dict)
    least_waves: float = 0.0
    own_shapes_free: bool = False
    _models: dict[Active, Model] = field(default_factory=dict)
    _problems: dict[frozenset[EffectKey], WhiteRecords] = field(default_factory=dict)
    _schedules: dict[tuple[EffectKey, Model], "Schedules"] = field(default_factory=dict)

    def joinable(self, active: Active) -> list[EffectKey]:
        there = {other.public for other in active}
        return [k for k in self.candidates if k.public not in there and k not in self.left_out and self.may_repeat(k)]

    def may_repeat(self, key: EffectKey) -> bool:
        """Tell whether the largest wave number of an effect has periods enough in the travel."""
        parameters = self.compiled_model((key.declared,)).parameters
        return all(parameters[name].high > self.least_waves for name in self.waves_of(key, parameters))

    def waves_of(self, key: EffectKey, parameters: Mapping[str, Parameter]) -> list[str]:
        """Return the wave numbers of an effect that repeats with position, whose range the user did not give."""
        given = {*self.bounds, *self.fixed, *self.overrides}
        return [n for n, p in parameters.items() if key.owns(n) and p.unit in OF_WAVES and n not in given]

    @cached_property
    def left_out(self) -> dict[EffectKey, str]:
        """The effects that a free parameter does already, which are not tried, and its name."""
        return {key: one.name for key, one in self.doubles.items() if one.exactly and one.name not in self.tolerances}

    def owner(self, parameter: str) -> EffectKey | None:
        """Return the candidate to which a parameter of a compiled model belongs, None for the declared model's own."""
        owner, dot, _ = parameter.partition(".")
        return self._by_compiled_name.get(owner) if dot else None

    def public(self, parameter: str) -> str:
        """Return the name by which a user gives and sees a parameter of a compiled model."""
        owner = self.owner(parameter)
        return parameter if owner is None else f"{owner.public}.{parameter.partition('.')[2]}"

    @cached_property
    def _by_compiled_name(self) -> dict[str, EffectKey]:
        return {key.compiled: key for key in self.candidates}

    @property
    def known_names(self) -> set[str]:
        """Names that share the prior probability: the candidates, and all effects that armid knows."""
        return {key.public for key in self.candidates} | EFFECTS.keys()

    def problem(self, active: Active, near: Mapping[str, float] | None = None) -> WhiteRecords:
        """Return the least-squares problem of the declared model with some candidates, on all train records.

        near: values about which the engine is calibrated when the problem is asked for first; a box may reach to
        masses a thousand times too light, which would ask for steps that nothing else needs. Each candidate is
        calibrated alone, once with each compiled model; the finest of the schedules found there serves several.
        """
        key = frozenset(active)
        if key not in self._problems:
            model = self.compiled_model(active)
            space = self.space(model, active)
            if active:
                # What is tried needs no more than that; what is found good is calibrated anew (`recalibrated`).
                known = [self.schedules(k, model, near or {}) for k in active]
                replays = scheduled_replays(self.data.records, model, known)
            else:
                replays = self.replays(model, space, near or {}, self.misfit)
            self._problems[key] = WhiteRecords(replays, space, self.data, self.known)
        return self._problems[key]

    def schedules(self, key: EffectKey, model: Model, near: Mapping[str, float]) -> "Schedules":
        """Return how finely a candidate alone is simulated with a compiled model, at strengths of a size to expect.

        A strength far beyond that asks for steps that nothing else needs; what is found there is calibrated anew.
        """
        known = self._schedules.get((key.declared, model))
        if known is None or not known.serves(self.misfit):
            space = replace(self, reach=1.0).space(model, (key,))
            replays = self.replays(model, space, near, self.misfit, on_one=True)
            known = Schedules(self.misfit, {r.record.file: r.calibrations for r in replays})
            self._schedules[key.declared, model] = known
        return known

    def about(self, replays: Sequence[Replay]) -> "Library":
        """Return the library whose records in motion start where others do; itself where no start is fitted."""
        if not fits_starts(replays):
            return self
        data = replace(self.data, records=tuple(ready.record for ready in by_record(replays)))
        return replace(self, data=data, _problems={})

    def reachable(self, strengths: ArrayLike) -> Array:
        """Return strengths, as shares of their declared range, within what a fit may start from."""
        return np.asarray(np.clip(strengths, WEAKEST_START, self.reach), dtype=np.float64)

    def for_misfit(self, misfit: float) -> "Library":
        """Return the library for what comes next to a fit with such a misfit; itself where that is about its own."""
        return self if 0.5 < misfit / self.misfit < 2.0 else replace(self, misfit=misfit, _problems={})

    def with_data(self, data: WhitenedData, as_read: WhitenedData | None = None) -> "Library":
        """Return the library with other data of the same records."""
        return replace(self, data=data, as_read=as_read, _problems={})

    def of_records(self, which: Sequence[int]) -> "Library":
        """Return the library with some of its records alone."""
        read = None if self.as_read is None else self.as_read.of_records(which)
        return replace(self.with_data(self.data.of_records(which), read), _schedules={})

    def recalibrated(self, active: Active, values: Mapping[str, float], misfit: float) -> WhiteRecords | None:
        """Return the problem in other steps where those at hand are too coarse at some values, else None.

        misfit: of the fit to which the values belong.
        """
        records = self.problem(active)
        replays = self.replays(records.model, records.space, values, misfit, at_hand=records.replays)
        if are_scheduled_alike(replays, records.replays):
            return None
        self._problems[frozenset(active)] = again = replace(records, replays=replays)
        return again

    def for_estimate(
        self, active: Active, values: Mapping[str, float], misfit: float, at_hand: Sequence[Replay]
    ) -> "Library":
        """Return the library whose problem with some effects is as accurate as their estimate asks for."""
        problem, noise = self.problem(active), [level.hides for level in self.data.levels]
        replays = calibrated_replays(self.data.records, problem.model, problem.space, values, False, noise,
                                     self.hidden_error(misfit), 0, at_hand)  # fmt: skip
        return replace(self, _problems={frozenset(active): replace(problem, replays=replays)})

    def replays(
        self, model: Model, space: Space, near: Mapping[str, float], misfit: float, on_one: bool = False,
        at_hand: Sequence[Replay] = (),
    ) -> tuple[Replay, ...]:  # fmt: skip
        """Return the train records ready to be simulated, as finely as a residual so many times the noise asks for."""
        noise = [level.innovation for level in self.data.levels]
        return calibrated_replays(self.data.records, model, space, near, on_one, noise, self.hidden_error(misfit),
                                  at_hand=at_hand)  # fmt: skip

    def hidden_error(self, misfit: float) -> float:
        """Return the mean square that the engine's error may have next to such a misfit, in units of the noise."""
        return HIDDEN_ERROR * misfit**2 / len(self.data.sound)

    def compiled_model(self, active: Active) -> Model:
        """Return a model that holds the first bundle with all of some candidates, or those alone where none has."""
        wanted = declared_keys(active)
        apart = tuple(sorted(wanted, key=lambda k: k.compiled))
        keys = next((bundle for bundle in self.bundles if wanted <= set(bundle)), apart)
        if keys not in self._models:
            self.say(f"preparing a model with {len(keys) or 'no'} candidates (compiled at its first use)")
            effects = (*self.declared.effects, *(compiled(k, self.candidates[k]) for k in keys))
            tests = map(bump_at, self.declared.plant.ports if keys in self.tested else ())
            self._models[keys] = Model(self.declared.plant, (*effects, *tests))
        return self._models[keys]

    @property
    def tested(self) -> tuple[Active, ...]:
        """The bundle whose model holds the test signals too, which would be one more to compile: the last."""
        return self.bundles[-1:]

    def with_test_signals(self, model: Model) -> Model:
        """Return a model that holds all of another, and a test signal at each port."""
        for whole in map(self.compiled_model, self.tested):
            if model.parameters.keys() <= whole.parameters.keys():
                return whole
        held = {effect.name for effect in model.effects}
        tests = [test for test in map(bump_at, model.plant.ports) if test.name not in held]
        return replace(model, effects=(*model.effects, *tests)) if tests else model

    def space(self, model: Model, active: Active) -> Space:
        """Return the space of a compiled model in which the candidates that are not active rest at their null."""
        names, own = set(model.parameters), self.own_shapes if self.own_shapes_free else ()
        space = space_of(
            model, self.overrides, {n: b for n, b in self.bounds.items() if n in names},
            {n: v for n, v in self.fixed.items() if n in names},
        )  # fmt: skip
        for name, (low, high) in self.widened.items():
            space = space.with_bounds(name, low, high)
        for name, parameter in model.parameters.items():
            owner = self.owner(name)
            mine = next((k for k in active if k.declared == owner), None)
            if (owner is not None and mine is None) or name.startswith(PROBE):
                space = space.with_fixed(name, idle(parameter))
            elif name in own or (mine is not None and mine.free_shape and name in self.fixed_shapes(mine)):
                space = space.with_bounds(name, parameter.low, parameter.high)
            elif self.reach > 1.0 and mine is not None and name in space.free_names and name in self.scaled_strengths:
                space = space.with_bounds(name, *self.box_of(name, parameter))
        for key in active:
            for name in self.waves_of(key, model.parameters):
                low, high = model.parameters[name].low, model.parameters[name].high
                if low < self.least_waves < high:
                    space = space.with_bounds(name, self.least_waves, high)
        return space

    def box_of(self, name: str, parameter: Parameter) -> tuple[float, float]:
        """Return how far a strength may be searched whose declared range is a size to expect."""
        if name.startswith(ERROR_OF):
            return max(FARTHEST * parameter.low, LEAST_ERROR), FARTHEST * parameter.high
        return self.reach * parameter.low, self.reach * parameter.high

    @cached_property
    def scaled_strengths(self) -> frozenset[str]:
        """Names of strengths in units of the machine's scales, and of errors, whose range the user did not give."""
        effects = [(e.name, e) for e in self.declared.effects]
        effects += [(key.compiled, effect) for key, effect in self.candidates.items()]
        names = (f"{name}.{p.name}" for name, effect in effects for p in effect.parameters
                 if p.null == 0.0 and p.fixed is None and (powers_of(p.unit) or name.startswith(ERROR_OF)))  # fmt: skip
        return frozenset(names) - {*self.bounds, *self.fixed, *self.overrides}

    @cached_property
    def scaled_by_plant(self) -> frozenset[str]:
        """Names of parameters of the plant in units of its scales, whose range the user did not give."""
        names = (p.name for p in self.declared.plant.parameters if p.fixed is None and powers_of(p.unit))
        return frozenset(names) - {*self.bounds, *self.fixed, *self.overrides}

    def log_odds(self, effect: str, default: float) -> float:
        """Return the log prior odds of an effect: what the user knows of it, else the default."""
        given = self.priors.get(effect)
        return default if given is None else float(np.log(given / (1.0 - given)))

    def declared_ranges(self, model: Model, key: EffectKey) -> dict[str, tuple[float, float]]:
        """Return the declared ranges of those strengths of an effect whose box is wider."""
        if self.reach == 1.0:
            return {}
        names = (n for n in self.scaled_strengths if key.owns(n))
        return {n: (model.parameters[n].low, model.parameters[n].high) for n in names}

    def strength_of(self, name: str, parameter: Parameter) -> float:
        """Return the declared size of a strength: from its off value to the farther end of its range."""
        assert parameter.null is not None
        low, high = self.bounds.get(name, (parameter.low, parameter.high))
        return max(abs(low - parameter.null), abs(high - parameter.null))

    def fixed_shapes(self, key: EffectKey) -> tuple[str, ...]:
        """Return the parameters of a candidate that are fixed by its declaration alone."""
        return self.not_given(key.compiled, self.candidates[key.declared])

    @cached_property
    def own_shapes(self) -> tuple[str, ...]:
        """The parameters of the declared model's effects that are fixed by the declarations of these alone."""
        return tuple(name for effect in self.declared.effects for name in self.not_given(effect.name, effect))

    def not_given(self, name: str, effect: Effect) -> tuple[str, ...]:
        given = {*self.bounds, *self.fixed, *(n for n, o in self.overrides.items() if o.fixed is not None)}
        shapes = (f"{name}.{p.name}" for p in effect.parameters if p.fixed is not None)
        return tuple(n for n in shapes if n not in given)

    def each(self, work: Callable[[S], T], items: Iterable[S]) -> list[T]:
        return side_by_side(work, items, self.threads)


@dataclass(frozen=True, eq=False)
class Schedules:
    """Hold how finely a candidate alone is simulated on each file, found for a misfit."""

    misfit: float
    by_file: Mapping[str, tuple[Calibration, ...]]

    def serves(self, misfit: float) -> bool:
        return self.misfit <= FURTHER_ERROR * misfit


def scheduled_replays(records: Sequence[Record], model: Model, known: Sequence[Schedules]) -> tuple[Replay, ...]:
    """Return records ready to be simulated, each piece on the finest of some schedules."""
    ready: list[Replay] = []
    for record in records:
        calibrations = finest(*(s.by_file[record.file] for s in known))
        ready += ReadyRecord(record.until_window_end(), model, calibrations).each
    return tuple(ready)


def library_of(
    declared: Model,
    candidates: Mapping[str, Effect],
    data: WhitenedData,
    overrides: Mapping[str, Override],
    bounds: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float],
    threads: int = 1,
    say: Callable[[str], None] = lambda _: None,
    tolerances: Mapping[str, float] | None = None,
) -> Library:
    """Return the candidates that are not part of a model yet and whose ports its plant offers.

    Raises ArmidError for bounds or a fixed value of a parameter that neither the model nor a candidate has.
    """
    offered = [f"{e.name}.{p.name}" for c in candidates.values() for e in c.every_form for p in e.parameters]
    names, none = tuple(dict.fromkeys([*declared.parameters, *offered])), np.empty(0)
    for name in (*bounds, *fixed):
        Space(names, (), none, none, none).index(name)
    present = {e.name for e in declared.effects}
    applicable = {
        EffectKey(effect.name, "" if form is effect else form.form): form
        for effect in candidates.values() if effect.name not in present
        for form in effect.searched_forms if joined(declared, form) is not None
    }  # fmt: skip
    applicable = distinct(applicable, declared.plant)

    def for_each_form(given: Mapping[str, T]) -> dict[str, T]:
        """Repeat what is given for a parameter for every form of its effect that has a parameter of that name."""
        names = {f"{k.compiled}.{p.name}": f"{k.name}.{p.name}" for k, e in applicable.items() for p in e.parameters}
        return dict(given) | {own: given[public] for own, public in names.items() if public in given}

    return Library(declared, declared, applicable, data, bundled(declared, applicable), for_each_form(overrides),
                   for_each_form(bounds), for_each_form(fixed), threads, say, tolerances or {})  # fmt: skip


# Candidates of one calibration, the factor of a known value within which they lie, and the schedules that are tried:
# friction over a width that a fast machine passes at once asks for 32 steps.
N_PROBES_ABOUT, NEAR_VALUE, SUBSTEPS_TRIED = 8, 2.0, (1, 2, 4, 8, 16, 32)
# A weak strength, and the weakest from which a fit starts, as shares of the way from the null to a bound; shapes:
# points along each of 1, 2, 3 ranges.
WEAK_STRENGTH, WEAKEST_START = 0.03, 0.01
SHAPES = {0: (), 1: (8,), 2: (7, 3), 3: (5, 3, 2)}
# Ratio of sampling intervals within which what is tried is simulated in the same steps.
SAME_INTERVAL = 1.05
# What the engine's error may add to chi2 of a residual that is noise, and in proportion to one that is more.
HIDDEN_ERROR = 0.1


def calibrated_replays(
    records: Sequence[Record],
    model: Model,
    space: Space,
    near: Mapping[str, float],
    on_one: bool = False,
    noise: Sequence[float] | None = None,
    hidden: float = 0.0,
    n_probes: int = N_PROBES_ABOUT,
    at_hand: Sequence[Replay] = (),
) -> tuple[Replay, ...]:
    """Make records ready to be simulated, as accurately as their noise asks for or as a decision can tell.

    near: values about which it is calibrated; the candidates lie within a factor of 2 of them. on_one: on one record of
    each sampling interval, for all others of about the same. noise: of each signal [its unit]; hidden: largest mean
    square of the engine's error, in units of the noise. n_probes: candidates about the known values that count too.
    at_hand: the same records in steps that are kept where they are accurate enough.
    """
    low, high = space.low[space.free].copy(), space.high[space.free].copy()
    for i, name in enumerate(space.free_names):
        if name in near:
            ends = sorted((near[name] / NEAR_VALUE, near[name] * NEAR_VALUE))
            low[i], high[i] = max(low[i], ends[0]), min(high[i], ends[1])
    nulls = {i: null for i, n in enumerate(space.free_names)
             if n not in near and (null := model.parameters[n].null) is not None}  # fmt: skip
    # What is tried first is weak, and a short lag may ask for finer steps than all that the box is likely to hold; an
    # estimate is judged itself.
    first = 0.5 * (low + high)
    if not nulls:
        first = np.clip([near.get(n, m) for n, m in zip(space.free_names, first, strict=True)], low, high)
    for i, null in nulls.items():
        first[i] = null + WEAK_STRENGTH * max(low[i] - null, high[i] - null, key=abs)
    rows = np.vstack([probes(low, np.maximum(high, low), n_probes), first])
    spread = space.complete(rows)
    outputs = [o.name for o in model.plant.outputs]
    allowed, levels = None, iter(noise or ())
    asked: dict[object, tuple[Manoeuvre, Array | None, str, Calibration | None]] = {}
    ready: list[tuple[Record, list[object]]] = []
    held = {r.record.file: r.calibrations for r in at_hand}
    for record in records:
        if noise is not None:
            allowed = np.full(len(outputs), np.inf)
            for signal in record.signals:
                allowed[outputs.index(signal.output) if signal.output else 0] = np.sqrt(hidden) * next(levels)
        record = record.until_window_end()  # noqa: PLW2901
        accuracy = accuracy_against(record.noises, model)
        about = [int(np.log(p.manoeuvre.interval) / np.log(SAME_INTERVAL)) for p in record.pieces]
        ours = held.get(record.file) or (None,) * len(about)
        likenesses: list[object] = [(accuracy, id(kept), i if on_one else p.manoeuvre.likeness())
                                    for p, i, kept in zip(record.pieces, about, ours, strict=True)]  # fmt: skip
        for likeness, piece, kept in zip(likenesses, record.pieces, ours, strict=True):
            # of several the one whose input jumps most often: steps that are rough at jumps alone are many there
            if likeness not in asked or piece.manoeuvre.changes > asked[likeness][0].changes:
                asked[likeness] = (piece.manoeuvre, allowed, accuracy, kept)
        ready.append((record, likenesses))
    known = {likeness: quickly_calibrated(model, manoeuvre, spread, most, accuracy, kept)
             for likeness, (manoeuvre, most, accuracy, kept) in asked.items()}  # fmt: skip
    return tuple(
        one
        for record, likenesses in ready
        for one in ReadyRecord(record, model, tuple(known[likeness] for likeness in likenesses)).each
    )


def are_scheduled_alike(replays: Sequence[Replay], others: Sequence[Replay]) -> bool:
    """Tell whether each piece is simulated in the very steps of other replays of the same records."""
    pairs = zip(replays, others, strict=True)
    return all(new is old for a, b in pairs for new, old in zip(a.calibrations, b.calibrations, strict=True))


def finest(*calibrations: Sequence[Calibration]) -> tuple[Calibration, ...]:
    """Return of several calibrations of the same pieces the finest for each, of equal ones the first."""
    return tuple(max(each, key=lambda c: c.fineness) for each in zip(*calibrations, strict=True))


def some_of(run: Simulation, which: slice | NDArray[np.bool_]) -> Simulation:
    """Return a simulation of some of its candidates."""
    return replace(run, outputs=run.outputs[:, which], failed=run.failed[which])


def quickly_calibrated(
    model: Model, manoeuvre: Manoeuvre, spread: Array, rms: Array | None = None, accuracy: str = STANDARD,
    at_hand: Calibration | None = None,
) -> Calibration:  # fmt: skip
    """Return the coarsest of few schedules whose error on the candidates stays within half of what is allowed.

    Or within half of `rms`, that of each output [its unit], (n_outputs,), as a root mean square over the samples; the
    one at hand where its error does.
    `calibrate` would go on to steps that a screening of candidates cannot pay (a ripple so fine that the motion is a
    matter of chance asks for 128 in a sample), and would look for steps over several samples.
    """
    allowed = ALLOWED[accuracy] * model.plant.sizes[0]

    def judged(run: Simulation, finer: Simulation) -> tuple[float, bool, bool]:
        """Return the error of a simulation, whether the noise hides it, and whether it is accurate enough."""
        # Steps with which nothing is simulated have no error to be judged by.
        error = np.inf if finer.failed.all() else difference(run, finer, model) * 16 / 15
        both = ~(run.failed | finer.failed)
        square = np.mean((run.outputs[:, both] - finer.outputs[:, both]) ** 2, axis=-1)
        largest = np.sqrt(np.max(square, axis=1, initial=0.0)) * 16 / 15
        is_hidden = rms is not None and bool((largest <= MARGIN_OF_STEPS * rms).all())
        good = (error <= MARGIN_OF_STEPS * allowed or is_hidden) and not finer.failed.all()
        return error, is_hidden, good and not (run.failed & ~finer.failed).any()

    runs = {n: simulate(model, manoeuvre, spread, Schedule(n)) for n in SUBSTEPS_TRIED[:2]}
    for n in SUBSTEPS_TRIED:
        runs[2 * n] = runs.get(2 * n) or simulate(model, manoeuvre, spread, Schedule(2 * n))
        error, is_hidden, good = judged(runs[n], runs[2 * n])
        if good:
            break
    schedule = Schedule(n, weights=switch_weights(spread, runs[n]))
    # A candidate that the finest steps do not follow judges no schedule.
    each = [slice(i, i + 1) for i in range(len(spread))]
    sound = np.array([judged(some_of(runs[n], i), some_of(runs[2 * n], i))[2] for i in each])
    if at_hand is not None and (good or at_hand.schedule.substeps >= n):
        run = simulate(model, manoeuvre, spread[sound], at_hand.schedule) if sound.any() else None
        if run is None or judged(run, some_of(runs[2 * n], sound))[2]:
            return at_hand
    spared = None
    if sound.any():
        spared = with_rough_samples(model, manoeuvre, spread[sound], schedule, lambda run, finer: judged(run, finer)[2])
    if spared is not None:
        schedule = spared[0]
        error, is_hidden = judged(*spared[1:])[:2] if good else (error, is_hidden)
    return Calibration(schedule, error, is_hidden or bool(error <= allowed))


# A schedule serves until the residual is so many times smaller than that for which it was found.
FURTHER_ERROR = 2.0
# From this ratio of its bounds on, points along a range are even in the logarithm.
WIDE = 5.0


@dataclass(frozen=True, eq=False)
class Activation:
    """Hold one way to switch an effect on: values at full strength, those of the null, and the share that is tried."""

    full: dict[str, float]
    null: dict[str, float]
    share: float

    def at(self, share: float) -> dict[str, float]:
        return {n: self.null[n] + share * (v - self.null[n]) if n in self.null else v for n, v in self.full.items()}


def activation_grid(
    records: WhiteRecords, key: EffectKey, ranges: Mapping[str, tuple[float, float]], shares: Sequence[float],
    places: Mapping[str, Array],
) -> list[Activation]:  # fmt: skip
    """Return the grid over strengths and shapes of one effect.

    Strengths are the free parameters with a null value: each alone, and all together where there are several.
    ranges: of parameters whose box is wider than what is tried. shares: of the range, over which a strength is tried.
    places: of shapes that are tried at these values.
    """
    space, declared = records.space, records.model.parameters
    mine = [n for n in space.free_names if key.owns(n)]
    null = {n: float(v) for n in mine if (v := declared[n].null) is not None}
    bound = {n: (space.low[space.index(n)], space.high[space.index(n)]) for n in mine} | dict(ranges)
    shapes = [n for n in mine if n not in null]
    along = [places[n] if n in places else points_within(*bound[n], count)
             for n, count in zip(shapes, shape_counts(len(shapes)), strict=True)]  # fmt: skip
    points = [dict(zip(shapes, map(float, p), strict=True)) for p in product(*along)]
    chosen = [(n,) for n in null] + ([tuple(null)] if len(null) > 1 else [])
    activations = []
    for names, side, shape in product(chosen, (1, 0), points):
        full = {n: float(bound[n][side]) if n in names else null[n] for n in null}
        if all(full[n] != null[n] for n in names):
            activations += [Activation(shape | full, null, share) for share in shares]
    return activations


def shape_counts(n_shapes: int) -> tuple[int, ...]:
    """Return at how many places of its range each of the shapes of an effect is tried."""
    return SHAPES.get(n_shapes, (2,) * n_shapes)


def points_within(low: float, high: float, count: int) -> Array:
    shares = (np.arange(count) + 0.5) / count
    if low > 0.0 and high > WIDE * low:
        return np.asarray(low * (high / low) ** shares)
    return np.asarray(low + (high - low) * shares)
