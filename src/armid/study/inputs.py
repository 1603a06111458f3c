"""Inputs of simulated cases: a column of a CSV file, or a signal by its name.

A manoeuvre of a study holds `inputs = { NAME = { ... } }`. With `kind` a signal is made: `chirp`, `multisine`, `steps`
or `prbs`, in the unit of the input. With `csv` and `column` it is read from a file in the study's folder.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from armid.errors import ArmidError, refuse_unless_known
from armid.model import Array, Plant
from armid.record.schema import above_zero, key, number, text, unknown_name, validated
from armid.record.table import read_table, time_column
from armid.study.spec import any_whole, count

ABOVE = "a number above 0"
SEED_OF_INPUT = key(any_whole, "a whole number of at least 0", "Seed of what is drawn.")
FROM_HZ = key(above_zero, ABOVE, "First frequency [Hz].")
TO_HZ = key(above_zero, ABOVE, "Last frequency [Hz].")


@dataclass(frozen=True, kw_only=True)
class InputSignal:
    """What all signals that are made have in common; a subclass makes `unit_values`, of a size of 1."""

    kind: str = field(metadata=key(text, "the name of a signal", "chirp, multisine, steps or prbs."))
    amplitude: float = field(metadata=key(above_zero, ABOVE, "Largest distance from the offset."))
    offset: float = field(default=0.0, metadata=key(number, "a number", "Middle of the signal."))

    def unit_values(self, times: Array) -> Array:
        raise NotImplementedError

    def values(self, times: Array) -> Array:
        """Return the signal at some times [s], (n_samples,)."""
        return self.offset + self.amplitude * self.unit_values(times)


@dataclass(frozen=True, kw_only=True)
class Chirp(InputSignal):
    """A sine whose frequency rises or falls evenly over the whole length."""

    from_hz: float = field(metadata=FROM_HZ)
    to_hz: float = field(metadata=TO_HZ)

    def unit_values(self, times: Array) -> Array:
        from scipy.signal import chirp

        return np.asarray(chirp(times, self.from_hz, times[-1], self.to_hz, phi=-90.0))


@dataclass(frozen=True, kw_only=True)
class Multisine(InputSignal):
    """A sum of sines of evenly spaced frequencies and drawn phases, its largest value 1."""

    from_hz: float = field(metadata=FROM_HZ)
    to_hz: float = field(metadata=TO_HZ)
    n: int = field(default=10, metadata=key(count, "a whole number above 0", "Number of sines."))
    seed: int = field(default=1, metadata=SEED_OF_INPUT)

    def unit_values(self, times: Array) -> Array:
        phases = 2.0 * np.pi * np.random.default_rng(self.seed).random(self.n)
        angles = 2.0 * np.pi * np.linspace(self.from_hz, self.to_hz, self.n) * times[:, np.newaxis] + phases
        total = np.sin(angles).sum(axis=1)
        return np.asarray(total / np.abs(total).max())


@dataclass(frozen=True, kw_only=True)
class Steps(InputSignal):
    """Levels drawn evenly from -1 to 1, each held for a time."""

    hold_s: float = field(metadata=key(above_zero, ABOVE, "Time for which a level is held [s]."))
    seed: int = field(default=1, metadata=SEED_OF_INPUT)

    def unit_values(self, times: Array) -> Array:
        # rounding must not move a multiple of the hold to the level before
        places = np.floor(times / self.hold_s + 1e-9).astype(int)
        return np.asarray(2.0 * np.random.default_rng(self.seed).random(places[-1] + 1)[places] - 1.0)


@dataclass(frozen=True, kw_only=True)
class Prbs(Steps):
    """A pseudo-random binary sequence: -1 or 1, each held for a time."""

    def unit_values(self, times: Array) -> Array:
        return np.where(super().unit_values(times) < 0.0, -1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class InputColumn:
    """A column of a CSV file in the folder of the study, its times from the first sample on."""

    csv: str = field(metadata=key(text, "a file in the folder of the study", "The CSV file."))
    column: str = field(metadata=key(text, "the header of a column", "Its column."))


SIGNALS: dict[str, type[InputSignal]] = {"chirp": Chirp, "multisine": Multisine, "steps": Steps, "prbs": Prbs}


def inputs_of(
    given: Mapping[str, Any], plant: Plant, folder: Path, times: Array, where: str
) -> dict[str, dict[str, Any]]:
    """Return what a study keeps of the inputs of a manoeuvre: the keys of a signal, or the values of a column.

    Raises ArmidError for an input that the plant does not have or that is missing, and for what makes no signal.
    """
    known = [each.name for each in plant.inputs]
    for name in given:
        if name not in known:
            raise unknown_name("input", name, known or ("none",), where)
    for each in plant.inputs:
        if each.required and each.name not in given:
            raise ArmidError(f"{where}: plant '{plant.name}' is driven by {each.name}, and `inputs` does not tell it: "
                             f"{each.name} = {{ kind = \"chirp\", ... }} or {{ csv = FILE, column = HEADER }} is "
                             "expected")  # fmt: skip
    return {name: kept(table, folder, times, f"{where}, input {name}") for name, table in given.items()}


def kept(table: Any, folder: Path, times: Array, where: str) -> dict[str, Any]:
    if not isinstance(table, dict) or ("kind" in table) == ("csv" in table):
        raise ArmidError(f"{where}: `kind` or `csv` is expected, one of them")
    if "csv" in table:
        return {"values": column_values(validated(InputColumn, table, where), folder, times, where)}
    refuse_unless_known(str(table["kind"]), SIGNALS, f"{where}: kind '{table['kind']}' is unknown")
    return asdict(validated(SIGNALS[table["kind"]], table, where))


def column_values(asked: InputColumn, folder: Path, times: Array, where: str) -> list[float]:
    path = (folder / asked.csv).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise ArmidError(f"{where}: {asked.csv} leads out of the folder of the study, a file inside is expected")
    table = read_table(path, asked.csv)
    if asked.column not in table.headers:
        raise unknown_name("column", asked.column, table.headers, f"{where}, {asked.csv}")
    seen = time_column(table)
    seen = seen - seen[0]
    if seen[-1] < times[-1] - 1e-9:
        raise ArmidError(f"{where}: {asked.csv} lasts {seen[-1]:.6g} s, at least the {times[-1]:.6g} s of the "
                         "manoeuvre are expected")  # fmt: skip
    return [float(value) for value in np.interp(times, seen, table.numbers(asked.column))]


def input_values(stored: Mapping[str, Any], times: Array) -> Array:
    """Return the values of an input at the samples, from what `inputs_of` kept."""
    if "values" in stored:
        return np.array(stored["values"])
    return SIGNALS[stored["kind"]](**stored).values(times)
