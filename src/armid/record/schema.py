"""The kinds of values in a TOML file, and the shape of campaign.toml: which keys there are and of what kind.

A kind is a function that returns a value as it is wanted, or raises KindError. These few stand here in place of a
library, whose import alone would take a tenth of the time in which the program starts.
"""

import tomllib
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from armid.errors import ArmidError, nearest, quoted
from armid.record.table import LARGEST

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


Kind = Callable[[object], Any]


class KindError(Exception):
    """Tell that a value is not of its kind: the path to the part that is not, and what was found there."""

    def __init__(self, found: object, path: str = "") -> None:
        super().__init__(path)
        self.found, self.path = found, path


def part(kind: Kind, value: object, path: str) -> Any:
    try:
        return kind(value)
    except KindError as error:
        raise KindError(error.found, path + error.path) from None


def number(value: object) -> float:
    # in Python a bool is an int too
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST:
        return float(value)
    raise KindError(value)


def any_text(value: object) -> str:
    if isinstance(value, str):
        return value
    raise KindError(value)


def tested(kind: Kind, test: Callable[[Any], bool]) -> Kind:
    def both(value: object) -> Any:
        if test(kind(value)):
            return kind(value)
        raise KindError(value)

    return both


above_zero = tested(number, lambda value: value > 0.0)
share = tested(number, lambda value: 0.0 <= value < 1.0)
probability = tested(number, lambda value: 0.0 < value < 1.0)
text = tested(any_text, bool)


def boolean(value: object) -> bool:
    if isinstance(value, bool):
        return value
    raise KindError(value)


def any_table(value: object) -> dict[str, Any]:
    if isinstance(value, dict):
        return value
    raise KindError(value)


def one_of(*words: str) -> Kind:
    return tested(text, lambda word: word in words)


def table_of(inner: Kind) -> Kind:
    return lambda value: {name: part(inner, v, f".{name}") for name, v in any_table(value).items()}


def one_kind(*kinds: Kind) -> Kind:
    """Return the kind of what is of the first of several kinds that fits."""

    def kind(value: object) -> Any:
        for each in kinds[:-1]:
            with suppress(KindError):
                return each(value)
        return kinds[-1](value)

    return kind


