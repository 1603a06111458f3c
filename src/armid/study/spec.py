"""The shape of a study's TOML file: which keys there are and of what kind."""

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from armid.engine.calibrate import ALLOWED
from armid.errors import ArmidError
from armid.identifiers import Identifier, identifier_of
from armid.model import Effect, Plant
from armid.problem.fitness import Fitness
from armid.record.schema import (
    KindError,
    above_zero,
    any_table,
    key,
    list_of,
    number,
    one_of,
    part,
    table_of,
    text,
    unknown_name,
)
from armid.registry import Registry, load_plugin, load_registry

PLAIN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
REPORTS = ("", "table1", "table2", "benchmark", "fitness")
WHOLE = "whole"
# Neither key nor number of a study may be larger: what it asks for has to fit into memory and a lifetime.
LARGEST_COUNT = 10**9
# Seeds and cases are held in memory, one by one.
MOST_HELD = 10**6


def plain_name(value: object) -> str:
    """Return a name that is safe as the name of a folder."""
    if PLAIN_NAME.fullmatch(text(value)) and not text(value).endswith("."):
        return text(value)
    raise KindError(value)


def line_of_text(value: object) -> str:
    """Return a text that fits on one line."""
    if text(value).isprintable() and text(value) == text(value).strip():
        return text(value)
    raise KindError(value)


def any_text(value: object) -> str:
    """Return a text, also an empty one."""
    if isinstance(value, str):
        return value
    raise KindError(value)


def whole_number(value: object, least: int = 0) -> int:
    """Return a whole number of at least 0."""
    if isinstance(value, int) and not isinstance(value, bool) and least <= value <= LARGEST_COUNT:
        return value
    raise KindError(value)


def count(value: object) -> int:
    """Return a whole number above 0."""
    return whole_number(value, 1)


def seeds(value: object) -> tuple[int, ...]:
    """Return seeds: n stands for 1 to n."""
    if isinstance(value, list):
        return tuple(list_of(whole_number, 1)(value))
    return tuple(range(1, some(value) + 1))


def some(value: object) -> int:
    """Return a number of things that are all held in memory."""
    if count(value) <= MOST_HELD:
        return count(value)
    raise KindError(value)


def one_or_more(value: object) -> tuple[str, ...]:
    """Return names: one name stands for a list of it."""
    return (text(value),) if isinstance(value, str) else tuple(list_of(text, 1)(value))


def at_least_zero(value: object) -> float:
    """Return a number of at least 0."""
    if number(value) < 0.0:
        raise KindError(value)
    # -0.0 is 0 and is to be written like it
    return number(value) + 0.0


def levels(value: object) -> tuple[float, ...]:
    """Return noise levels: one number stands for a list of it."""
    return tuple(list_of(at_least_zero, 1)(value)) if isinstance(value, list) else (at_least_zero(value),)


def window(value: object) -> tuple[float, ...] | str:
    """Return [begin, end], or the word for all of a record."""
    return WHOLE if value == WHOLE else tuple(list_of(number, 2, 2)(value))


def windows(value: object) -> tuple[tuple[float, ...] | str, ...]:
    """Return windows: the word alone stands for a list of it."""
    return (WHOLE,) if value == WHOLE else tuple(list_of(window, 1)(value))


def option(value: object) -> float | int | str | bool:
    """Return the value of an identifier's option."""
    return value if isinstance(value, bool | int | str) else number(value)


def options(value: object) -> dict[str, float | int | str | bool]:
    """Return options by name; those of a part of a chain, which TOML nests, as `pso.velocity_limit`."""
    found: dict[str, float | int | str | bool] = {}
    for name, inner in any_table(value).items():
        if isinstance(inner, dict):
            found |= {f"{name}.{key}": part(option, v, f".{name}.{key}") for key, v in inner.items()}
        else:
            found[name] = part(option, inner, f".{name}")
    return found


NUMBERS = key(table_of(number), "a finite number in SI")
BOUNDS = key(table_of(list_of(number, 2, 2)), "[low, high] in SI")
NAMES = key(one_or_more, "a name or a list of names")
LEVELS = key(levels, "a number of at least 0 in deg/s, or a list of such")
TABLES = key(list_of(any_table, 1), "a list of at least one table")


@dataclass(frozen=True, kw_only=True)
class ManoeuvreSheet:
    """Declare a manoeuvre that is simulated; `keys` holds those of the plant, still as they were found."""

    duration_s: float = field(metadata=key(above_zero, "a length in seconds above 0"))
    role: str = field(default="train", metadata=key(one_of("train", "holdout"), "'train' or 'holdout'"))
    constants: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    keys: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CaseSheet:
    """Declare a [[cases]] entry: a truth with manoeuvres, or a campaign."""

    name: str = field(metadata=key(line_of_text, "a text on one line"))
    truth: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    published: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict, metadata=BOUNDS)
    fixed: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    manoeuvres: tuple[dict[str, Any], ...] = field(default=(), metadata=TABLES)
    campaign: str | None = field(default=None, metadata=key(text, "a folder beside the study's file"))
    records: tuple[str, ...] | None = field(
        default=None, metadata=key(list_of(text, 1), "a list of files of the campaign")
    )


@dataclass(frozen=True, kw_only=True)
class RandomSheet:
    """Declare [random_cases]: truths spread over the box."""

    n: int = field(metadata=key(some, "a whole number above 0, up to 1,000,000"))
    seed: int = field(metadata=key(whole_number, "a whole number of at least 0"))
    manoeuvres: tuple[dict[str, Any], ...] = field(metadata=TABLES)
    margin: float = field(default=0.0, metadata=key(at_least_zero, "a share of the range from 0 to below 0.5"))


