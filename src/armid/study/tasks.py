"""What a study can be: a task that plans its runs and performs one of them.

There are two: `Study` identifies parameters, here below, and `LoopStudy` (see loops) closes the loop on campaigns. Both
have name, kind, folder of their file, registry, case_names (what they are tried on), labels (who tries), shown (their
names in tables), n_runs, and

- check(performed): refuse what cannot be run, before anything is written
- description(out): what a report needs to know, as JSON can hold it; out: folder of the store
- plan(): every run, in the order in which they are performed
- perform(settings, cache): perform one, in a worker, and return fields of its `Outcome`; what it raises is kept as the
  run's error
"""

import errno
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from functools import cache, cached_property
from itertools import combinations, product
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from armid.errors import ArmidError, MachineError, StudyError, caused_by, located, quoted
from armid.estimation.identify import WAS_INTERRUPTED, Identification, identified, versions_of
from armid.identifiers import options_of
from armid.problem.fitness import fitness_of_name
from armid.problem.problem import by_record
from armid.problem.suite import SuiteProblem, first_of
from armid.progress import announced
from armid.record import Campaign
from armid.record.schema import load_toml, unknown_name, validated
from armid.registry import place_in_plugin
from armid.study.cases import Case, RunCache, cases_of, clean_records, in_window
from armid.study.spec import (
    BUDGETS,
    CLOSES_LOOP,
    IDENTIFIES,
    KIND_NAMES,
    NOISES,
    REPORTS,
    EntrySpec,
    StudyRegistry,
    StudySpec,
    lookup,
    study_registry,
)
from armid.study.store import DONE, FAILED, ON, MissingRun, Outcome, Planned, packed, planned
from armid.units import DEG

if TYPE_CHECKING:
    from armid.study.loops import LoopStudy

Task: TypeAlias = "Study | LoopStudy"
Performer: TypeAlias = Callable[[MissingRun], Outcome]
TOML_SUFFIX = ".toml"
LONGEST_ERROR = 2000
# Each run is a row of some kB in the store.
MOST_RUNS = 1_000_000
PACKAGES_OF_STUDY = ("armid", "numpy", "scipy", "numba", "pymoo", "nlopt")
# What the system says when disk, memory or open files run out, or a disk fails.
MACHINE = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS, errno.ENOMEM, errno.EMFILE, errno.ENFILE)


@caused_by(StudyError)
def read_study(path: str | Path, plugins: tuple[str, ...] = ()) -> "Task":
    """Read a study's TOML file; nothing is simulated.

    Parameters
    ----------
    path
        The file.
    plugins
        `FILE.py:attribute` of the user's own things that it names; this runs their code.

    Returns
    -------
    Study or LoopStudy

    Raises
    ------
    StudyError
        With one sentence (file, key, found, expected) for whatever cannot be run: an unknown key or name, impossible
        bounds, a truth outside them, an option that an identifier refuses, a fitness that it cannot use.
    """
    file = Path(path)
    if not file.is_file():
        raise ArmidError(f"study {file} does not exist, a file that ends in {TOML_SUFFIX} is expected")
    table = load_toml(file)
    kind = table.get("kind", IDENTIFIES)
    # what is not text is refused with the other keys
    if not isinstance(kind, str) or not kind:
        kind = IDENTIFIES
    if kind not in KIND_NAMES:
        raise unknown_name("kind", kind, KIND_NAMES, file.name)
    text = file.read_text(encoding="utf-8-sig")
    with announced(f"reading study {file.name}"):
        return task_type(kind).read(table, text, file.resolve().parent, file.name, study_registry(plugins))


def task_type(kind: str) -> "type[Task]":
    """Return the task of a kind; the closed loop is imported for its own studies alone."""
    if kind == CLOSES_LOOP:
        from armid.study.loops import LoopStudy

        return LoopStudy
    return Study


