"""The kinds of values in a TOML file, and the shape of campaign.toml: which keys there are and of what kind.

A kind reads a value and knows its JSON Schema, so that readers and editors hold a file to the same definitions. These
few stand here in place of a library, whose import alone would take a tenth of the time in which the program starts.
"""

import re
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, field, fields
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from armid.errors import ArmidError, nearest, nearest_registered, quoted
from armid.model import ManoeuvreKey
from armid.record.table import LARGEST_CELL

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

# What editors understand (taplo, Even Better TOML).
DRAFT = "http://json-schema.org/draft-07/schema#"


class KindError(Exception):
    """Tell that a value is not of its kind: the path to the part that is not, and what was found there."""

    def __init__(self, found: object, path: str = "") -> None:
        super().__init__(path)
        self.found, self.path = found, path


@dataclass(frozen=True)
class ValueKind:
    """Declare a kind of values.

    read: returns a value as it is wanted, or raises KindError. schema: the same kind as JSON Schema has it.
    """

    read: Callable[[object], Any]
    schema: Mapping[str, Any]

    def __call__(self, value: object) -> Any:
        """Return a value as it is wanted, or raise KindError."""
        return self.read(value)


def kind(**schema: Any) -> Callable[[Callable[[object], Any]], ValueKind]:
    """Make a function that reads a value a ValueKind; schema: the keywords of JSON Schema."""
    return lambda read: ValueKind(read, schema)


def part(kind: ValueKind, value: object, path: str) -> Any:
    try:
        return kind(value)
    except KindError as error:
        raise KindError(error.found, path + error.path) from None


@kind(type="number")
def number(value: object) -> float:
    # in Python a bool is an int too
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST_CELL:
        return float(value)
    raise KindError(value)


def tested(kind: ValueKind, test: Callable[[Any], bool], **schema: Any) -> ValueKind:
    """Return a kind of fewer values; schema: how JSON Schema says the test, nothing where it cannot."""

    def both(value: object) -> Any:
        accepted = kind(value)
        if test(accepted):
            return accepted
        raise KindError(value)

    return ValueKind(both, {**kind.schema, **schema})


def instance_of(python: type, schema: str) -> ValueKind:
    """Return the kind of all values of a type of Python; schema: its name in JSON Schema."""
    return tested(ValueKind(lambda value: value, {}), lambda value: isinstance(value, python), type=schema)


any_text, boolean = instance_of(str, "string"), instance_of(bool, "boolean")
any_table = instance_of(dict, "object")
above_zero = tested(number, lambda value: value > 0.0, exclusiveMinimum=0)
share = tested(number, lambda value: 0.0 <= value < 1.0, minimum=0, exclusiveMaximum=1)
probability = tested(number, lambda value: 0.0 < value < 1.0, exclusiveMinimum=0, exclusiveMaximum=1)
text = tested(any_text, bool, minLength=1)


def name_in(catalogue: str) -> ValueKind:
    """Return the kind of names of a catalogue; JSON Schema offers those that are registered and takes others."""
    return ValueKind(text.read, {**text.schema, REGISTERED: catalogue})


def one_of(*words: str) -> ValueKind:
    return tested(text, lambda word: word in words, enum=list(words))


def table_of(inner: ValueKind) -> ValueKind:
    def read(value: object) -> dict[str, Any]:
        return {name: part(inner, v, f".{name}") for name, v in any_table(value).items()}

    return ValueKind(read, {"type": "object", "additionalProperties": inner.schema})


def one_kind(*kinds: ValueKind) -> ValueKind:
    """Return the kind of what is of the first of several kinds that fits."""

    def read(value: object) -> Any:
        for each in kinds[:-1]:
            with suppress(KindError):
                return each(value)
        return kinds[-1](value)

    return ValueKind(read, {"anyOf": [each.schema for each in kinds]})