def list_of(inner: Kind, shortest: int = 0, longest: float = float("inf")) -> Kind:
    def kind(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or not shortest <= len(value) <= longest:
            raise KindError(value)
        return tuple(part(inner, v, f".{i}") for i, v in enumerate(value))

    return kind


def key(kind: Kind, expected: str) -> dict[str, Any]:
    """Return what a field of a sheet carries: its kind, and that kind in words."""
    return {"kind": kind, "expected": expected}


# Bytes of a file: tables that are nested 8 deep take 350 times as much memory.
LARGEST_TOML = 2_000_000
# The parser takes memory with the square of the parts of a dotted key, which stands on one line: so large is the sum of
# the squared numbers of dots over all lines at most. A list of 3,000 names of files on one line stays below it.
MOST_SQUARED_DOTS = 10_000_000
# Records are held in memory, one by one.
MOST_RECORDS = 10_000
HOLD = key(one_of("linear", "zero"), "'linear' or 'zero'")
CONSTANTS = key(table_of(number), "a finite number in SI")
TOLERANCES = key(table_of(share), "a share from 0 to below 1")
PRIORS = key(
    table_of(one_kind(probability, any_table)),
    "the probability of an effect, between 0 and 1, or { mean, sd } of a parameter or constant, SI",
)
LOST = key(share, "a share from 0 to below 1")
INPUTS = key(table_of(text), "the name of a column")
BOUND = key(number, "a finite number in SI")
WINDOW = key(list_of(number, 2, 2), "[begin, end] in seconds")
RECORDS = key(list_of(any_table, 1, MOST_RECORDS), f"1 to {MOST_RECORDS:,} tables headed [[records]]")
PARAMETERS = key(table_of(any_table), "a table of low, high, fixed")


@dataclass(frozen=True, kw_only=True)
class RecordSheet:
    """Declare a [[records]] entry; `keys` holds those of the plant, still as they were found."""

    file: str = field(metadata=key(text, "the name of a CSV file in the campaign's folder"))
    role: str = field(metadata=key(one_of("train", "holdout"), "'train' or 'holdout'"))
    constants: Mapping[str, float] = field(default_factory=dict, metadata=CONSTANTS)
    inputs: Mapping[str, str] = field(default_factory=dict, metadata=INPUTS)
    window_s: tuple[float, float] | None = field(default=None, metadata=WINDOW)
    restart_s: float | None = field(default=None, metadata=key(above_zero, "a length in seconds above 0"))
    repeat_of: str | None = field(default=None, metadata=key(text, "the file of another record"))
    hold: str | None = field(default=None, metadata=HOLD)
    most_lost: float | None = field(default=None, metadata=LOST)
    keys: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CampaignSheet:
    """Declare campaign.toml; records and parameters are looked into one by one."""

    name: str = field(metadata=key(text, "a text"))
    plant: str = field(metadata=key(text, "the name of a plant"))
    records: tuple[dict[str, Any], ...] = field(metadata=RECORDS)
    effects: tuple[str, ...] = field(default=(), metadata=key(list_of(text), "a list of names of effects"))
    gyro_range_deg_s: float | None = field(default=None, metadata=key(above_zero, "a range in deg/s above 0"))
    parameters: Mapping[str, dict[str, Any]] = field(default_factory=dict, metadata=PARAMETERS)
    constants: Mapping[str, float] = field(default_factory=dict, metadata=CONSTANTS)
    tolerances: Mapping[str, float] = field(default_factory=dict, metadata=TOLERANCES)
    priors: Mapping[str, Any] = field(default_factory=dict, metadata=PRIORS)
    inputs: Mapping[str, str] = field(default_factory=dict, metadata=INPUTS)
    hold: str = field(default="linear", metadata=HOLD)
    most_lost: float = field(default=0.05, metadata=LOST)
    unwrap: bool = field(default=False, metadata=key(boolean, "true or false"))
    counts_per_turn: float | None = field(default=None, metadata=key(above_zero, "counts of the encoder above 0"))


@dataclass(frozen=True, kw_only=True)
class Override:
    """Declare a [parameters.NAME] table: what replaces the parameter's declaration, SI; None leaves it as it is."""

    low: float | None = field(default=None, metadata=BOUND)
    high: float | None = field(default=None, metadata=BOUND)
    fixed: float | None = field(default=None, metadata=BOUND)


@dataclass(frozen=True, kw_only=True)
class Known:
    """Declare what is known of a value before the records: a normal distribution, SI."""

    mean: float = field(metadata=BOUND)
    sd: float = field(metadata=key(above_zero, "a standard deviation above 0, SI"))


SheetT = TypeVar("SheetT", bound="DataclassInstance")


def validated(sheet: type[SheetT], table: object, where: str, further: Collection[str] = ()) -> SheetT:
    """Return a table of the file as what it was declared to be; further: keys that go into its field `keys`."""
    if not isinstance(table, dict):
        raise ArmidError(f"{where} is {quoted(table)}, a table is expected")
    declared: list[Field[Any]] = [f for f in fields(sheet) if f.metadata]
    known = [*(f.name for f in declared), *further]
    for name in table:
        if name not in known:
            raise unknown_name("key", name, known, where)
    values: dict[str, Any] = {}
    for f in declared:
        expected = f.metadata["expected"]
        if f.name in table:
            try:
                values[f.name] = part(f.metadata["kind"], table[f.name], f.name)
            except KindError as error:
                raise ArmidError(f"{where}: key {quoted(error.path)} is {quoted(error.found)}, {expected} is "
                                 "expected") from error  # fmt: skip
        elif f.default is MISSING and f.default_factory is MISSING:
            raise ArmidError(f"{where}: key '{f.name}' is missing, {expected} is expected")
    if further:
        values["keys"] = {name: table[name] for name in further if name in table}
    return sheet(**values)


def unknown_name(what: str, name: str, known: Collection[str], where: str) -> ArmidError:
    """Return the sentence for a name that nobody declared or registered."""
    return ArmidError(f"{where}: {what} {quoted(name)} is unknown, {nearest(name, known)}")


def load_toml(path: Path, named: str = "") -> dict[str, Any]:
    """Return the tables of a TOML file; named: how messages name it, "": by its own name."""
    where = named or path.name
    try:
        size = path.stat().st_size
        if size > LARGEST_TOML:
            raise ArmidError(
                f"{where} has {size / 1e6:.0f} MB, at most {LARGEST_TOML / 1e6:.0f} MB of TOML are expected"
            )
        content = path.read_bytes()
    except OSError as error:
        raise ArmidError(f"{where} cannot be read: {error.strerror or error}") from error
    dots = [line.count(b".") for line in content.split(b"\n")]
    if sum(n * n for n in dots) > MOST_SQUARED_DOTS:
        most = max(dots)
        raise ArmidError(f"{where}, line {dots.index(most) + 1}: {most:,} dots on one line are too many for a "
                         "parser of TOML, shorter lines are expected")  # fmt: skip
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ArmidError(f"{where}, line {line}: not readable as text, TOML in UTF-8 is expected") from error
    except RecursionError as error:
        raise ArmidError(f"{where} is nested too deeply, plain tables of TOML are expected") from error
    except ValueError as error:
        # TOMLDecodeError tells the line; numbers of too many digits come as a plain ValueError
        raise ArmidError(f"{where} is no valid TOML: {str(error)[:200]}") from error
