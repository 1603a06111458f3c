"""A study that closes the loop on many campaigns."""

import hashlib
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from numpy.random import default_rng

from armid.errors import ArmidError, nearest, shown
from armid.loop import close_loop, report_of
from armid.model import Model
from armid.record import read_campaign
from armid.record.reader import NAME, SUFFIX
from armid.record.schema import any_table, key, list_of, table_of, text, unknown_name, validated
from armid.study.outcome import DONE, Outcome, Task
from armid.study.plan import ID_LENGTH, Planned
from armid.study.run import versions
from armid.study.run_cache import Workshop
from armid.study.spec import BOUNDS, NUMBERS, WHOLE, Known, any_text, chosen, line_of_text, plain_name, whole_number
from armid.study.study import canonical


@dataclass(frozen=True)
class LoopCase:
    """Hold one campaign: its folder's name, and a hash of campaign.toml and the records in it."""

    name: str
    digest: str


def campaigns_in(folder: Path, campaigns: str, only: Sequence[str], made_by: str, where: str) -> tuple[LoopCase, ...]:
    """Return the campaigns of a folder, by name.

    folder: of the study's file. only: patterns of names. made_by: the command that makes them, told where it is absent.

    Raises ArmidError where there is no such folder or no campaign in it, and for a pattern that meets none.
    """
    place = folder / campaigns
    made = f", `{made_by}` makes them" if made_by else ", a folder of campaigns is expected"
    if not place.is_dir():
        raise ArmidError(f"{where}: there are no campaigns in {shown(campaigns)}{made}")
    names = sorted(path.name for path in place.iterdir() if (path / NAME).is_file())
    if not names:
        raise ArmidError(f"{where}: {shown(campaigns)} holds no folder with a {NAME}{made}")
    for pattern in only:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise ArmidError(f"{where}: key 'only' holds {shown(pattern)}, which is no campaign of "
                             f"{shown(campaigns)}, {nearest(pattern, names)}")  # fmt: skip
    chosen = [name for name in names if any(fnmatchcase(name, pattern) for pattern in only)]
    return tuple(LoopCase(name, digest_of(place / name)) for name in chosen)


def digest_of(folder: Path) -> str:
    """Return a hash of campaign.toml and all records of a campaign, so that runs on other records are other runs."""
    digest = hashlib.sha256()
    for name in sorted(name for name in os.listdir(folder) if name == NAME or name.endswith(SUFFIX)):
        content = (folder / name).read_bytes()
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


REPORTS = ("", "blind", "advice")


@dataclass(frozen=True, kw_only=True)
class LoopSheet:
    """Declare a study that closes the loop on every campaign of a folder.

    campaigns: folder of campaigns, relative to the study's file. made_by: the command that makes it, for people. key:
    file that holds the truth, which the report alone opens. only: patterns of names of campaigns. candidates: effects
    to look for, empty: all; without: those that are left out. rivals: patterns of names of campaigns -> the effects
    that are looked for there, in place of the candidates. suite: what the campaigns are made of, for who makes them;
    the study does not read it.
    """

    name: str = field(metadata=key(plain_name, "a plain name of letters, digits, '_', '-' and '.'"))
    campaigns: str = field(metadata=key(line_of_text, "a folder of campaigns, relative to this file"))
    kind: str = field(default="close_loop", metadata=key(text, "the kind of a study"))
    question: str = field(default="", metadata=key(any_text, "a text"))
    report: str = field(default="", metadata=key(any_text, f"one of {', '.join(map(repr, REPORTS))}"))
    made_by: str = field(default="", metadata=key(line_of_text, "the command that makes the campaigns"))
    only: tuple[str, ...] = field(default=("*",), metadata=key(list_of(text, 1), "a list of names of campaigns"))
    candidates: tuple[str, ...] = field(default=(), metadata=key(list_of(text, 1), "a list of names of effects"))
    without: tuple[str, ...] = field(default=(), metadata=key(list_of(text, 1), "a list of names of effects"))
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict, metadata=BOUNDS)
    fixed: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    seed: int = field(default=1, metadata=key(whole_number, "a whole number of at least 0"))
    rivals: Mapping[str, tuple[str, ...]] = field(
        default_factory=dict, metadata=key(table_of(list_of(text, 1)), "lists of effects by names of campaigns")
    )
    suite: Mapping[str, Any] = field(default_factory=dict, metadata=key(any_table, "a table"))
    # last: from here on the name stands for this field
    key: str = field(default="", metadata=key(line_of_text, "the file that holds the truth, relative to this file"))


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


def planned_loops(study: LoopStudy) -> Iterator[Planned]:
    """Yield the runs, campaign by campaign; their settings hold all that decides a result, and not where the key is."""
    sheet = study.sheet
    shared = {
        "kind": sheet.kind, "campaigns": sheet.campaigns, "bounds": sheet.bounds, "fixed": sheet.fixed,
        "seed": sheet.seed,
    }  # fmt: skip
    for case in study.cases:
        wanted = study.candidates_for(case.name)
        looked_for = {"candidates": list(wanted), "own": study.known.own("effects", *wanted)}
        settings = canonical(shared | looked_for | {"case": case.name, "digest": case.digest})
        run = hashlib.sha256(settings.encode()).hexdigest()[:ID_LENGTH]
        yield Planned(run, settings, case.name, LABEL, "", None, WHOLE, sheet.seed, 0)


def close_loop_run(task: Task, workshop: Workshop) -> Outcome:
    """Close the loop on one campaign, on one thread.

    Raises ArmidError for a campaign that cannot be read or has changed, and whatever the loop raises.
    """
    began, began_cpu = time.perf_counter(), time.process_time()
    started_at = datetime.now(UTC).isoformat(timespec="seconds")
    settings = json.loads(task.settings)
    known, folder = workshop.known, workshop.folder / settings["campaigns"] / settings["case"]
    if digest_of(folder) != settings["digest"]:
        raise ArmidError(f"campaign {settings['case']} has changed since the study was started: start it again")
    campaign = read_campaign(folder, known.plants, known.effects)
    model = Model(campaign.plant)
    for name in campaign.effects:
        model = model + chosen(known.effects, name, "effect", "campaign")
    candidates = {name: chosen(known.effects, name, "effect", "settings") for name in settings["candidates"]}
    bounds = {name: (low, high) for name, (low, high) in settings["bounds"].items()}
    found = close_loop(model, campaign, candidates, default_rng(settings["seed"]), bounds, settings["fixed"], threads=1)
    report = json.dumps(report_of(found), allow_nan=False)
    rows = {"loops": [(found.verdict, time.process_time() - began_cpu, report)]}
    seconds = time.perf_counter() - began
    return Outcome(task.run, DONE, "", 0, seconds, started_at, str(model), versions(), rows)