def list_of(inner: ValueKind, shortest: int = 0, longest: float = inf) -> ValueKind:
    def read(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or not shortest <= len(value) <= longest:
            raise KindError(value)
        return tuple(part(inner, v, f".{i}") for i, v in enumerate(value))

    most = {"maxItems": longest} if longest < inf else {}
    return ValueKind(read, {"type": "array", "items": inner.schema, "minItems": shortest, **most})


def key(kind: ValueKind, expected: str, meaning: str) -> dict[str, Any]:
    """Return the metadata of a field of a sheet: its kind, the kind in words, and the meaning of the value."""
    return {"kind": kind, "expected": expected, "meaning": meaning}


# Keywords of a schema that `json_schema` replaces: names of a catalogue, and keys that the plants declare.
REGISTERED, OF_PLANTS = "x-registered", "x-of-plants"


def table_for(sheet: "type[DataclassInstance]") -> ValueKind:
    """Return the kind of tables that a sheet declares; `validated` looks into each of them later."""
    return ValueKind(any_table.read, sheet_schema(sheet))


def sheet_schema(sheet: "type[DataclassInstance]") -> dict[str, Any]:
    """Return the JSON Schema of the tables that a sheet declares, made of the kinds of its fields."""
    declared = {f.name: f for f in fields(sheet) if f.metadata}
    properties = {}
    for name, f in declared.items():
        text = f"{f.metadata['meaning']} Expected: {f.metadata['expected']}."
        properties[name] = {**f.metadata["kind"].schema, "description": text}
        if (default := default_of(f)) is not None:
            properties[name]["default"] = default
    required = [name for name, f in declared.items() if is_required(f)]
    open_to = {} if len(declared) == len(fields(sheet)) else {OF_PLANTS: True}
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False, **open_to}


def is_required(f: "Field[Any]") -> bool:
    return f.default is MISSING and f.default_factory is MISSING


def default_of(f: "Field[Any]") -> Any:
    """Return the default of a key; None where it is required, and where its default is empty."""
    return None if f.default in (MISSING, None, "", ()) else f.default


def key_schema(key: ManoeuvreKey) -> dict[str, Any]:
    """Return the JSON Schema of a key that a plant declares."""
    if key.boolean:
        limits: dict[str, Any] = {"type": "boolean"}
    else:
        ends = (("minimum", key.low), ("maximum", key.high))
        limits = {"type": "number"} | {name: end for name, end in ends if end is not None}
    return {**limits, "description": f"Sets the constant {key.constant} of the plant."}


def json_schema(
    schema: Any, registered: Mapping[str, Iterable[str]], keys: Mapping[str, Any], draft: str = DRAFT
) -> Any:
    """Return a schema that editors take: registered names are offered, and tables of a plant have its keys.

    registered: catalogue -> its names. keys: key of a plant -> its schema.
    """
    if isinstance(schema, list):
        return [json_schema(each, registered, keys, "") for each in schema]
    if not isinstance(schema, Mapping):
        return schema
    document: dict[str, Any] = {"$schema": draft} if draft else {}
    for name, inner in schema.items():
        if name == REGISTERED:
            document["anyOf"] = [{"enum": sorted(registered[inner])}, {}]
        elif name != OF_PLANTS:
            document[name] = json_schema(inner, registered, keys, "")
    if OF_PLANTS in schema:
        document["properties"] |= keys
    return document