def perform(run: MissingRun, cache: RunCache) -> Outcome:
    """Perform a run of any kind; one that fails is an outcome too, so that the others go on.

    Raises MachineError where disk, memory or cache are at fault: that is not a result of a run.
    """
    began, started_at = time.perf_counter(), datetime.now(UTC).isoformat(timespec="seconds")
    try:
        settings = json.loads(run.settings)
        if own := settings.get("own"):
            cache.registry.refuse_changed(own)
        made = task_type(settings["kind"]).perform(settings, cache)
    except (Exception, SystemExit) as error:
        if isinstance(error, MachineError):
            raise
        if of_machine(error):
            raise MachineError(f"the machine, not a run, is at fault: {sentence(error)}") from error
        return Outcome(run.run, FAILED, sentence(error), seconds=time.perf_counter() - began, started_at=started_at)
    seconds = time.perf_counter() - began
    return Outcome(run.run, DONE, seconds=seconds, started_at=started_at, versions=versions(), **made)


def of_machine(error: BaseException) -> bool:
    """Tell whether disk or memory are at fault; what a plug-in itself opens or asks for is its own fault."""
    lacks = error.errno in MACHINE if isinstance(error, OSError) else isinstance(error, MemoryError)
    return lacks and place_in_plugin(error) is None


def sentence(error: BaseException) -> str:
    """Return what an error says, with its kind and its place in a plug-in where it is a user's."""
    if isinstance(error, ArmidError):
        return str(error)[:LONGEST_ERROR]
    place = place_in_plugin(error)
    where = "" if place is None else f"plug-in {place}: "
    return f"{where}{type(error).__name__}: {error}"[:LONGEST_ERROR]


@cache
def versions() -> dict[str, str]:
    return versions_of(PACKAGES_OF_STUDY)


