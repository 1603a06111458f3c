"""What a study's TOML file may hold, key by key, and the registered things that it may name."""

import hashlib
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from armid.engine.calibrate import ALLOWED
from armid.errors import ArmidError, MachineError
from armid.model import Model
from armid.record.schema import (
    Kind,
    KindError,
    above_zero,
    any_table,
    any_text,
    key,
    list_of,
    number,
    one_of,
    part,
    table_of,
    tested,
    text,
    unknown_name,
)
from armid.registry import PLUGIN_PREFIX, Registry, load_plugin, load_registry

IDENTIFIES, CLOSES_LOOP = KIND_NAMES = ("identify", "close_loop")
REPORTS = ("", "table1", "table2", "benchmark", "fitness")
LOOP_REPORTS = ("", "blind", "advice")
WHOLE = "whole"
# Kinds of what a model is made of.
MODELS = ("plants", "effects")
PLAIN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
# Neither key nor number of a study may be larger: what it asks for has to fit into memory and a lifetime.
LARGEST_COUNT = 10**9
# Seeds and cases are held in memory, one by one, a case with its model.
MOST_SEEDS, MOST_CASES = 10**6, 10**5


# Kinds of values, see `armid.record.schema`: each returns a value as it is wanted, or raises KindError.


def whole_number(value: object, least: int = 0, most: int = LARGEST_COUNT) -> int:
    if isinstance(value, int) and not isinstance(value, bool) and least <= value <= most:
        return value
    raise KindError(value)


# A name that is safe as the name of a folder.
plain_name = tested(text, lambda name: bool(PLAIN_NAME.fullmatch(name)) and not name.endswith("."))
line_of_text = tested(text, lambda line: line.isprintable() and line == line.strip())
count = partial(whole_number, least=1)


def seeds(value: object) -> tuple[int, ...]:
    """Return seeds: n stands for 1 to n."""
    if isinstance(value, list):
        return tuple(list_of(whole_number, 1)(value))
    return tuple(range(1, whole_number(value, 1, MOST_SEEDS) + 1))


def one_or_more(kind: Kind) -> Kind:
    """Return a kind of lists; one value stands for a list of it."""
    return lambda value: list_of(kind, 1)(value) if isinstance(value, list) else (kind(value),)


rising_counts = tested(one_or_more(count), lambda found: list(found) == sorted(set(found)))


def at_least_zero(value: object) -> float:
    if number(value) < 0.0:
        raise KindError(value)
    # -0.0 is 0 and is to be written like it
    return number(value) + 0.0


def window(value: object) -> tuple[float, ...] | str:
    """Return a window, [begin, end] or the word for all of a record."""
    return WHOLE if value == WHOLE else tuple(list_of(number, 2, 2)(value))


def options(value: object) -> dict[str, float | int | str | bool]:
    """Return an identifier's options by name; those of a part of a chain, which TOML nests, as `pso.velocity_limit`."""

    def option(each: object) -> float | int | str | bool:
        return each if isinstance(each, bool | int | str) else number(each)

    found: dict[str, float | int | str | bool] = {}
    for name, inner in any_table(value).items():
        if isinstance(inner, dict):
            found |= {f"{name}.{key}": part(option, v, f".{name}.{key}") for key, v in inner.items()}
        else:
            found[name] = part(option, inner, f".{name}")
    return found


NUMBERS = key(table_of(number), "a finite number in SI")
BOUNDS = key(table_of(list_of(number, 2, 2)), "[low, high] in SI")
NAMES = key(one_or_more(text), "a name or a list of names")
EFFECT_NAMES = key(list_of(text, 1), "a list of names of effects")
LEVELS = key(one_or_more(at_least_zero), "a number of at least 0 in deg/s, or a list of such")
TABLES = key(list_of(any_table, 1), "a list of at least one table")
WINDOWS = key(one_or_more(window), f"'{WHOLE}', or a list of [begin, end] in seconds and '{WHOLE}'")
STUDY_NAME = key(plain_name, "a plain name of letters, digits, '_', '-' and '.'")
LINE = key(line_of_text, "a text on one line")
QUESTION = key(any_text, "a text")
KIND = key(text, "the kind of a study")
SEEDS = key(seeds, "at most 1,000,000 seeds or a list")
PER_PARAMETER = key(rising_counts, "a whole number above 0, or a rising list of such")
BUDGETS = key(rising_counts, "a whole number of simulations above 0, or a rising list of such")
SEED = key(whole_number, "a whole number of at least 0")


