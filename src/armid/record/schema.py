"""The shape of campaign.toml: which keys there are and of what kind."""

from collections.abc import Collection, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import TYPE_CHECKING, Any, TypeVar

from armid.model import ArmidError, nearest
from armid.record.kinds import Kind, KindError, above_zero, any_table, list_of, number, one_of, part, table_of, text
from armid.record.shown import shown

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def key(kind: Kind, expected: str) -> dict[str, Any]:
    """Return what a field of a sheet carries: its kind, and that kind in words."""
    return {"kind": kind, "expected": expected}


SHARED_HOLD = key(one_of("linear", "zero"), "'linear' or 'zero'")
CONSTANTS = key(table_of(number), "a finite number in SI")
INPUTS = key(table_of(text), "the name of a column")
BOUND = key(number, "a finite number in SI")


@dataclass(frozen=True, kw_only=True)
class RecordSheet:
    """Declare a [[records]] entry; `keys` holds those of the plant, still as they were found."""

    file: str = field(metadata=key(text, "the name of a CSV file in the campaign's folder"))
    role: str = field(metadata=key(one_of("train", "holdout"), "'train' or 'holdout'"))
    constants: Mapping[str, float] = field(default_factory=dict, metadata=CONSTANTS)
    inputs: Mapping[str, str] = field(default_factory=dict, metadata=INPUTS)
    window_s: tuple[float, float] | None = field(
        default=None, metadata=key(list_of(number, 2, 2), "[begin, end] in seconds")
    )
    restart_s: float | None = field(default=None, metadata=key(above_zero, "a length in seconds above 0"))
    repeat_of: str | None = field(default=None, metadata=key(text, "the file of another record"))
    hold: str | None = field(default=None, metadata=SHARED_HOLD)
    keys: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CampaignSheet:
    """Declare campaign.toml; records and parameters are looked into one by one."""

    name: str = field(metadata=key(text, "a text"))
    plant: str = field(metadata=key(text, "the name of a plant"))
    records: tuple[dict[str, Any], ...] = field(
        metadata=key(list_of(any_table, 1), "at least one table headed [[records]]")
    )
    effects: tuple[str, ...] = field(default=(), metadata=key(list_of(text), "a list of names of effects"))
    gyro_range_deg_s: float | None = field(default=None, metadata=key(above_zero, "a range in deg/s above 0"))
    parameters: Mapping[str, dict[str, Any]] = field(
        default_factory=dict, metadata=key(table_of(any_table), "a table of low, high, fixed")
    )
    constants: Mapping[str, float] = field(default_factory=dict, metadata=CONSTANTS)
    inputs: Mapping[str, str] = field(default_factory=dict, metadata=INPUTS)
    hold: str = field(default="linear", metadata=SHARED_HOLD)


@dataclass(frozen=True, kw_only=True)
class Override:
    """Declare a [parameters.NAME] table: what replaces the parameter's declaration, SI; None leaves it as it is."""

    low: float | None = field(default=None, metadata=BOUND)
    high: float | None = field(default=None, metadata=BOUND)
    fixed: float | None = field(default=None, metadata=BOUND)


SheetT = TypeVar("SheetT", bound="DataclassInstance")


def validated(sheet: type[SheetT], table: object, where: str, further: Collection[str] = ()) -> SheetT:
    """Return a table of the file as what it was declared to be.

    where: how messages name the place. further: keys that the sheet keeps in its field `keys`.

    Raises ArmidError for the first key that is unknown, missing or of another kind.
    """
    if not isinstance(table, dict):
        raise ArmidError(f"{where} is {shown(table)}, a table is expected")
    declared: list[Field[Any]] = [f for f in fields(sheet) if f.metadata]
    known = [*(f.name for f in declared), *further]
    for name in table:
        if name not in known:
            raise unknown_name("key", name, known, where)
    values = {f.name: value_of(f, table, where) for f in declared if f.name in table or is_required(f)}
    if further:
        values["keys"] = {name: table[name] for name in further if name in table}
    return sheet(**values)


def is_required(declared: Field[Any]) -> bool:
    """Tell whether a key has no default."""
    return declared.default is MISSING and declared.default_factory is MISSING


def value_of(declared: Field[Any], table: Mapping[str, object], where: str) -> Any:
    """Return the value of a declared key as its kind wants it."""
    name, expected = declared.name, declared.metadata["expected"]
    if name not in table:
        raise ArmidError(f"{where}: key '{name}' is missing, {expected} is expected")
    try:
        return part(declared.metadata["kind"], table[name], name)
    except KindError as error:
        raise ArmidError(f"{where}: key {shown(error.path)} is {shown(error.found)}, {expected} is "
                         "expected") from error  # fmt: skip


def unknown_name(what: str, name: str, known: Collection[str], where: str) -> ArmidError:
    """Return the sentence for a name that nobody declared or registered."""
    return ArmidError(f"{where}: {what} {shown(name)} is unknown, {nearest(name, known)}")