# Bytes of a file: tables that are nested 8 deep take 350 times as much memory.
LARGEST_TOML = 2_000_000
# Tables that may stand several times in a file.
TABLES = ("records", "cases", "identifiers")
# The parser takes memory with the square of the parts of a dotted key, which stands on one line: so large is the sum of
# the squared numbers of dots over all lines at most. A list of 3,000 names of files on one line stays below it.
MOST_SQUARED_DOTS = 10_000_000
# Records are held in memory, one by one.
MOST_RECORDS_READ = 10_000
HOLD = key(one_of("linear", "zero"), "'linear' or 'zero'", "How an input runs between samples; the plant's own counts.")
CONSTANTS_KEY = key(table_of(number), "a finite number in SI", "Constants of the plant, by name.")
TOLERANCES_KEY = key(
    table_of(share), "a share from 0 to below 1",
    "Standard deviation of a constant, as a share of its value; `default` holds for those that are not named.",
)  # fmt: skip
LOST = key(share, "a share from 0 to below 1", "Share of a record that may be invalid: clipped, frozen or wild.")
INPUTS = key(table_of(text), "the name of a column", "Which column of the CSV file brings an input of the plant.")
WINDOW_KEY = key(list_of(number, 2, 2), "[begin, end] in seconds", "Part of the record that fitness and errors see.")
EFFECTS_KEY = key(
    list_of(name_in("effects")),
    "a list of names of effects",
    "Effects that the model adds to the plant; NAME takes the first form that fits, NAME:FORM another.",
)
PLANT = key(name_in("plants"), "the name of a plant", "The declared machine; `armid list plants` shows them.")


@dataclass(frozen=True, kw_only=True)
class RecordSheet:
    """Declare a [[records]] entry; `keys` holds those of the plant, still as they were found."""

    file: str = field(metadata=key(text, "the name of a CSV file in the campaign's folder", "The measured signals."))
    role: str = field(metadata=key(
        one_of("train", "holdout"), "'train' or 'holdout'",
        "Whether parameters are searched on this record, or it judges the result.",
    ))  # fmt: skip
    constants: Mapping[str, float] = field(default_factory=dict, metadata=CONSTANTS_KEY)
    inputs: Mapping[str, str] = field(default_factory=dict, metadata=INPUTS)
    window_s: tuple[float, float] | None = field(default=None, metadata=WINDOW_KEY)
    restart_s: float | None = field(default=None, metadata=key(
        above_zero, "a length in seconds above 0",
        "Simulate pieces of this length, each from the measured state, where a longer motion cannot be followed.",
    ))  # fmt: skip
    repeat_of: str | None = field(
        default=None, metadata=key(text, "the file of another record", "The record whose manoeuvre this one repeats.")
    )
    hold: str | None = field(default=None, metadata=HOLD)
    most_lost: float | None = field(default=None, metadata=LOST)
    keys: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Override:
    """Declare a [parameters.NAME] table: what replaces the parameter's declaration, SI; None leaves it as it is."""

    low: float | None = field(default=None, metadata=key(number, "a finite number in SI", "Lower bound of the search."))
    high: float | None = field(
        default=None, metadata=key(number, "a finite number in SI", "Upper bound of the search.")
    )
    fixed: float | None = field(
        default=None, metadata=key(number, "a finite number in SI", "Value of a parameter that is not searched.")
    )


@dataclass(frozen=True, kw_only=True)
class Known:
    """Declare what is known of a value before the records: a normal distribution, SI."""

    mean: float = field(metadata=key(number, "a finite number in SI", "Mean of the normal distribution."))
    sd: float = field(metadata=key(above_zero, "a standard deviation above 0, SI", "Its standard deviation."))


