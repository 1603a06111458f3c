"""A study that closes the loop on many campaigns."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from armid.record.schema import unknown_name, validated
from armid.study.known import Known, chosen
from armid.study.loops.campaigns import LoopCase, campaigns_in
from armid.study.loops.sheet import REPORTS, LoopSheet

LABEL = "close_loop"


@dataclass(frozen=True, eq=False)
class LoopStudy:
    """Hold a study of loops that was read and found possible.

    text: the file as it was read. folder: where it lies. cases: the campaigns. candidates: names of the effects that
    are looked for. known: what it may name.
    """

    sheet: LoopSheet
    text: str
    folder: Path
    cases: tuple[LoopCase, ...]
    candidates: tuple[str, ...]
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
        """Names of the campaigns."""
        return [case.name for case in self.cases]

    def candidates_for(self, case: str) -> tuple[str, ...]:
        """Return the effects that are looked for in a campaign."""
        own = (names for pattern, names in self.sheet.rivals.items() if fnmatchcase(case, pattern))
        return next(own, self.candidates)

    @property
    def labels(self) -> list[str]:
        """The one thing that is done to each."""
        return [LABEL]


def read_loops(table: Mapping[str, Any], text: str, folder: Path, where: str, known: Known) -> LoopStudy:
    """Return a study of loops; nothing is simulated, and the key is not opened.

    Raises ArmidError for an unknown key or name, and where the campaigns are not there.
    """
    sheet = validated(LoopSheet, table, where)
    if sheet.report not in REPORTS:
        raise unknown_name("report", sheet.report, REPORTS[1:], where)
    for name in (*sheet.candidates, *sheet.without, *(n for names in sheet.rivals.values() for n in names)):
        chosen(known.effects, name, "effect", where)
    candidates = tuple(n for n in sheet.candidates or known.effects if n not in sheet.without)
    cases = campaigns_in(folder, sheet.campaigns, sheet.only, sheet.made_by, where)
    return LoopStudy(sheet, text, folder, cases, candidates, known)


def describe_loops(study: LoopStudy, out: Path) -> dict[str, Any]:
    """Return what a report needs to know of a study of loops, as JSON can hold it.

    out: folder of the store; the key is told as seen from there.
    """
    sheet = study.sheet
    key = os.path.relpath(study.folder / sheet.key, out.resolve()) if sheet.key else ""
    return {
        "name": study.name,
        "question": sheet.question,
        "kind": sheet.kind,
        "report": sheet.report,
        "text": study.text,
        "campaigns": sheet.campaigns,
        "made_by": sheet.made_by,
        "key": Path(key).as_posix() if key else "",
        "candidates": list(study.candidates),
        "rivals": {pattern: list(names) for pattern, names in sheet.rivals.items()},
        "identifiers": study.labels,
        "plugins": list(study.known.plugins),
        "cases": [{"name": case.name, "truth": {}, "bounds": {}} for case in study.cases],
    }
