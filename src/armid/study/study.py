"""What a runner needs to know of a study, whatever its kind."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from armid.errors import ArmidError, shown
from armid.model import Model
from armid.record.schema import load_toml, unknown_name, validated
from armid.study.cases import Case, cases_of
from armid.study.kind import IDENTIFIES, KINDS, function
from armid.study.spec import REPORTS, EntrySheet, Known, StudySheet, chosen, load_known


class AnyStudy(Protocol):
    """A study that was read: `KINDS[kind]` tells how it is planned, described, performed and reported."""

    @property
    def name(self) -> str:
        """Return the name of the study and of its folder of results."""
        ...

    @property
    def kind(self) -> str:
        """Return the name of its kind."""
        ...

    @property
    def folder(self) -> Path:
        """Return where its file lies."""
        ...

    @property
    def known(self) -> Known:
        """Return what it may name."""
        ...

    @property
    def case_names(self) -> Sequence[str]:
        """Return what it is tried on."""
        ...

    @property
    def labels(self) -> Sequence[str]:
        """Return who tries."""
        ...


@dataclass(frozen=True, eq=False)
class Entry:
    """Hold one identifier of a study with all that was left to the study filled in.

    label: how reports call it. noise_deg_s: levels it is tried at. seeds: of its search and of the noise.
    """

    label: str
    name: str
    options: Mapping[str, Any]
    budget: int
    fitness: tuple[str, ...]
    noise_deg_s: tuple[float, ...]
    seeds: tuple[int, ...]


def entries_of(sheet: StudySheet, known: Known, where: str) -> tuple[Entry, ...]:
    """Return the identifiers of a study, each built once with its budget to see that it can be.

    Raises ArmidError for an unknown name, an option that is refused, and two entries that could not be told apart.
    """
    entries = []
    for i, table in enumerate(sheet.identifiers):
        name = table.get("label", table.get("name"))
        at = f"{where}, identifier {shown(name) if isinstance(name, str) else i + 1}"
        entry = entry_of(validated(EntrySheet, table, at), sheet)
        check_built(entry, known, at)
        entries.append(entry)
    check_apart(entries, where)
    return tuple(entries)


def entry_of(own: EntrySheet, sheet: StudySheet) -> Entry:
    """Return an entry with the study's values where it has none."""
    return Entry(
        label=own.label or own.name,
        name=own.name,
        options=dict(own.options),
        budget=own.budget or sheet.budget,
        fitness=own.fitness or sheet.fitness,
        noise_deg_s=sheet.noise_deg_s if own.noise_deg_s is None else own.noise_deg_s,
        seeds=own.seeds or sheet.seeds,
    )


def check_built(entry: Entry, known: Known, where: str) -> None:
    """Refuse an identifier that cannot be built with its options and budget, or cannot minimise its fitness."""
    identifier = known.identifier(entry.name, where)
    try:
        for fitness in entry.fitness:
            identifier.refuse(chosen(known.fitness, fitness, "fitness", where))
        identifier.with_options(entry.options).build(entry.budget)
    except ArmidError as error:
        raise ArmidError(f"{where}: {error}") from error
    except Exception as error:
        raise ArmidError(f"{where}: it cannot be built: {type(error).__name__}: {error}") from error


def check_apart(entries: Sequence[Entry], where: str) -> None:
    """Refuse a label that stands for two things, and a setting that two entries ask for."""
    for i, entry in enumerate(entries):
        for other in entries[:i]:
            same_label = other.label == entry.label
            same_thing = (other.name, other.options) == (entry.name, entry.options)
            if same_label and not same_thing:
                raise ArmidError(f"{where}: label '{entry.label}' stands for identifiers of other name or options, "
                                 "a label of its own is expected for each")  # fmt: skip
            if (same_label or (same_thing and other.budget == entry.budget)) and meet(entry, other):
                raise ArmidError(f"{where}: identifier '{entry.label}' is there twice with the same fitness, noise and "
                                 "seeds, each run once is expected")  # fmt: skip


def meet(entry: Entry, other: Entry) -> bool:
    """Tell whether two entries ask for the same fitness, noise and seed somewhere."""
    pairs = ((entry.fitness, other.fitness), (entry.noise_deg_s, other.noise_deg_s), (entry.seeds, other.seeds))
    return all(set(one) & set(two) for one, two in pairs)


def check_pair(entry: Entry, cases: Sequence[Case], known: Known, where: str) -> None:
    """Refuse a fitness that needs noise where there is none."""
    at = f"{where}, identifier '{entry.label}'"
    simulated = any(case.source is None for case in cases)
    for fitness in entry.fitness:
        if "noise" in known.fitness[fitness].asks and 0.0 in entry.noise_deg_s and simulated:
            raise ArmidError(f"{at}: fitness '{fitness}' needs noise, but noise_deg_s holds 0, levels of its own that "
                             "are above 0 are expected")  # fmt: skip
    if any(entry.noise_deg_s) and any(case.model.plant.output_unit != "rad/s" for case in cases):
        raise ArmidError(f"{at}: noise_deg_s is given, but the plant's speed is no angular one, 0 is expected")


