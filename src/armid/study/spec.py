"""What a study's TOML file may hold, key by key, and the registered things that it may name."""

import hashlib
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from armid.engine.calibrate import ALLOWED
from armid.errors import MachineError, located
from armid.model import Model, effect_name, effect_named
from armid.record.schema import (
    CONSTANTS_KEY,
    EFFECTS_KEY,
    PLANT,
    ValueKind,
    above_zero,
    any_table,
    any_text,
    instance_of,
    key,
    kind,
    list_of,
    name_in,
    number,
    one_of,
    part,
    sheet_schema,
    table_for,
    table_of,
    tested,
    text,
    unknown_name,
)
from armid.registry import PLUGIN_PREFIX, Registry, load_plugin, load_registry

IDENTIFIES, CLOSES_LOOP = KIND_NAMES = ("identify", "close_loop")
REPORTS = ("", "table1", "table2", "benchmark", "fitness")
LOOP_REPORTS = ("", "blind", "advice")
WHOLE_WINDOW = "whole"
PLAIN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
# Neither key nor number of a study may be larger: what it asks for has to fit into memory and a lifetime.
LARGEST_COUNT = 10**9
# Seeds and cases are held in memory, one by one, a case with its model.
MOST_SEEDS, MOST_CASES = 10**6, 10**5


# Kinds of values, see `armid.record.schema`: each returns a value as it is wanted, or raises KindError.


integer = tested(instance_of(int, "integer"), lambda value: not isinstance(value, bool))


def whole_number(least: int = 0, most: int = LARGEST_COUNT) -> ValueKind:
    return tested(integer, lambda value: least <= value <= most, minimum=least, maximum=most)


# A name that is safe as the name of a folder.
plain_name = tested(
    text, lambda name: bool(PLAIN_NAME.fullmatch(name)) and not name.endswith("."),
    pattern=f"^{PLAIN_NAME.pattern}(?<![.])$",
)  # fmt: skip
line_of_text = tested(text, lambda line: line.isprintable() and line == line.strip())
any_whole, count = whole_number(), whole_number(1)


@kind(anyOf=[list_of(any_whole, 1).schema, whole_number(1, MOST_SEEDS).schema])
def seeds(value: object) -> tuple[int, ...]:
    """Return seeds: n means 1 to n."""
    if isinstance(value, list):
        return tuple(list_of(any_whole, 1)(value))
    return tuple(range(1, whole_number(1, MOST_SEEDS)(value) + 1))


def one_or_more(kind: ValueKind) -> ValueKind:
    """Return a kind of lists; one value is taken as a list of it."""
    several = list_of(kind, 1)
    return ValueKind(lambda value: several(value) if isinstance(value, list) else (kind(value),),
                {"anyOf": [kind.schema, several.schema]})  # fmt: skip


rising_counts = tested(one_or_more(count), lambda counts: list(counts) == sorted(set(counts)))


# -0.0 is 0 and is to be written like it
plain_zero = ValueKind(lambda value: number(value) + 0.0, number.schema)
at_least_zero = tested(plain_zero, lambda value: value >= 0.0, minimum=0)


@kind(anyOf=[{"const": WHOLE_WINDOW}, list_of(number, 2, 2).schema])
def window(value: object) -> tuple[float, ...] | str:
    """Return a window, [begin, end] or the word for all of a record."""
    return WHOLE_WINDOW if value == WHOLE_WINDOW else tuple(list_of(number, 2, 2)(value))


@kind(type=["boolean", "number", "string"])
def option(value: object) -> float | int | str | bool:
    return value if isinstance(value, bool | int | str) else float(number(value))


@kind(type="object", additionalProperties={"anyOf": [option.schema, table_of(option).schema]})
def options(value: object) -> dict[str, float | int | str | bool]:
    """Return an identifier's options by name; those of a part of a chain, which TOML nests, as `pso.velocity_limit`."""
    options: dict[str, float | int | str | bool] = {}
    for name, inner in any_table(value).items():
        if isinstance(inner, dict):
            options |= {f"{name}.{key}": part(option, v, f".{name}.{key}") for key, v in inner.items()}
        else:
            options[name] = part(option, inner, f".{name}")
    return options