@dataclass(frozen=True, eq=False)
class Study:
    """A study that identifies, read and found possible; campaigns are looked for in its folder."""

    kind: ClassVar[str] = IDENTIFIES

    spec: StudySpec
    text: str
    folder: Path
    cases: tuple[Case, ...]
    entries: tuple[EntrySpec, ...]
    registry: StudyRegistry

    @property
    def name(self) -> str:
        """Name of the study and of its folder of results."""
        return self.spec.name

    @property
    def case_names(self) -> list[str]:
        """Names of the cases."""
        return [case.name for case in self.cases]

    @property
    def labels(self) -> list[str]:
        """Labels of the identifiers, each as often as it is there."""
        return [entry.label for entry in self.entries]

    @property
    def shown(self) -> list[str]:
        """Labels, and labels with a fitness, as tables show them where there are several."""
        return self.labels + [f"{entry.label}{ON}{fitness}" for entry in self.entries for fitness in entry.fitness]

    @classmethod
    def read(cls, table: Mapping[str, Any], text: str, folder: Path, where: str, registry: StudyRegistry) -> "Study":
        """Return the study of a TOML table; errors as `read_study`."""
        spec = validated(StudySpec, table, where)
        if spec.report not in REPORTS:
            raise unknown_name("report", spec.report, REPORTS[1:], where)
        model = registry.model(spec.plant, spec.effects, where)
        entries = _entries(spec, model.plant.output_unit, registry, where)
        cases = cases_of(spec, model, registry, folder, where)
        for entry in entries:
            _check_noise(entry, cases, registry, where)
        study = cls(spec, text, folder, cases, entries, registry)
        if study.n_runs > MOST_RUNS:
            raise ArmidError(f"{where}: {study.n_runs:,} runs are asked for (cases, identifiers, seeds, windows, "
                             f"noises, fitnesses and budgets), at most {MOST_RUNS:,} are expected")  # fmt: skip
        return study

    def check(self, performed: Performer) -> None:
        """Simulate each case's truth once: the model is compiled and the machine moves; build identifiers of the user.

        Refuse a run that is asked for twice, as the plan would hold it once.
        performed: performs a run in a process of its own, which what a user's function does cannot harm.
        """
        for entry in self.entries:
            if self.registry.digests_of("identifiers", entry.name):
                settings = {"kind": self.kind, "only_built": True, "identifier": entry.name,
                            "options": dict(entry.options), "budget": entry.largest_budget}  # fmt: skip
                outcome = performed(MissingRun(entry.label, json.dumps(settings)))
                if outcome.status == FAILED:
                    raise ArmidError(f"identifier '{entry.label}': it cannot be built: {outcome.error}")
        asked: set[str] = set()
        shared = [{*one.seeds} & {*two.seeds} for one, two in combinations(self.entries, 2)]
        for run in self.plan({entry.seeds[0] for entry in self.entries} | {min(both) for both in shared if both}):
            if run.run in asked:
                raise ArmidError(f"case '{run.case}', identifier '{run.identifier}': the same run is asked for twice "
                                 f"(fitness {run.fitness}, window {run.window}), each once is expected")  # fmt: skip
            asked.add(run.run)
        for case in self.cases:
            if case.source is None and case.suite is None:
                try:
                    for record, window in product(
                        clean_records(self._case_settings(case), case.model), self.spec.windows_s
                    ):
                        in_window(record, window)
                except ArmidError as error:
                    raise ArmidError(f"case '{case.name}', {error}") from error

    def cost(self) -> str:
        """Return in words what all runs need: simulations, and on a suite the time of the engine, measured here."""
        budgets = {case: sum(len(set(entry.seeds)) * sum(budget for *_, budget in self._choices(case, entry))
                             for entry in self.entries) for case in self.cases}  # fmt: skip
        total = f"{self.n_runs:,} runs, {sum(budgets.values()):,} simulations at most in all"
        if not all(case.suite for case in self.cases):
            return total
        seconds = sum(n * first_of(p.problem_name).cost_s for case, n in budgets.items() if (p := case.suite))
        time = f"{seconds / 60.0:.3g} min" if seconds >= 60.0 else f"{seconds:.2g} s"
        return (f"{total}; they take the engine about {time} of one processor, to which comes what "
                "the identifiers themselves need")  # fmt: skip

    def description(self, _: Path = Path()) -> dict[str, Any]:
        """Return what a report needs to know, as JSON can hold it, wherever the store is."""
        spec, angles = self.spec, {case.angle for case in self.cases}
        return {
            "name": self.name,
            "question": spec.question,
            "kind": self.kind,
            "report": spec.report,
            "text": self.text,
            "plant": spec.plant,
            "unit": self.cases[0].model.plant.output_unit,
            "angle": angles.pop() if len(angles) == 1 else DEG,
            "effects": list(spec.effects),
            "identifiers": list(dict.fromkeys(self.labels)),
            "plugins": list(self.registry.plugins),
            "cases": [_case_description(case) for case in self.cases],
            "budget_per_parameter": sorted({m for e in self.entries for m in e.budget_per_parameter}),
            "published": {case.name: dict(case.published) for case in self.cases if case.published},
        }

    def plan(self, only: Set[int] | None = None) -> Iterator[Planned]:
        """Yield the runs, seed by seed, so that a study that is broken off has tried everything about equally often.

        only: some of the seeds, None: all.
        """
        shared = {case.name: self._case_settings(case) for case in self.cases}
        seeds = [(entry, frozenset(entry.seeds)) for entry in self.entries]
        every = frozenset[int]().union(*(own for _, own in seeds))
        for seed in sorted(every if only is None else every & only):
            for case in self.cases:
                for entry, own in seeds:
                    if seed in own:
                        yield from self._runs(case, shared[case.name], entry, seed)

    @cached_property
    def n_runs(self) -> int:
        """Number of the runs, before any is planned."""
        seeds = {id(entry): len(set(entry.seeds)) for entry in self.entries}
        return sum(seeds[id(e)] * len(self._choices(case, e)) for case in self.cases for e in self.entries)

    def _choices(self, case: Case, entry: EntrySpec) -> list[tuple[Any, ...]]:
        """Return window, noise, fitness and budget of the runs of one seed."""
        noises = entry.noise_deg_s if case.strokes else (None,)
        fitnesses = entry.fitness if case.suite is None else (case.suite.definition.fitness,)
        return list(product(self.spec.windows_s, noises, fitnesses, entry.budgets(len(case.bounds))))

    def _runs(self, case: Case, shared: dict[str, Any], entry: EntrySpec, seed: int) -> Iterator[Planned]:
        for window, noise, fitness, budget in self._choices(case, entry):
            own = self.registry.digests_of("fitness", fitness) | self.registry.digests_of("identifiers", entry.name)
            settings = shared | {
                "identifier": entry.name, "options": dict(entry.options), "budget": budget, "fitness": fitness,
                "noise_deg_s": noise, "window_s": window, "seed": seed, "own": shared["own"] | own,
            }  # fmt: skip
            words = (case.name, entry.label, fitness, noise, window_text(window))
            yield planned(settings, *words, seed, budget)

    def _case_settings(self, case: Case) -> dict[str, Any]:
        """Return the settings that the runs on a case have in common: all that decides their results."""
        plant, effects = self.spec.plant, [e.name for e in case.model.effects]
        settings: dict[str, Any] = {
            "kind": self.kind, "case": case.name, "plant": plant, "effects": effects, "bounds": case.bounds,
            "fixed": case.fixed, "accuracy": self.spec.accuracy,
            "own": self.registry.digests_of("plants", plant) | self.registry.digests_of("effects", *effects),
        }  # fmt: skip
        if case.suite is not None:
            return settings | {"suite": (case.suite.name, case.suite.version)}
        if case.source is not None:
            return settings | {"campaign": case.source}
        return settings | {
            "truth": case.truth, "strokes": case.strokes, "interval_s": self.spec.interval_s,
            "noise_seed": self.spec.noise_seed,
        }  # fmt: skip

    @staticmethod
    def perform(settings: Mapping[str, Any], cache: RunCache) -> dict[str, Any]:
        """Identify once."""
        identifier = cache.registry.identifier(settings["identifier"], "settings").with_options(settings["options"])
        if settings.get("only_built"):
            identifier.build(settings["budget"])
            return {}
        case, replays = cache.replays(settings)
        train, holdout = (tuple(r for r in replays if r.record.role == role) for role in ("train", "holdout"))
        model, fitness = train[0].model, fitness_of_name(settings["fitness"], cache.registry.fitness)
        records = tuple(ready.record for ready in by_record(replays))
        campaign = Campaign(settings["case"], cache.folder, model.plant, (), records, {}, {})
        identification = identified(
            campaign, train, holdout, case.space, fitness, identifier, settings["budget"], settings["seed"]
        )
        if identification.stopped == WAS_INTERRUPTED:
            # not what was asked for: the worker ends, and the run is given back
            raise KeyboardInterrupt
        near, far = identification.train, identification.holdout
        errors = (near.rmse, near.s, near.s1, near.s2, None if far is None else far.rmse)
        rows = {
            "identified": [(identification.used, identification.n_failed, identification.value, identification.stopped,
                            *errors)],
            "parameters": _parameter_rows(identification),
            "traces": [(json.dumps(case.space.free_names), packed(*identification.trace, identification.improved))],
        }  # fmt: skip
        return {"used": identification.used, "model": case.equations, "rows": rows}