@dataclass(frozen=True, kw_only=True)
class EntrySheet:
    """Declare an [[identifiers]] entry; what is not given is the study's."""

    name: str = field(metadata=key(text, "the name of an identifier"))
    label: str | None = field(default=None, metadata=key(line_of_text, "a text on one line"))
    budget: int | None = field(default=None, metadata=key(count, "a whole number above 0"))
    fitness: tuple[str, ...] | None = field(default=None, metadata=NAMES)
    noise_deg_s: tuple[float, ...] | None = field(default=None, metadata=LEVELS)
    seeds: tuple[int, ...] | None = field(default=None, metadata=key(seeds, "at most 1,000,000 seeds or a list"))
    options: Mapping[str, Any] = field(default_factory=dict, metadata=key(options, "a number, a text, true or false"))


@dataclass(frozen=True, kw_only=True)
class StudySheet:
    """Declare a study; cases and identifiers are looked into one by one."""

    name: str = field(metadata=key(plain_name, "a plain name of letters, digits, '_', '-' and '.'"))
    plant: str = field(metadata=key(text, "the name of a plant"))
    identifiers: tuple[dict[str, Any], ...] = field(
        metadata=key(list_of(any_table, 1), "at least one table headed [[identifiers]]")
    )
    budget: int = field(metadata=key(count, "a whole number of simulations above 0"))
    seeds: tuple[int, ...] = field(metadata=key(seeds, "at most 1,000,000 seeds or a list"))
    question: str = field(default="", metadata=key(any_text, "a text"))
    kind: str = field(default="identify", metadata=key(text, "the kind of a study"))
    report: str = field(default="", metadata=key(any_text, f"one of {', '.join(map(repr, REPORTS))}"))
    fitness: tuple[str, ...] = field(default=("similarity",), metadata=NAMES)
    noise_deg_s: tuple[float, ...] = field(default=(0.0,), metadata=LEVELS)
    noise_seed: int = field(default=1, metadata=key(whole_number, "a whole number of at least 0"))
    windows_s: tuple[tuple[float, float] | str, ...] = field(
        default=(WHOLE,), metadata=key(windows, f"'{WHOLE}', or a list of [begin, end] in seconds and '{WHOLE}'")
    )
    interval_s: float = field(default=1e-3, metadata=key(above_zero, "a sample interval in seconds above 0"))
    accuracy: str = field(
        default="auto", metadata=key(one_of("auto", *ALLOWED), f"one of 'auto', {', '.join(map(repr, ALLOWED))}")
    )
    effects: tuple[str, ...] = field(default=(), metadata=key(list_of(text), "a list of names of effects"))
    constants: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict, metadata=BOUNDS)
    fixed: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    cases: tuple[dict[str, Any], ...] = field(default=(), metadata=TABLES)
    random_cases: dict[str, Any] | None = field(default=None, metadata=key(any_table, "a table"))


@dataclass(frozen=True, eq=False)
class Known:
    """Hold the registered things by name.

    plugins: `FILE.py:attribute` of the user's own. digests: (kind, name) -> hash of the file that it was read from, so
    that what an older text of it gave is not taken for what the present one gives.
    """

    registry: Registry
    plugins: tuple[str, ...]
    digests: Mapping[tuple[str, str], str]

    @cached_property
    def plants(self) -> dict[str, Plant]:
        """Name -> Plant."""
        return self.registry.plants

    @cached_property
    def effects(self) -> dict[str, Effect]:
        """Name -> Effect."""
        return self.registry.effects

    @cached_property
    def fitness(self) -> dict[str, Fitness]:
        """Name -> Fitness."""
        return self.registry.fitness

    @cached_property
    def identifiers(self) -> dict[str, Identifier]:
        """Name -> Identifier, those composed of others left out."""
        return self.registry.identifiers

    def identifier(self, name: str, where: str) -> Identifier:
        """Return an identifier, also a chain or a multistart.

        Raises ArmidError with the nearest name for an unknown one.
        """
        try:
            return identifier_of(name, self.identifiers)
        except ArmidError as error:
            raise ArmidError(f"{where}: {error}") from error

    def own(self, kind: str, *names: str) -> dict[str, str]:
        """Return `kind name` -> hash for those of the names that are the user's own; chains are looked into."""
        parts = [part for name in names for part in re.split(r"[+:]", name)]
        return {f"{kind} {part}": self.digests[kind, part] for part in parts if (kind, part) in self.digests}


def load_known(plugins: Iterable[str] = ()) -> Known:
    """Return what may be named: catalogues, entry points, and the user's own. This runs the code of the plug-ins.

    Raises ArmidError for a plug-in that cannot be used.
    """
    named = tuple(plugins)
    registry = load_registry(named)
    digests = {}
    for plugin in named:
        kind, name, _ = load_plugin(plugin)
        with open(plugin.rpartition(":")[0], "rb") as file:
            digests[kind, name] = hashlib.sha256(file.read()).hexdigest()
    return Known(registry, named, digests)


def chosen(known: Mapping[str, Any], name: str, what: str, where: str) -> Any:
    """Return what is registered under a name.

    Raises ArmidError with the nearest name for an unknown one.
    """
    if name not in known:
        raise unknown_name(what, name, known, where)
    return known[name]