EFFECT_NAMES = list_of(name_in("effects"), 1)
ROLE = one_of("train", "holdout")
BOUNDS_KEY = key(table_of(list_of(number, 2, 2)), "[low, high] in SI", "Bounds of the search, by parameter.")
FIXED = key(table_of(number), "a finite number in SI", "Values of parameters that are not searched.")
FITNESSES = key(one_or_more(text), "a name or a list of names", "What is minimised; `armid list fitness` shows them.")
# SI unit of the simulated records -> end of the key that says their noise, such as `noise_deg_s`.
NOISES = {"rad/s": "deg_s", "rad": "deg", "m/s": "mm_s", "m": "mm"}


def levels(unit: str) -> Mapping[str, Any]:
    return key(
        one_or_more(at_least_zero), f"a number of at least 0 in {unit}, or a list of such",
        f"Standard deviation of the white noise that is added to simulated records in {unit}.",
    )  # fmt: skip


STUDY_NAME = key(
    plain_name,
    "a plain name of letters, digits, '_', '-' and '.'",
    "The name of the study and of its folder of results.",
)
LINE_KEY = key(line_of_text, "a text on one line", "The name of the case on pages.")
QUESTION = key(any_text, "a text", "The question that the study answers, shown at the head of its report.")
SEEDS_KEY = key(seeds, "at most 1,000,000 seeds or a list", "Seeds of the searches, one run each; n means 1 to n.")
PER_PARAMETER = key(
    rising_counts, "a whole number above 0, or a rising list of such",
    "Simulations of a run for each free parameter.",
)  # fmt: skip
BUDGETS = key(
    rising_counts, "a whole number of simulations above 0, or a rising list of such",
    "Simulations of a run, of each where there are several; one candidate through all train records counts as one. "
    "With budget_per_parameter it may be left out, and no run has more.",
)  # fmt: skip
SEED_KEY = key(any_whole, "a whole number of at least 0", "Seed of what is drawn at random.")


def kind_key(name: str) -> dict[str, Any]:
    return key(
        ValueKind(text.read, {"const": name}), "the kind of a study", "'close_loop' for campaigns whose loop is closed."
    )


def report_key(names: tuple[str, ...]) -> dict[str, Any]:
    return key(ValueKind(any_text.read, {"enum": list(names)}), f"one of {', '.join(map(repr, names))}",
               "Which report is made; without one the sections that fit.")  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ManoeuvreSpec:
    """Declare a manoeuvre that is simulated; `keys` holds those of the plant, still as they were found."""

    duration_s: float = field(
        metadata=key(above_zero, "a length in seconds above 0", "How long the machine is simulated.")
    )
    role: str = field(default="train", metadata=key(
        ROLE, "'train' or 'holdout'", "Whether parameters are searched on this record, or it judges the result.",
    ))  # fmt: skip
    constants: Mapping[str, float] = field(default_factory=dict, metadata=CONSTANTS_KEY)
    inputs: Mapping[str, Any] = field(default_factory=dict, metadata=key(
        any_table, "a table of inputs",
        "Input -> { csv, column }, or { kind } with its parameters: chirp, multisine, steps or prbs.",
    ))  # fmt: skip
    keys: Mapping[str, object] = field(default_factory=dict)


MANOEUVRES = key(
    list_of(table_for(ManoeuvreSpec), 1), "a list of at least one table", "Manoeuvres that are simulated at the truth."
)