def _entries(spec: StudySpec, unit: str, registry: StudyRegistry, where: str) -> tuple[EntrySpec, ...]:
    """Return the identifiers of a study, each built once with its budget to see that it can be; unit: of records."""
    entries: list[EntrySpec] = []
    for i, table in enumerate(spec.identifiers):
        name = table.get("label", table.get("name"))
        at = f"{where}, identifier {quoted(name) if isinstance(name, str) else i + 1}"
        _refuse_options(table, registry, at)
        own = validated(EntrySpec, table, at)
        noise = _levels(own, spec, unit, where, at)
        left = {word: getattr(own, word) or getattr(spec, word)
                for word in ("budget", "budget_per_parameter", "fitness", "seeds")}  # fmt: skip
        entry = replace(own, label=own.label or own.name, noise_deg_s=noise, **left)
        if not (entry.budget or entry.budget_per_parameter):
            raise ArmidError(f"{where}: key 'budget' is missing, {BUDGETS['expected']} is expected")
        _check_built(entry, registry, at)
        entries.append(entry)
    for one, two in combinations(entries, 2):
        if one.label == two.label and (one.name, one.options) != (two.name, two.options):
            raise ArmidError(f"{where}: two identifiers are called '{one.label}' and have other options, a key 'label' "
                             "with a text of its own is expected in one of them")  # fmt: skip
    return tuple(entries)


def _refuse_options(table: Mapping[str, Any], registry: StudyRegistry, where: str) -> None:
    """Refuse an option of an identifier that stands outside its options."""
    known = {f.name for f in fields(EntrySpec)}
    for key in table:
        name = table.get("name")
        if key not in known and isinstance(name, str) and key in options_of(registry.identifier(name, where)):
            raise ArmidError(f"{where}: key '{key}' is an option of {name}, options = {{ {key} = ... }} is expected")