@dataclass(frozen=True, kw_only=True)
class CampaignSheet:
    """Declare campaign.toml; records, parameters and priors are looked into one by one."""

    name: str = field(metadata=key(text, "a text", "The name of the campaign on its pages."))
    plant: str = field(metadata=PLANT)
    records: tuple[dict[str, Any], ...] = field(metadata=key(
        list_of(table_for(RecordSheet), 1, MOST_RECORDS_READ), f"1 to {MOST_RECORDS_READ:,} tables headed [[records]]",
        "One table for each CSV file.",
    ))  # fmt: skip
    effects: tuple[str, ...] = field(default=(), metadata=EFFECTS_KEY)
    gyro_range_deg_s: float | None = field(
        default=None,
        metadata=key(above_zero, "a range in deg/s above 0", "Range of the gyro; speeds beyond it are cut off."),
    )
    parameters: Mapping[str, dict[str, Any]] = field(default_factory=dict, metadata=key(
        ValueKind(table_of(any_table).read,
                  table_of(one_kind(table_for(Override), table_of(table_for(Override)))).schema),
        "a table of low, high, fixed", "What replaces the declaration of a parameter, SI.",
    ))  # fmt: skip
    constants: Mapping[str, float] = field(default_factory=dict, metadata=CONSTANTS_KEY)
    tolerances: Mapping[str, float] = field(default_factory=dict, metadata=TOLERANCES_KEY)
    priors: Mapping[str, Any] = field(default_factory=dict, metadata=key(
        table_of(one_kind(probability, table_for(Known))),
        "the probability of an effect, between 0 and 1, or { mean, sd } of a parameter or constant, SI",
        "What is known before the records.",
    ))  # fmt: skip
    truth: Mapping[str, float] = field(default_factory=dict, metadata=key(
        table_of(number), "a finite number in SI",
        "True values of parameters of synthetic records; figures show them, and nothing else reads them.",
    ))  # fmt: skip
    inputs: Mapping[str, str] = field(default_factory=dict, metadata=INPUTS)
    hold: str = field(default="linear", metadata=HOLD)
    most_lost: float = field(default=0.05, metadata=LOST)
    unwrap: bool = field(
        default=False, metadata=key(boolean, "true or false", "Take jumps by a whole turn out of angles that wrap.")
    )
    counts_per_turn: float | None = field(default=None, metadata=key(
        above_zero, "counts of the encoder above 0",
        "Counts of a turn, where a header ends in _counts or _counts_s.",
    ))  # fmt: skip


SheetT = TypeVar("SheetT", bound="DataclassInstance")


def validated(sheet: type[SheetT], table: object, where: str, further: Collection[str] = ()) -> SheetT:
    """Return a table of the file as what it was declared to be; further: keys that go into its field `keys`."""
    if not isinstance(table, dict):
        raise ArmidError(f"{where} is {quoted(table)}, a table is expected")
    declared: list[Field[Any]] = [f for f in fields(sheet) if f.metadata]
    known = [*(f.name for f in declared), *further]
    for name in table:
        if name not in known:
            if sheet is RecordSheet and name in {f.name for f in fields(CampaignSheet)}:
                raise ArmidError(f"{where}: key '{name}' is one of the campaign, it is expected above the first "
                                 "[[records]]")  # fmt: skip
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
        elif is_required(f):
            below = next((t for t, inner in table.items() if isinstance(inner, dict) and f.name in inner), "")
            found = f"stands under [{below}], a line above the first table" if below else f"is missing, {expected}"
            raise ArmidError(f"{where}: key '{f.name}' {found} is expected")
    if further:
        values["keys"] = {name: table[name] for name in further if name in table}
    return sheet(**values)


def unknown_name(what: str, name: str, known: Collection[str], where: str) -> ArmidError:
    """Return the sentence for a name that nobody declared or registered."""
    hint = nearest_registered if what in ("plant", "effect") else nearest
    return ArmidError(f"{where}: {what} {quoted(name)} is unknown, {hint(name, known)}")


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
        raise ArmidError(f"{where} is not valid TOML: {str(error)[:200]}{advice_on(str(error), content)}") from error


def advice_on(error: str, content: bytes) -> str:
    """Return what to do about a frequent fault of TOML, with a colon before it, "" for others."""
    twice = re.search(r"\('(\w+)',\) twice", error)
    if twice and twice[1] in TABLES:
        return f": each of several begins with [[{twice[1]}]]"
    at = re.search(r"Invalid value \(at line (\d+)", error)
    line = content.decode().split("\n")[int(at[1]) - 1] if at else ""
    bare = re.fullmatch(r"\s*([\w.-]+)\s*=\s*([A-Za-z_][\w.-]*)\s*(#.*)?", line)
    return f": text stands in quotes, {bare[1]} = {quoted(bare[2])}" if bare else ""