@dataclass(frozen=True, kw_only=True)
class CaseSpec:
    """Declare a [[cases]] entry: a truth with manoeuvres, or a campaign."""

    name: str = field(metadata=LINE_KEY)
    truth: Mapping[str, float] = field(
        default_factory=dict, metadata=key(table_of(number), "a finite number in SI", "True value of each parameter.")
    )
    published: Mapping[str, float] = field(default_factory=dict, metadata=key(
        table_of(number), "a finite number in SI", "Values that others found, shown next to ours.",
    ))  # fmt: skip
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict, metadata=BOUNDS_KEY)
    fixed: Mapping[str, float] = field(default_factory=dict, metadata=FIXED)
    manoeuvres: tuple[dict[str, Any], ...] = field(default=(), metadata=MANOEUVRES)
    campaign: str | None = field(default=None, metadata=key(
        text, "a folder in the folder of the study", "A campaign whose records are used instead of manoeuvres.",
    ))  # fmt: skip
    records: tuple[str, ...] | None = field(default=None, metadata=key(
        list_of(text, 1), "a list of files of the campaign", "The records of the campaign that are used.",
    ))  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class RandomCasesSpec:
    """Declare [random_cases]: truths spread over the bounds."""

    n: int = field(
        metadata=key(whole_number(1, MOST_CASES), "a whole number above 0, up to 100,000", "Number of truths.")
    )
    seed: int = field(metadata=SEED_KEY)
    manoeuvres: tuple[dict[str, Any], ...] = field(metadata=MANOEUVRES)
    margin: float = field(default=0.0, metadata=key(
        at_least_zero, "a share of the range from 0 to below 0.5",
        "Share of each range that holds no truth at either end.",
    ))  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class SuiteSpec:
    """Declare [suite]: instances of problems of `armid.suite()`. train: instances that `armid tune` learns from."""

    problems: tuple[str, ...] = field(default=("*",), metadata=key(
        list_of(text, 1), "a list of names of problems", "Problems of the suite; * matches any letters.",
    ))  # fmt: skip
    instances: tuple[int, ...] = field(default=(1, 2, 3, 4, 5), metadata=key(
        list_of(count, 1), "a list of instances", "Instances of each problem, from 1 to 15.",
    ))  # fmt: skip
    train: tuple[int, ...] = field(default=(), metadata=key(
        list_of(count), "a list of instances", "Instances that `armid tune` learns from.",
    ))  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class EntrySpec:
    """Declare an [[identifiers]] entry; what is not given is as the study has it, see `armid.study.tasks`.

    noise_deg_s: once filled in, levels in the unit of the records, see `NOISES`.
    """

    name: str = field(metadata=key(
        name_in("identifiers"), "the name of an identifier",
        "The optimiser, or a chain such as pso+bobyqa; `armid list identifiers` shows them.",
    ))  # fmt: skip
    label: str = field(
        default="", metadata=key(line_of_text, "a text on one line", "Its name on pages, where that is another.")
    )
    budget: tuple[int, ...] = field(default=(), metadata=BUDGETS)
    budget_per_parameter: tuple[int, ...] = field(default=(), metadata=PER_PARAMETER)
    fitness: tuple[str, ...] = field(default=(), metadata=FITNESSES)
    noise_deg_s: tuple[float, ...] = field(default=(), metadata=levels("deg/s"))
    noise_deg: tuple[float, ...] = field(default=(), metadata=levels("deg"))
    noise_mm_s: tuple[float, ...] = field(default=(), metadata=levels("mm/s"))
    noise_mm: tuple[float, ...] = field(default=(), metadata=levels("mm"))
    seeds: tuple[int, ...] = field(default=(), metadata=SEEDS_KEY)
    options: Mapping[str, Any] = field(default_factory=dict, metadata=key(
        options, "a number, a text, true or false", "Its options; `armid list identifiers --long` shows them.",
    ))  # fmt: skip

    @property
    def largest_budget(self) -> int:
        """Largest budget of a run; with budgets a parameter alone, that of one parameter."""
        return max(self.budget or self.budget_per_parameter)

    def budgets(self, n_free: int) -> list[int]:
        """Return the budgets of its runs: those for each free parameter where there are any, the others cut them."""
        most = max(self.budget, default=sys.maxsize)
        return sorted({min(most, factor * n_free) for factor in self.budget_per_parameter}) or [*self.budget]