def _levels(own: EntrySpec, spec: StudySpec, unit: str, where: str, at: str) -> tuple[float, ...]:
    """Return the levels of the noise; a key for records in another unit is refused. unit: of the records, SI."""
    levels: tuple[float, ...] = (0.0,)
    for of, end in NOISES.items():
        key = f"noise_{end}"
        sheet, place = (own, at) if getattr(own, key) else (spec, where)
        if of == unit:
            levels = getattr(sheet, key)
        elif any(getattr(sheet, key)):
            wanted = f"noise_{NOISES[unit]} is" if unit in NOISES else "no noise is"
            raise ArmidError(f"{place}: {key} is given, but the records are in {unit}, {wanted} expected")
    return levels


def _check_built(entry: EntrySpec, registry: StudyRegistry, where: str) -> None:
    """Refuse an identifier that cannot be built with its options and budget, or cannot minimise its fitness.

    One of the user is built later, see `Study.check`: whatever its function does has to happen in another process.
    """
    identifier = registry.identifier(entry.name, where)
    asked = [lookup(registry.fitness, fitness.partition(":")[0], "fitness", where) for fitness in entry.fitness]
    with located(where):
        for fitness in asked:
            identifier.refuse(fitness)
        built = identifier.with_options(entry.options)
        if not registry.digests_of("identifiers", entry.name):
            built.build(entry.largest_budget)


def _check_noise(entry: EntrySpec, cases: Sequence[Case], registry: StudyRegistry, where: str) -> None:
    """Refuse noise that would be added to no record, and a fitness that needs noise on records without noise."""
    at = f"{where}, identifier '{entry.label}'"
    simulated, end = any(case.strokes for case in cases), NOISES.get(cases[0].model.plant.output_unit, "")
    if not simulated and any(entry.noise_deg_s):
        raise ArmidError(f"{at}: noise_{end} is {', '.join(f'{n:g}' for n in entry.noise_deg_s)}, but the records "
                         "of all cases have noise of their own: it is to be left out")  # fmt: skip
    for fitness in entry.fitness:
        if "noise" in fitness_of_name(fitness, registry.fitness).asks and 0.0 in entry.noise_deg_s and simulated:
            raise ArmidError(f"{at}: fitness '{fitness}' needs noise, but noise_{end} holds 0, levels of its own that "
                             "are above 0 are expected")  # fmt: skip


def _case_description(case: Case) -> dict[str, Any]:
    """Return what a report needs to know of a case; units by parameter, all values SI."""
    return {
        "name": case.name,
        "truth": dict(case.truth),
        "published": dict(case.published),
        "bounds": {name: list(b) for name, b in case.bounds.items()},
        "fixed": case.fixed,
        "units": dict(zip(case.space.names, case.space.units, strict=True)),
        "effects": [e.name for e in case.model.effects],
        "campaign": case.source["campaign"] if case.source else None,
        "records": list(case.source["records"]) if case.source else len(case.strokes),
    } | ({} if case.suite is None else suite_description(case.suite))


def suite_description(problem: SuiteProblem) -> dict[str, Any]:
    """Return what a report needs to know of an instance; landscape and difficulty are those of the first one."""
    first = first_of(problem.problem_name)
    own = {"n_records": len(first.definition.strokes), "noise_deg_s": first.definition.noise_deg_s}
    return {"suite": problem.problem_name, "floor": problem.floor, "difficulty": first.difficulty,
            "landscape": own | first.landscape}  # fmt: skip


def window_text(window: Sequence[float] | str) -> str:
    return window if isinstance(window, str) else f"{window[0]:g}-{window[1]:g} s"


def _parameter_rows(identification: Identification) -> list[tuple[Any, ...]]:
    """Return value, bounds, standard deviation, largest correlation and flag of each free parameter."""
    information, space = identification.information, identification.space
    free, x, sizes = space.only(space.free_names), identification.candidate[space.free], np.abs(information.correlation)
    known = np.isfinite(sizes) & ~np.eye(len(sizes), dtype=bool)
    largest = [float(row[mask].max()) if mask.any() else None for row, mask in zip(sizes, known, strict=True)]
    columns = (free.names, free.units, x.tolist(), free.low.tolist(), free.high.tolist(),
               information.deviation.tolist(), largest, identification.at_bound[space.free].tolist())  # fmt: skip
    return list(zip(*columns, strict=True))
