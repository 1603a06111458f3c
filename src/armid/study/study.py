"""A study: a question, the cases to try it on, and who tries."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armid.model import ArmidError, Model
from armid.record.campaign_file import load_toml
from armid.record.schema import unknown_name, validated
from armid.study.any_study import AnyStudy
from armid.study.case import Case
from armid.study.cases import cases_of
from armid.study.entry import Entry, check_pair, entries_of
from armid.study.kind import IDENTIFIES, KINDS, function
from armid.study.known import Known, chosen, load_known
from armid.study.sheet import REPORTS, StudySheet

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