@dataclass(frozen=True, kw_only=True)
class StudySpec:
    """Declare a study that identifies; cases and identifiers are looked into one by one."""

    name: str = field(metadata=STUDY_NAME)
    plant: str = field(metadata=PLANT)
    identifiers: tuple[dict[str, Any], ...] = field(metadata=key(
        list_of(table_for(EntrySpec), 1), "at least one table headed [[identifiers]]",
        "The optimisers that are compared.",
    ))  # fmt: skip
    seeds: tuple[int, ...] = field(metadata=SEEDS_KEY)
    budget: tuple[int, ...] = field(default=(), metadata=BUDGETS)
    question: str = field(default="", metadata=QUESTION)
    kind: str = field(default=IDENTIFIES, metadata=kind_key(IDENTIFIES))
    report: str = field(default="", metadata=report_key(REPORTS))
    fitness: tuple[str, ...] = field(default=("similarity",), metadata=FITNESSES)
    noise_deg_s: tuple[float, ...] = field(default=(0.0,), metadata=levels("deg/s"))
    noise_deg: tuple[float, ...] = field(default=(0.0,), metadata=levels("deg"))
    noise_mm_s: tuple[float, ...] = field(default=(0.0,), metadata=levels("mm/s"))
    noise_mm: tuple[float, ...] = field(default=(0.0,), metadata=levels("mm"))
    noise_seed: int = field(default=1, metadata=SEED_KEY)
    windows_s: tuple[tuple[float, float] | str, ...] = field(default=(WHOLE_WINDOW,), metadata=key(
        one_or_more(window), f"'{WHOLE_WINDOW}', or a list of [begin, end] in seconds and '{WHOLE_WINDOW}'",
        "Parts of each record that fitness and errors see.",
    ))  # fmt: skip
    interval_s: float = field(default=1e-3, metadata=key(
        above_zero, "a sample interval in seconds above 0", "Time between two samples of a simulated record.",
    ))  # fmt: skip
    accuracy: str = field(default="auto", metadata=key(
        one_of("auto", *ALLOWED), f"one of 'auto', {', '.join(map(repr, ALLOWED))}",
        "Error of the engine; auto: fine where the noise would not hide the standard error.",
    ))  # fmt: skip
    effects: tuple[str, ...] = field(default=(), metadata=EFFECTS_KEY)
    constants: Mapping[str, float] = field(default_factory=dict, metadata=CONSTANTS_KEY)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict, metadata=BOUNDS_KEY)
    fixed: Mapping[str, float] = field(default_factory=dict, metadata=FIXED)
    cases: tuple[dict[str, Any], ...] = field(default=(), metadata=key(
        list_of(table_for(CaseSpec), 1), "a list of at least one table", "What the optimisers are tried on.",
    ))  # fmt: skip
    random_cases: dict[str, Any] | None = field(
        default=None, metadata=key(table_for(RandomCasesSpec), "a table", "Further cases, truths drawn at random.")
    )
    suite: dict[str, Any] | None = field(
        default=None, metadata=key(table_for(SuiteSpec), "a table", "Further cases, problems of `armid.suite()`.")
    )
    budget_per_parameter: tuple[int, ...] = field(default=(), metadata=PER_PARAMETER)


@dataclass(frozen=True, kw_only=True)
class LoopSpec:
    """Declare a study that closes the loop on every campaign of a folder."""

    name: str = field(metadata=STUDY_NAME)
    campaigns: str = field(metadata=key(
        line_of_text, "a folder of campaigns, relative to this file",
        "Folder of the campaigns, one run each.",
    ))  # fmt: skip
    kind: str = field(metadata=kind_key(CLOSES_LOOP), default=CLOSES_LOOP)
    question: str = field(default="", metadata=QUESTION)
    report: str = field(default="", metadata=report_key(LOOP_REPORTS))
    made_by: str = field(default="", metadata=key(
        line_of_text, "the command that makes the campaigns", "Shown to readers; nothing runs it.",
    ))  # fmt: skip
    only: tuple[str, ...] = field(default=("*",), metadata=key(
        list_of(text, 1), "a list of names of campaigns", "Campaigns that are used; * matches any letters.",
    ))  # fmt: skip
    candidates: tuple[str, ...] = field(default=(), metadata=key(
        EFFECT_NAMES, "a list of names of effects", "Effects to look for; all where none is named.",
    ))  # fmt: skip
    without: tuple[str, ...] = field(
        default=(), metadata=key(EFFECT_NAMES, "a list of names of effects", "Effects that are left out.")
    )
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict, metadata=BOUNDS_KEY)
    fixed: Mapping[str, float] = field(default_factory=dict, metadata=FIXED)
    seed: int = field(default=1, metadata=SEED_KEY)
    rivals: Mapping[str, tuple[str, ...]] = field(default_factory=dict, metadata=key(
        table_of(list_of(text, 1)), "lists of effects by names of campaigns",
        "Effects to look for in campaigns of a name, instead of the candidates.",
    ))  # fmt: skip
    suite: Mapping[str, Any] = field(default_factory=dict, metadata=key(
        any_table, "a table", "What the campaigns are made of, for their maker; the study does not read it.",
    ))  # fmt: skip
    # last: from here on the name means this field
    key: str = field(default="", metadata=key(
        line_of_text, "the file that holds the truth, relative to this file",
        "Truth of the campaigns, for who scores them; neither study nor report opens it.",
    ))  # fmt: skip