SUFFIX = ".toml"


@dataclass(frozen=True, eq=False)
class Study:
    """Hold a study that was read and found possible.

    text: the file as it was read. folder: where it lies; campaigns are looked for there. known: what it may name.
    """

    sheet: StudySheet
    text: str
    folder: Path
    cases: tuple[Case, ...]
    entries: tuple[Entry, ...]
    known: Known

    @property
    def name(self) -> str:
        """Name of the study and of its folder of results."""
        return self.sheet.name

    @property
    def kind(self) -> str:
        """Kind of the study."""
        return self.sheet.kind

    @property
    def case_names(self) -> list[str]:
        """Names of the cases."""
        return [case.name for case in self.cases]

    @property
    def labels(self) -> list[str]:
        """Labels of the identifiers, each as often as it is there."""
        return [entry.label for entry in self.entries]


def read_study(path: str | Path, plugins: tuple[str, ...] = ()) -> AnyStudy:
    """Read a study's TOML file; nothing is simulated.

    plugins: `FILE.py:attribute` of the user's own things that it names; this runs their code.

    Raises ArmidError with one sentence (file, key, found, expected) for whatever cannot be run: an unknown key or name,
    impossible bounds, a truth outside them, an option that an identifier refuses, a fitness that it cannot use.
    """
    file = Path(path)
    if not file.is_file():
        raise ArmidError(f"study {file} does not exist, a file that ends in {SUFFIX} is expected")
    table = load_toml(file)
    where = file.name
    kind = kind_of(table, where)
    study: AnyStudy = function(KINDS[kind].read_by)(
        table, file.read_text(encoding="utf-8-sig"), file.resolve().parent, where, load_known(plugins)
    )
    return study


def kind_of(table: Mapping[str, Any], where: str) -> str:
    """Return the kind of a study; what is no text is left to its sheet.

    Raises ArmidError for a kind that nobody made.
    """
    kind = table.get("kind", IDENTIFIES)
    if isinstance(kind, str) and kind and kind not in KINDS:
        raise unknown_name("kind", kind, KINDS, where)
    return kind if isinstance(kind, str) and kind else IDENTIFIES


def read_identifying(table: Mapping[str, Any], text: str, folder: Path, where: str, known: Known) -> Study:
    """Return a study that identifies; arguments and errors as `read_study`."""
    sheet = validated(StudySheet, table, where)
    if sheet.report not in REPORTS:
        raise unknown_name("report", sheet.report, REPORTS[1:], where)
    model = Model(chosen(known.plants, sheet.plant, "plant", where))
    for name in sheet.effects:
        model = model + chosen(known.effects, name, "effect", where)
    entries = entries_of(sheet, known, where)
    cases = cases_of(sheet, model, known, folder, where)
    for entry in entries:
        check_pair(entry, cases, known, where)
    return Study(sheet, text, folder, cases, entries, known)


def description(study: Study, _: Path = Path()) -> dict[str, Any]:
    """Return what a report needs to know of a study, as JSON can hold it, wherever its store is."""
    sheet = study.sheet
    return {
        "name": study.name,
        "question": sheet.question,
        "kind": sheet.kind,
        "report": sheet.report,
        "text": study.text,
        "plant": sheet.plant,
        "unit": study.cases[0].model.plant.output_unit,
        "effects": list(sheet.effects),
        "budget": sheet.budget,
        "fitness": list(dict.fromkeys(f for e in study.entries for f in e.fitness)),
        "identifiers": list(dict.fromkeys(e.label for e in study.entries)),
        "noise_deg_s": list(dict.fromkeys(n for e in study.entries for n in e.noise_deg_s)),
        "seeds": list(dict.fromkeys(s for e in study.entries for s in e.seeds)),
        "windows": [window_text(w) for w in sheet.windows_s],
        "plugins": list(study.known.plugins),
        "cases": [case_description(case) for case in study.cases],
        "published": {case.name: dict(case.published) for case in study.cases if case.published},
    }


def case_description(case: Case) -> dict[str, Any]:
    """Return what a report needs to know of a case; units by parameter, all values SI."""
    return {
        "name": case.name,
        "truth": dict(case.truth),
        "published": dict(case.published),
        "bounds": {name: list(b) for name, b in case.bounds.items()},
        "fixed": case.fixed,
        "units": dict(zip(case.space.names, case.space.units, strict=True)),
        "effects": [e.name for e in case.model.effects],
        "campaign": case.source.campaign if case.source else None,
        "records": list(case.source.records) if case.source else len(case.strokes),
    }


def window_text(window: tuple[float, ...] | list[float] | str) -> str:
    """Return how a window is spelt: "0-0.7 s" or "whole"."""
    return window if isinstance(window, str) else f"{window[0]:g}-{window[1]:g} s"


def canonical(table: Mapping[str, Any]) -> str:
    """Return JSON that is the same for the same content, each number as the shortest text that reads back."""
    return json.dumps(table, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
