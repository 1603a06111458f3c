"""The kind of study that closes the loop on every campaign of a folder."""

import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from json import dumps
from pathlib import Path
from typing import Any, ClassVar

from armid.errors import ArmidError, nearest, quoted
from armid.loop import close_loop, report_of
from armid.record.reader import CAMPAIGN_FILE, CSV_SUFFIX
from armid.record.schema import unknown_name, validated
from armid.study.cases import RunCache, digest_of, unchanged_campaign
from armid.study.spec import CLOSES_LOOP, LOOP_REPORTS, WHOLE_WINDOW, LoopSpec, StudyRegistry, lookup
from armid.study.store import Planned, planned


@dataclass(frozen=True, eq=False)
class LoopStudy:
    """A study that closes loops; cases: name of a campaign's folder -> hash of campaign.toml and the records in it."""

    kind: ClassVar[str] = CLOSES_LOOP
    labels: ClassVar[list[str]] = [CLOSES_LOOP]
    shown: ClassVar[list[str]] = labels

    spec: LoopSpec
    text: str
    folder: Path
    cases: Mapping[str, str]
    candidates: tuple[str, ...]
    registry: StudyRegistry

    @property
    def name(self) -> str:
        return self.spec.name

    @property
    def case_names(self) -> list[str]:
        return list(self.cases)

    @classmethod
    def read(
        cls, table: Mapping[str, Any], text: str, folder: Path, where: str, registry: StudyRegistry
    ) -> "LoopStudy":
        """Return the study of a TOML table; nothing is simulated, and the key is not opened."""
        spec = validated(LoopSpec, table, where)
        if spec.report not in LOOP_REPORTS:
            raise unknown_name("report", spec.report, LOOP_REPORTS[1:], where)
        known = {name: e for plant in registry.plants.values() for name, e in registry.effects_for(plant).items()}
        for name in (*spec.candidates, *spec.without, *(n for names in spec.rivals.values() for n in names)):
            lookup(known, name, "effect", where)
        candidates = tuple(n for n in spec.candidates or registry.effects if n not in spec.without)
        return cls(spec, text, folder, _campaigns(spec, folder, where), candidates, registry)

    @property
    def n_runs(self) -> int:
        return len(self.cases)

    def check(self, _: object) -> None:
        """Nothing is to be checked: a campaign that cannot be read fails alone."""

    def candidates_for(self, case: str) -> tuple[str, ...]:
        own = (names for pattern, names in self.spec.rivals.items() if fnmatchcase(case, pattern))
        return next(own, self.candidates)

    def description(self, out: Path) -> dict[str, Any]:
        """Return what a report needs to know, as JSON can hold it; the key's path is relative to `out`, the store."""
        spec = self.spec
        key = Path(os.path.relpath(self.folder / spec.key, out.resolve())).as_posix() if spec.key else ""
        return {
            "name": self.name,
            "question": spec.question,
            "kind": self.kind,
            "report": spec.report,
            "text": self.text,
            "campaigns": spec.campaigns,
            "made_by": spec.made_by,
            "key": key,
            "candidates": list(self.candidates),
            "rivals": {pattern: list(names) for pattern, names in spec.rivals.items()},
            "identifiers": list(self.labels),
            "plugins": list(self.registry.plugins),
            "cases": [{"name": name, "truth": {}, "bounds": {}} for name in self.cases],
        }

    def plan(self) -> Iterator[Planned]:
        """Yield the runs, campaign by campaign; settings hold all that decides a result, and not where the key is."""
        spec = self.spec
        for case, digest in self.cases.items():
            wanted = self.candidates_for(case)
            settings = {
                "kind": self.kind, "campaigns": spec.campaigns, "bounds": spec.bounds, "fixed": spec.fixed,
                "seed": spec.seed, "candidates": list(wanted), "own": self.registry.digests_of_models(),
                "case": case, "digest": digest,
            }  # fmt: skip
            # Those of sensors are known with the plant of a campaign alone, and looked for where all effects are.
            if spec.candidates or wanted != self.candidates:
                settings["sensors"] = False
            elif unseen := [n for n in spec.without if n not in self.registry.effects]:
                settings["without"] = unseen
            yield planned(settings, case, CLOSES_LOOP, "", None, WHOLE_WINDOW, spec.seed, 0)

    @staticmethod
    def perform(settings: Mapping[str, Any], cache: RunCache) -> dict[str, Any]:
        began = time.process_time()
        registry, folder = cache.registry, cache.folder / settings["campaigns"] / settings["case"]
        campaign = unchanged_campaign(folder, _files(folder), settings["digest"], settings["case"], registry)
        model = campaign.model(registry.effects)
        known = registry.effects_for(campaign.plant)
        sensors = known.keys() - registry.effects.keys() if settings.get("sensors", True) else set()
        wanted = [*settings["candidates"], *(n for n in known if n in sensors - {*settings.get("without", ())})]
        candidates = {n: lookup(known, n, "effect", "settings") for n in wanted}
        bounds = {name: (low, high) for name, (low, high) in settings["bounds"].items()}
        closed = close_loop(model, campaign, candidates, bounds, settings["fixed"], threads=1)
        report = dumps(report_of(closed), allow_nan=False)
        return {"model": str(model), "rows": {"loops": [(closed.verdict, time.process_time() - began, report)]}}


def _campaigns(spec: LoopSpec, folder: Path, where: str) -> dict[str, str]:
    """Return the campaigns of a folder, by name; an error names `made_by` where there are none."""
    place = folder / spec.campaigns
    made = f", `{spec.made_by}` makes them" if spec.made_by else ", a folder of campaigns is expected"
    if not place.is_dir():
        raise ArmidError(f"{where}: there are no campaigns in {quoted(spec.campaigns)}{made}")
    names = sorted(path.name for path in place.iterdir() if (path / CAMPAIGN_FILE).is_file())
    if not names:
        raise ArmidError(f"{where}: {quoted(spec.campaigns)} holds no folder with a {CAMPAIGN_FILE}{made}")
    for pattern in spec.only:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise ArmidError(f"{where}: key 'only' holds {quoted(pattern)}, which is not a campaign of "
                             f"{quoted(spec.campaigns)}, {nearest(pattern, names)}")  # fmt: skip
    chosen = [name for name in names if any(fnmatchcase(name, pattern) for pattern in spec.only)]
    return {name: digest_of(place / name, _files(place / name)) for name in chosen}


def _files(folder: Path) -> list[str]:
    """Return campaign.toml and all records of a campaign: runs on others are other runs."""
    files = (f for f in folder.rglob("*") if f.suffix.lower() == CSV_SUFFIX and f.is_file())
    return sorted([CAMPAIGN_FILE, *(f.relative_to(folder).as_posix() for f in files)])
