"""Manoeuvres that a machine could make next: a grid over what its keys allow, or its recorded inputs changed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armid.identifiability.travel import is_place
from armid.model import Manoeuvre, ManoeuvreKey, Model, Plant
from armid.record import Piece, Record

Array = NDArray[np.float64]
Key = float | bool | str
# How many places of the travel are tried, its ends left alone by so much of it; start and target are so far apart.
N_PLACES, MARGIN, APART = 6, 0.05, 0.15
# Part of its largest recorded value to which another key is turned down (a supply); up is not said to be safe.
TURNED_DOWN, MOST_LEVELS = 0.85, 3
# What is done to recorded inputs: size, and how many times as fast.
SIZES, PACES = (1.0, -1.0, 0.5, -0.5), (1.0, 2.0, 0.5)

# Ends of keys that are units, and how people write them.
UNITS = {
    "rad_s": "rad/s", "deg_s": "deg/s", "m_s": "m/s", "N_m": "N m", "rad": "rad", "deg": "deg", "kg": "kg", "V": "V",
    "A": "A", "N": "N", "m": "m", "s": "s",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Feasible:
    """Hold a manoeuvre that could be made next.

    keys: as campaign.toml would say it, key -> value; of changed inputs: `like`, `size` and `pace`. manoeuvre: with the
    sampling of `window`, the samples that would count. repeats: file of the train record that it repeats, or "".
    """

    keys: Mapping[str, Key]
    manoeuvre: Manoeuvre
    window: slice
    repeats: str = ""

    @property
    def name(self) -> str:
        """The manoeuvre in words."""
        return words(self.keys, self.repeats)


def manoeuvre_grid(model: Model, records: Sequence[Record]) -> tuple[Feasible, ...]:
    """Return what a machine could be told to do next, sampled and windowed like the longest of its records.

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
    """Return what tells two manoeuvres apart."""
    constants = tuple(sorted((name, round(value, 9)) for name, value in manoeuvre.constants.items()))
    return constants, manoeuvre.n_samples, tuple(v.tobytes() for v in manoeuvre.inputs.values())


def as_recorded(plant: Plant, record: Record) -> Feasible:
    """Return a record's manoeuvre once more."""
    piece = record.pieces[0].until_window_end()
    keys = {k.key: key_of(k, piece.manoeuvre.constants) for k in plant.keys if k.constant in piece.manoeuvre.constants}
    return Feasible(keys or {"like": record.file}, piece.manoeuvre, piece.window, record.file)


def key_of(key: ManoeuvreKey, constants: Mapping[str, float]) -> Key:
    """Return the value of a key that gives a constant."""
    value = constants[key.constant]
    return bool(value) if key.boolean else round(value / key.factor, 9)


def keyed(plant: Plant, records: Sequence[Record]) -> Iterator[Feasible]:
    """Yield the grid over the plant's keys, everything else as in the longest record."""
    piece = max(records, key=lambda r: r.duration).pieces[0].until_window_end()
    levels = [key_levels(plant, k, recorded_values(plant, k, records)) for k in plant.keys]
    for values in product(*levels):
        keys = dict(zip((k.key for k in plant.keys), values, strict=True))
        if keys and is_apart(plant, keys):
            constants = {k.constant: float(keys[k.key]) * k.factor for k in plant.keys}
            manoeuvre = replace(piece.manoeuvre, constants={**piece.manoeuvre.constants, **constants})
            yield Feasible(keys, manoeuvre, piece.window)


def recorded_values(plant: Plant, key: ManoeuvreKey, records: Sequence[Record]) -> list[float]:
    """Return the values that a key had in records, in its own unit, the default of its constant where it had none."""
    default = next(c.value for c in plant.constants if c.name == key.constant)
    found = {round(r.constants.get(key.constant, default) / key.factor, 9) for r in records}
    return sorted(found, reverse=True)[:MOST_LEVELS]


def key_levels(plant: Plant, key: ManoeuvreKey, recorded: Sequence[float]) -> tuple[float | bool, ...]:
    """Return the values that a key takes in the grid, in its own unit."""
    if key.boolean:
        return (True, False)
    if key.low is not None and key.high is not None and is_place(plant, key):
        room = MARGIN * (key.high - key.low)
        return tuple(float(v) for v in np.round(np.linspace(key.low + room, key.high - room, N_PLACES)))
    values = {*recorded, float(f"{TURNED_DOWN * max(recorded):.2g}")}
    low, high = -np.inf if key.low is None else key.low, np.inf if key.high is None else key.high
    return tuple(v for v in sorted(values, reverse=True) if low <= v <= high)