@dataclass(frozen=True, kw_only=True)
class ManoeuvreSpec:
    """Declare a manoeuvre that is simulated; `keys` holds those of the plant, still as they were found."""

    duration_s: float = field(metadata=key(above_zero, "a length in seconds above 0"))
    role: str = field(default="train", metadata=key(one_of("train", "holdout"), "'train' or 'holdout'"))
    constants: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    inputs: Mapping[str, Any] = field(default_factory=dict, metadata=key(any_table, "a table of inputs"))
    keys: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CaseSpec:
    """Declare a [[cases]] entry: a truth with manoeuvres, or a campaign."""

    name: str = field(metadata=LINE)
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
class RandomCasesSpec:
    """Declare [random_cases]: truths spread over the bounds."""

    n: int = field(metadata=key(partial(count, most=MOST_CASES), "a whole number above 0, up to 100,000"))
    seed: int = field(metadata=SEED)
    manoeuvres: tuple[dict[str, Any], ...] = field(metadata=TABLES)
    margin: float = field(default=0.0, metadata=key(at_least_zero, "a share of the range from 0 to below 0.5"))


@dataclass(frozen=True, kw_only=True)
class SuiteSpec:
    """Declare [suite]: instances of problems of `armid.suite()`. train: instances that `armid tune` learns from."""

    problems: tuple[str, ...] = field(default=("*",), metadata=key(list_of(text, 1), "a list of names of problems"))
    instances: tuple[int, ...] = field(default=(1, 2, 3, 4, 5), metadata=key(list_of(count, 1), "a list of instances"))
    train: tuple[int, ...] = field(default=(), metadata=key(list_of(count), "a list of instances"))


@dataclass(frozen=True, kw_only=True)
class EntrySpec:
    name: str = field(metadata=key(text, "the name of an identifier"))
    label: str | None = field(default=None, metadata=LINE)
    budget: tuple[int, ...] | None = field(default=None, metadata=BUDGETS)
    budget_per_parameter: tuple[int, ...] | None = field(default=None, metadata=PER_PARAMETER)
    fitness: tuple[str, ...] | None = field(default=None, metadata=NAMES)
    noise_deg_s: tuple[float, ...] | None = field(default=None, metadata=LEVELS)
    seeds: tuple[int, ...] | None = field(default=None, metadata=SEEDS)
    options: Mapping[str, Any] = field(default_factory=dict, metadata=key(options, "a number, a text, true or false"))


@dataclass(frozen=True, kw_only=True)
class StudySpec:
    """Declare a study that identifies; cases and identifiers are looked into one by one."""

    name: str = field(metadata=STUDY_NAME)
    plant: str = field(metadata=key(text, "the name of a plant"))
    identifiers: tuple[dict[str, Any], ...] = field(
        metadata=key(list_of(any_table, 1), "at least one table headed [[identifiers]]")
    )
    budget: tuple[int, ...] = field(metadata=BUDGETS)
    seeds: tuple[int, ...] = field(metadata=SEEDS)
    question: str = field(default="", metadata=QUESTION)
    kind: str = field(default=IDENTIFIES, metadata=KIND)
    report: str = field(default="", metadata=key(any_text, f"one of {', '.join(map(repr, REPORTS))}"))
    fitness: tuple[str, ...] = field(default=("similarity",), metadata=NAMES)
    noise_deg_s: tuple[float, ...] = field(default=(0.0,), metadata=LEVELS)
    noise_seed: int = field(default=1, metadata=SEED)
    windows_s: tuple[tuple[float, float] | str, ...] = field(default=(WHOLE,), metadata=WINDOWS)
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
    suite: dict[str, Any] | None = field(default=None, metadata=key(any_table, "a table"))
    budget_per_parameter: tuple[int, ...] = field(default=(), metadata=PER_PARAMETER)