def study_schema() -> dict[str, Any]:
    """Return the JSON Schema of a study's file; its key `kind` says which of the two sheets holds."""
    closes = {"properties": {"kind": {"const": CLOSES_LOOP}}, "required": ["kind"]}
    return {"if": closes, "then": sheet_schema(LoopSpec), "else": sheet_schema(StudySpec)}


@dataclass(eq=False)
class StudyRegistry(Registry):
    """What a study may name.

    plugins: `FILE.py:attribute` of the user's own. digests: `kind name` -> hash of the file that it was read from; it
    is part of a run's settings, so that results of an older version of that file are not taken for the present one's.
    """

    plugins: tuple[str, ...] = ()
    digests: Mapping[str, str] = field(default_factory=dict)

    def identifier(self, name: str, where: str) -> Any:
        with located(where):
            return self.identifier_of(name)

    def model(self, plant: str, effects: Iterable[str], where: str) -> Model:
        return self.with_effects(Model(lookup(self.plants, plant, "plant", where)), effects, where)

    def with_effects(self, model: Model, names: Iterable[str], where: str) -> Model:
        known = self.effects_for(model.plant)
        for name in names:
            lookup(known, effect_name(name), "effect", where)
            with located(where):
                model = model + effect_named(name, known, model.plant)
        return model

    def digests_of(self, kind: str, *names: str) -> dict[str, str]:
        """Return `kind name` -> hash for those of the names that are the user's own; chains are looked into."""
        wanted = {f"{kind} {part}" for name in names for part in re.split(r"[+:]", name)}
        return {own: digest for own, digest in self.digests.items() if own in wanted}

    def digests_of_models(self) -> dict[str, str]:
        """Return `kind name` -> hash of the user's own plants and effects."""
        return {own: digest for own, digest in self.digests.items() if own.startswith(("plants ", "effects "))}

    def refuse_changed(self, own: Mapping[str, str]) -> None:
        """Refuse a run whose plug-ins are others here than where the study was read; own: `kind name` -> hash."""
        for thing, digest in own.items():
            if self.digests.get(thing) != digest:
                raise MachineError(f"the plug-in that holds {thing.partition(' ')[2]} has changed since the study was "
                                   "started: start it again")  # fmt: skip


def study_registry(plugins: Iterable[str] = ()) -> StudyRegistry:
    """Return what may be named: catalogues, entry points, and the user's own. This runs the code of the plug-ins."""
    named = tuple(plugins)
    registry = load_registry(named)
    digests = {}
    for plugin in named:
        kind, name, _ = load_plugin(plugin)
        file = Path(plugin.rpartition(":")[0]).resolve()
        content = b"".join(f.read_bytes() for f in (file, *imported_beside(file)))
        digests[f"{kind} {name}"] = hashlib.sha256(content).hexdigest()
    return StudyRegistry(registry.plants, registry.effects, registry.own, named, digests)


def imported_beside(plugin: Path) -> list[Path]:
    """Return the files in the folder of a plug-in that were imported, other plug-ins left out."""
    loaded = [(name, Path(file)) for name, module in sys.modules.items() if (file := getattr(module, "__file__", None))]
    return sorted(f for name, f in loaded if f.parent == plugin.parent and not name.startswith(PLUGIN_PREFIX))


def lookup(entries: Mapping[str, Any], name: str, what: str, where: str) -> Any:
    if name not in entries:
        raise unknown_name(what, name, entries, where)
    return entries[name]