def is_apart(plant: Plant, keys: Mapping[str, float | bool]) -> bool:
    """Tell whether places that must be unlike each other (start and target) are far enough apart to be a motion."""
    by_constant = {k.constant: k for k in plant.keys}
    pairs = [(k, by_constant[k.unlike]) for k in plant.keys if k.unlike in by_constant]
    return all(abs(keys[a.key] - keys[b.key]) >= APART * ((a.high or 0.0) - (a.low or 0.0)) for a, b in pairs)


def changed_inputs(records: Sequence[Record]) -> Iterator[Feasible]:
    """Yield the recorded inputs at other sizes and paces, from the start that they were recorded with."""
    # the first pair is size 1 and pace 1: what was recorded
    for record in records:
        piece = record.pieces[0].until_window_end()
        for size, pace in list(product(SIZES, PACES))[1:]:
            keys: dict[str, Key] = {"like": record.file, "size": size, "pace": pace}
            yield Feasible(keys, changed(piece, size, pace), piece.window)


def changed(piece: Piece, size: float, pace: float) -> Manoeuvre:
    """Return a manoeuvre whose inputs are so many times as large and as fast; where they end they begin again.

    An input that never changes its sign (a supply, a switch) keeps its size. A reversed manoeuvre starts at the
    opposite speed.
    """
    manoeuvre = piece.manoeuvre
    constants = dict(manoeuvre.constants)
    if "start_speed" in constants:
        constants["start_speed"] *= np.sign(size)
    inputs = {name: paced(v, pace, manoeuvre.hold) * (size if np.ptp(np.sign(v)) > 1 else 1.0)
              for name, v in manoeuvre.inputs.items()}  # fmt: skip
    return replace(manoeuvre, constants=constants, inputs=inputs)


def paced(values: Array, pace: float, hold: str) -> Array:
    """Return values that run so many times as fast, on the same grid, between samples as they are held."""
    places = (pace * np.arange(values.size)) % values.size
    if hold == "zero":
        return np.asarray(values[places.astype(np.int64)])
    return np.asarray(np.interp(places, np.arange(values.size), values))


def words(keys: Mapping[str, Key], repeats: str) -> str:
    """Return keys in words: "raise, empty, 24 V from 20 to -40 deg" for an arm, else what the keys say."""
    if "size" in keys:
        told = changed_words(float(keys["size"]), float(keys["pace"]))
        return f"the inputs of {keys['like']} {told}"
    text = stroke_words(keys) if {"start_angle_deg", "target_angle_deg"} <= set(keys) else plain_words(keys)
    if repeats:
        return f"{repeats} once more ({text})" if text and "like" not in keys else f"{repeats} once more"
    return text


def stroke_words(keys: Mapping[str, Key]) -> str:
    """Return the words for a stroke between two angles."""
    start, target = float(keys["start_angle_deg"]), float(keys["target_angle_deg"])
    others = [key_words(k, v) for k, v in keys.items() if k not in ("start_angle_deg", "target_angle_deg")]
    way = "lower" if target > start else "raise"
    return f"{', '.join([way, *others])} from {start:g} to {target:g} deg"


def plain_words(keys: Mapping[str, Key]) -> str:
    """Return the words for any keys."""
    return ", ".join(key_words(k, v) for k, v in keys.items())


def key_words(key: str, value: Key) -> str:
    """Return the words for one key: its unit behind the value where its name ends in one."""
    if isinstance(value, bool):
        if key == "shell":
            return "with shell" if value else "empty"
        return key if value else f"no {key}"
    if isinstance(value, str):
        return f"{key} {value}"
    unit = next((u for u in UNITS if key.endswith(f"_{u}")), "")
    name = key.removesuffix(f"_{unit}")
    told = f"{value:g} {UNITS[unit]}" if unit else f"{value:g}"
    return told if name == "supply" else f"{name} {told}"


def changed_words(size: float, pace: float) -> str:
    """Return the words for changed inputs."""
    parts = ["reversed"] if size < 0 else []
    parts += [f"{abs(size):g} of their size"] if abs(size) != 1.0 else []
    parts += [f"{pace:g} times as fast"] if pace != 1.0 else []
    return ", ".join(parts) or "as they were"