@dataclass(frozen=True, kw_only=True)
class LoopSpec:
    """Declare a study that closes the loop on every campaign of a folder.

    campaigns: folder of campaigns, relative to the study's file. made_by: the command that makes it, for people. key:
    file that holds the truth, for who scores; neither study nor report opens it. report: given where they are
    SYNTHETIC, which the page then says. only: patterns of names of campaigns. candidates: effects to look for, empty:
    all; without: those that are left out. rivals: patterns of names of campaigns -> the effects that are looked for
    there, in place of the candidates. suite: what the campaigns are made of, for who makes them; the study does not
    read it.
    """

    name: str = field(metadata=STUDY_NAME)
    campaigns: str = field(metadata=key(line_of_text, "a folder of campaigns, relative to this file"))
    kind: str = field(default=CLOSES_LOOP, metadata=KIND)
    question: str = field(default="", metadata=QUESTION)
    report: str = field(default="", metadata=key(any_text, f"one of {', '.join(map(repr, LOOP_REPORTS))}"))
    made_by: str = field(default="", metadata=key(line_of_text, "the command that makes the campaigns"))
    only: tuple[str, ...] = field(default=("*",), metadata=key(list_of(text, 1), "a list of names of campaigns"))
    candidates: tuple[str, ...] = field(default=(), metadata=EFFECT_NAMES)
    without: tuple[str, ...] = field(default=(), metadata=EFFECT_NAMES)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict, metadata=BOUNDS)
    fixed: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    seed: int = field(default=1, metadata=SEED)
    rivals: Mapping[str, tuple[str, ...]] = field(
        default_factory=dict, metadata=key(table_of(list_of(text, 1)), "lists of effects by names of campaigns")
    )
    suite: Mapping[str, Any] = field(default_factory=dict, metadata=key(any_table, "a table"))
    # last: from here on the name stands for this field
    key: str = field(default="", metadata=key(line_of_text, "the file that holds the truth, relative to this file"))


@dataclass(eq=False)
class StudyRegistry(Registry):
    """What a study may name.

    plugins: `FILE.py:attribute` of the user's own. digests: (kind, name) -> hash of the file that it was read from; it
    is part of a run's settings, so that results of an older version of that file are not taken for the present one's.
    """

    plugins: tuple[str, ...] = ()
    digests: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def identifier(self, name: str, where: str) -> Any:
        try:
            return self.identifier_of(name)
        except ArmidError as error:
            raise ArmidError(f"{where}: {error}") from error

    def with_effects(self, model: Model, names: Iterable[str], where: str) -> Model:
        known = self.effects_for(model.plant)
        for name in names:
            model = model + lookup(known, name, "effect", where)
        return model

    def digests_of(self, kind: str, *names: str) -> dict[str, str]:
        """Return `kind name` -> hash for those of the names that are the user's own; chains are looked into."""
        parts = [part for name in names for part in re.split(r"[+:]", name)]
        return {f"{kind} {part}": self.digests[kind, part] for part in parts if (kind, part) in self.digests}

    def digests_of_models(self) -> dict[str, str]:
        """Return `kind name` -> hash of the user's own plants and effects."""
        return {f"{kind} {name}": digest for (kind, name), digest in self.digests.items() if kind in MODELS}

    def refuse_changed(self, own: Mapping[str, str]) -> None:
        """Refuse a run whose plug-ins are others here than where the study was read; own: `kind name` -> hash."""
        for both, digest in own.items():
            kind, _, name = both.partition(" ")
            if self.digests.get((kind, name)) != digest:
                raise MachineError(f"the plug-in that holds {name} has changed since the study was started: start it "
                                   "again")  # fmt: skip


def study_registry(plugins: Iterable[str] = ()) -> StudyRegistry:
    """Return what may be named: catalogues, entry points, and the user's own. This runs the code of the plug-ins."""
    named = tuple(plugins)
    registry = load_registry(named)
    digests = {}
    for plugin in named:
        kind, name, _ = load_plugin(plugin)
        own = Path(plugin.rpartition(":")[0]).resolve()
        digests[kind, name] = hashlib.sha256(b"".join(f.read_bytes() for f in (own, *imported_beside(own)))).hexdigest()
    return StudyRegistry(registry.plants, registry.effects, registry.own, named, digests)


def imported_beside(plugin: Path) -> list[Path]:
    """Return the files in the folder of a plug-in that were imported, other plug-ins left out."""
    loaded = [(name, Path(file)) for name, module in sys.modules.items() if (file := getattr(module, "__file__", None))]
    return sorted(f for name, f in loaded if f.parent == plugin.parent and not name.startswith(PLUGIN_PREFIX))


def lookup(there: Mapping[str, Any], name: str, what: str, where: str) -> Any:
    if name not in there:
        raise unknown_name(what, name, there, where)
    return there[name]
