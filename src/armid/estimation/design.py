"""What one more record would buy: the intervals to expect from each manoeuvre that could be made next."""

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from armid.engine import Schedule, simulate
from armid.engine.simulate import Simulation
from armid.estimation.constants import moved_constants
from armid.estimation.information import inverse
from armid.estimation.least_squares import slopes_of, stencil
from armid.estimation.noise_model import Level
from armid.model import Array, Manoeuvre, ManoeuvreKey, Model, Plant
from armid.problem.problem import Replay, by_output
from armid.problem.space import Space
from armid.record import Record

Key = float | bool | str
# Information before any record, per squared range: a uniform density over the bounds has the variance range^2/12.
BOX = 12.0
VOLUME, WORST, SHRINKAGE = "volume", "worst", "shrinkage"
# How many places of the travel are tried, its ends left alone by so much of it; start and target are so far apart.
N_PLACES_OF_STROKE, ENDS_LEFT, APART_SHARE = 6, 0.05, 0.15
# A place is rounded by at most this share of the range.
ROUGHEST = 0.02
# Part of its largest recorded value to which another key is turned down (a supply); a higher one may be unsafe.
TURNED_DOWN, MOST_LEVELS = 0.85, 3
# What is done to recorded inputs: size, and how many times as fast.
SIZES_OF_INPUTS, PACES = (1.0, -1.0, 0.5, -0.5), (1.0, 2.0, 0.5)
# How much finer than the records asked for time is cut: a manoeuvre that nobody calibrated may be stiffer.
FINER_GRID = 2
# A speed below this part of the fastest record's rms is not motion.
MOVED_AT_LEAST = 0.05
# States of a machine that is driven by inputs may range this much wider than in its records.
WIDER_STATES = 1.05
# Ends of keys that are units, and how people write them.
UNITS_OF_KEYS = {
    "rad_s": "rad/s", "deg_s": "deg/s", "m_s": "m/s", "N_m": "N m", "rad": "rad", "deg": "deg", "kg": "kg", "V": "V",
    "A": "A", "N": "N", "m": "m", "s": "s",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Feasible:
    """A manoeuvre that could be made next.

    keys: as campaign.toml would say it; of changed inputs: `like`, `size` and `pace`. manoeuvre: with the sampling of
    `window`, the samples that would count. repeats: file of the train record that it repeats, or "".
    """

    keys: Mapping[str, Key]
    manoeuvre: Manoeuvre
    window: slice
    repeats: str = ""

    @property
    def name(self) -> str:
        return words(self.keys, self.repeats)

    def of(self, plant: Plant, shares: Mapping[str, float]) -> Manoeuvre:
        """Return the manoeuvre of a machine whose constants are off by some shares."""
        moved = moved_constants(self.manoeuvre, plant, shares)
        return replace(self.manoeuvre, constants={**self.manoeuvre.constants, **moved})


@dataclass(frozen=True, eq=False)
class Offer:
    """What one more record of a manoeuvre would give.

    before, after: standard deviations, SI, (n_free,), infinite where not determined. gain: what offers are ranked by,
    above 1 where the record helps: by "volume" the mean factor by which deviations shrink (D-optimality), by "worst"
    the factor of the worst parameter as a share of its range, by "shrinkage" the largest factor of all.
    """

    feasible: Feasible
    before: Array
    after: Array
    gain: float

    @property
    def best(self) -> int:
        with np.errstate(invalid="ignore"):
            factors = self.before / self.after
        return int(np.argmax(np.nan_to_num(factors, nan=1.0, posinf=np.inf)))


def offers(
    motions: "Motions", grid: Iterable[Feasible], space: Space, x: Array, fisher: Array, levels: Sequence[Level],
    by: str = VOLUME,
) -> tuple[Offer, ...]:  # fmt: skip
    """Return what each feasible manoeuvre would buy, the best first.

    F' = F + sum over outputs of f J^T J / level^2 with J the sensitivities in the new record; deviations are those of
    F'^-1. Ranking counts the box as a first record, so that what is not determined yet has a finite deviation, too.
    fisher: information of the records in shares of the range; levels: of the outputs of the new record.
    """
    low, span = space.low[space.free], space.high[space.free] - space.low[space.free]
    candidates = space.complete(low + stencil((x - low) / span) * span)
    before, offers = np.sqrt(np.diag(inverse(fisher))) * span, []
    for feasible, signals in motions.signals(grid, candidates):
        more = fisher
        for level, signal in zip(levels, signals, strict=True):
            slopes = slopes_of(signal)
            more = more + level.effective_fraction / level.rms**2 * slopes @ slopes.T
        offers.append(Offer(feasible, before, np.sqrt(np.diag(inverse(more))) * span, gain(fisher, more, by)))
    return tuple(sorted(offers, key=lambda offer: -offer.gain))


def gain(fisher: Array, more: Array, by: str) -> float:
    known = BOX * np.eye(len(fisher))
    if by == VOLUME:
        volumes = np.linalg.slogdet(more + known)[1] - np.linalg.slogdet(fisher + known)[1]
        return float(np.exp(0.5 * volumes / len(fisher)))
    before, after = (np.sqrt(np.diag(np.linalg.inv(m + known))) for m in (fisher, more))
    return float(before.max() / after.max() if by == WORST else np.max(before / after))


def expected_levels(replays: Sequence[Replay], levels: Sequence[Level]) -> tuple[Level, ...]:
    """Return the level to expect of each output: mean square, mean share of independent samples."""
    return tuple(Level(float(np.sqrt(np.mean([level.rms**2 for level in group]))),
                       float(np.mean([level.effective_fraction for level in group])))
                 for group in by_output(replays, levels).values())  # fmt: skip


def manoeuvre_grid(model: Model, records: Sequence[Record]) -> tuple[Feasible, ...]:
    """Return what a machine could be made to do next, sampled and windowed like the longest of its records.

    A plant whose records differ by keys: six places of the travel for start and target, well apart; true and false; the
    recorded values of any other key and 0.85 of the largest. A plant that is driven by inputs: each record's at full
    and half size, as it was and reversed, as fast as it was, twice and half as fast. What was recorded comes first.
    """
    new = changed_inputs(records) if model.plant.inputs else keyed(model.plant, records)
    seen: dict[object, Feasible] = {}
    for feasible in (*(as_recorded(model.plant, r) for r in records), *new):
        seen.setdefault(identity(feasible.manoeuvre), feasible)
    return tuple(seen.values())


def identity(manoeuvre: Manoeuvre) -> object:
    constants = tuple(sorted((name, round(value, 9)) for name, value in manoeuvre.constants.items()))
    return constants, manoeuvre.n_samples, tuple(v.tobytes() for v in manoeuvre.inputs.values())


def as_recorded(plant: Plant, record: Record) -> Feasible:
    piece = record.pieces[0].until_window_end()
    constants = piece.manoeuvre.constants
    keys: dict[str, Key] = {
        k.key: bool(constants[k.constant]) if k.boolean else round(constants[k.constant] / k.factor, 9)
        for k in plant.keys if k.constant in constants
    }  # fmt: skip
    return Feasible(keys or {"like": record.file}, piece.manoeuvre, piece.window, record.file)


def keyed(plant: Plant, records: Sequence[Record]) -> Iterator[Feasible]:
    piece = max(records, key=lambda r: r.duration).pieces[0].until_window_end()
    by_constant = {k.constant: k for k in plant.keys}
    pairs = [(k, by_constant[k.unlike]) for k in plant.keys if k.unlike in by_constant]
    for values in product(*(key_levels(plant, k, records) for k in plant.keys)):
        keys = dict(zip((k.key for k in plant.keys), values, strict=True))
        # Places that must be unlike each other (start and target) are far enough apart to be a motion.
        apart = (abs(keys[a.key] - keys[b.key]) >= APART_SHARE * ((a.high or 0.0) - (a.low or 0.0)) for a, b in pairs)
        if keys and all(apart):
            constants = {k.constant: float(keys[k.key]) * k.factor for k in plant.keys}
            yield Feasible(keys, piece.with_constants(constants).manoeuvre, piece.window)


def key_levels(plant: Plant, key: ManoeuvreKey, records: Sequence[Record]) -> tuple[float | bool, ...]:
    if key.boolean:
        return (True, False)
    low, high = range_of(key)
    if is_place(plant, key):
        room = ENDS_LEFT * (high - low)
        # whole units where the range is one of many, as in degrees; else as fine as tells the places apart
        decimals = max(0, int(np.ceil(-np.log10(ROUGHEST * (high - low)))))
        return tuple(float(v) for v in np.round(np.linspace(low + room, high - room, N_PLACES_OF_STROKE), decimals))
    default = next(c.value for c in plant.constants if c.name == key.constant)
    recorded = {round(r.constants.get(key.constant, default) / key.factor, 9) for r in records}
    some = sorted(recorded, reverse=True)[:MOST_LEVELS]
    levels = sorted({*some, float(f"{TURNED_DOWN * max(some):.2g}")}, reverse=True)
    return tuple(v for v in levels if low <= v <= high)


def is_place(plant: Plant, key: ManoeuvreKey) -> bool:
    """Tell whether a key is a place of the travel: where a state starts, or a target that must be unlike it."""
    low, high = range_of(key)
    if key.boolean or not np.isfinite(high - low):
        return False
    starts = {k.constant for k in plant.keys for s in plant.states if starts_at(s.initial, k, key.factor * low)}
    return key.constant in starts or key.unlike in starts


def range_of(key: ManoeuvreKey) -> tuple[float, float]:
    return -np.inf if key.low is None else key.low, np.inf if key.high is None else key.high


def starts_at(initial: Callable[..., float], key: ManoeuvreKey, value: float) -> bool:
    return list(inspect.signature(initial).parameters) == [key.constant] and initial(value) == value


def key_travel(plant: Plant) -> dict[str, tuple[float, float]]:
    """Return state -> its range, SI, where the state starts at the constant of a key that has a range."""
    ranges = {}
    for key, state in product(plant.keys, plant.states):
        ends = [key.factor * end for end in range_of(key)]
        if np.isfinite(ends).all() and starts_at(state.initial, key, ends[0]):
            ranges[state.name] = (min(ends), max(ends))
    return ranges


def changed_inputs(records: Sequence[Record]) -> Iterator[Feasible]:
    """Yield the recorded inputs at other sizes and paces, from the start that they were recorded with.

    An input that never changes its sign (a supply, a switch) keeps its size; one that ends begins again. A reversed
    manoeuvre starts at the opposite speed.
    """
    # the first pair is size 1 and pace 1: what was recorded
    for record, (size, pace) in product(records, list(product(SIZES_OF_INPUTS, PACES))[1:]):
        piece = record.pieces[0].until_window_end()
        start = {n: v * np.sign(size) for n, v in piece.manoeuvre.constants.items() if n == "start_speed"}
        manoeuvre = piece.with_constants(start).manoeuvre
        inputs = {name: paced(v, pace, manoeuvre.hold) * (size if np.ptp(np.sign(v)) > 1 else 1.0)
                  for name, v in manoeuvre.inputs.items()}  # fmt: skip
        keys: dict[str, Key] = {"like": record.file, "size": size, "pace": pace}
        yield Feasible(keys, replace(manoeuvre, inputs=inputs), piece.window)


def paced(values: Array, pace: float, hold: str) -> Array:
    places = (pace * np.arange(values.size)) % values.size
    if hold == "zero":
        return np.asarray(values[places.astype(np.int64)])
    return np.asarray(np.interp(places, np.arange(values.size), values))


def words(keys: Mapping[str, Key], repeats: str) -> str:
    """Return keys in words: "raise, empty, 24 V from 20 to -40 deg" for an arm, else what the keys say."""
    if "size" in keys:
        size, pace = float(keys["size"]), float(keys["pace"])
        parts = ["reversed"] if size < 0 else []
        parts += [f"{abs(size):g} of their size"] if abs(size) != 1.0 else []
        parts += [f"{pace:g} times as fast"] if pace != 1.0 else []
        return f"the inputs of {keys['like']} {', '.join(parts) or 'as they were'}"
    ends = ("start_angle_deg", "target_angle_deg")
    if set(ends) <= set(keys):
        start, target = (float(keys[end]) for end in ends)
        others = [key_words(k, v) for k, v in keys.items() if k not in ends]
        text = f"{', '.join(['lower' if target > start else 'raise', *others])} from {start:g} to {target:g} deg"
    else:
        text = ", ".join(key_words(k, v) for k, v in keys.items())
    if repeats:
        return f"{repeats} once more ({text})" if text and "like" not in keys else f"{repeats} once more"
    return text


def key_words(key: str, value: Key) -> str:
    if isinstance(value, bool):
        if key == "shell":
            return "with shell" if value else "empty"
        return key if value else f"no {key}"
    if isinstance(value, str):
        return f"{key} {value}"
    unit = next((u for u in UNITS_OF_KEYS if key.endswith(f"_{u}")), "")
    name = key.removesuffix(f"_{unit}")
    text = f"{value:g} {UNITS_OF_KEYS[unit]}" if unit else f"{value:g}"
    return text if name == "supply" else f"{name} {text}"


def fine_schedule(replays: Sequence[Replay]) -> Schedule:
    """Return how finely a manoeuvre is simulated: twice as finely as the record that asks for the finest steps."""
    finest = max((c for r in replays for c in r.calibrations), key=lambda c: c.fineness).schedule
    finer = Schedule(FINER_GRID * finest.substeps)
    if finest.rough is None:
        return finer
    rough, refinement = finest.rough / FINER_GRID, FINER_GRID * finest.refinement
    return replace(finer, rough=rough, refinement=refinement, stages=finest.stages)


class Motions:
    """Simulate manoeuvres and leave out those that the machine could not make.

    replays: of the train records, they say how finely to cut time and, for a machine driven by inputs, how far it may
    move. candidate: whole, SI, the one that must stay feasible. speed_limit: the gyro's range. shares: what is added to
    constants of the manoeuvres, as shares of their values.
    """

    def __init__(
        self, replays: Sequence[Replay], candidate: Array, speed_limit: float | None = None,
        shares: Mapping[str, float] | None = None,
    ) -> None:  # fmt: skip
        self.model: Model = replays[0].model
        self.shares = shares or {}
        self.schedule = fine_schedule(replays)
        self.candidate = candidate
        self.speed_limit = np.inf if speed_limit is None else speed_limit
        sizes = by_output(replays, [float(np.sqrt(np.mean(r.measured**2))) for r in replays])
        self.places, self.slowest = list(sizes), [MOVED_AT_LEAST * max(of_output) for of_output in sizes.values()]
        self.travel = key_travel(self.model.plant)
        self.extents = self._recorded_extents(replays) if self.model.plant.inputs else {}

    def signals(self, grid: Iterable[Feasible], candidates: Array) -> Iterator[tuple[Feasible, Array]]:
        """Yield each manoeuvre that can be made with its signals, (n_outputs, n_candidates, n_samples)."""
        population = np.concatenate([self.candidate[np.newaxis], candidates])
        for feasible in grid:
            manoeuvre = feasible.of(self.model.plant, self.shares)
            run = simulate(self.model, manoeuvre, population, self.schedule, states=True)
            if self.can_be_made(run):
                yield feasible, run.outputs[self.places, 1:, feasible.window]

    def can_be_made(self, run: Simulation) -> bool:
        """Tell whether the first candidate moves, within the travel, the gyro's range and what was recorded."""
        if run.failed.any():
            return False
        signals, states = run.outputs[self.places, 0], {name: values[0] for name, values in run.states.items()}
        moves = any(np.sqrt(np.mean(y**2)) >= slowest for y, slowest in zip(signals, self.slowest, strict=True))
        outputs = [self.model.plant.outputs[place] for place in self.places]
        speeds = [np.abs(y).max() for y, o in zip(signals, outputs, strict=True) if o.unit in ("rad/s", "m/s")]
        moves = moves and max(speeds, default=0.0) <= self.speed_limit
        inside = all(low <= states[name].min() and states[name].max() <= high
                     for name, (low, high) in self.travel.items())  # fmt: skip
        return moves and inside and all(np.ptp(states[name]) <= wide for name, wide in self.extents.items())

    def _recorded_extents(self, replays: Sequence[Replay]) -> dict[str, float]:
        """Return state -> how wide it may range: a little more than in the records, for states that files show."""
        widest = {name: 0.0 for name, state in self.model.states.items() if state.column}
        for piece in (piece for replay in replays for piece in replay.pieces):
            run = simulate(self.model, piece.manoeuvre, self.candidate[np.newaxis], self.schedule, states=True)
            widest = {name: max(wide, WIDER_STATES * float(np.ptp(run.states[name]))) for name, wide in widest.items()}
        return widest
