"""What runs share: models, records and calibrations, made once in a process and kept."""

import json
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from armid.errors import ArmidError
from armid.estimation.least_squares import with_fitted_starts
from armid.model import Model
from armid.problem.problem import Replay, replays
from armid.problem.space import Space, space_of
from armid.problem.suite import VERSION, suite
from armid.record import Campaign, Record
from armid.record.reader import NAME
from armid.study.cases import campaign_folder, clean_records, in_window, noise_rms, noisy_records, unchanged_campaign
from armid.study.spec import StudyRegistry, lookup

# How many cases, each at one level of noise and in one window, are kept ready in a process.
MOST_KEPT = 512
SHARED = (
    "plant", "effects", "bounds", "fixed", "accuracy", "window_s", "truth", "strokes", "interval_s", "campaign",
    "suite",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class PreparedCase:
    """A case ready to run on; records: whole ones that noise is added to, empty for records that are read."""

    equations: str
    space: Space
    records: tuple[Record, ...]
    replays: tuple[Replay, ...]


class RunCache:
    """Make what runs need, and keep it for the next run; what is kept depends on the settings alone."""

    def __init__(self, registry: StudyRegistry, folder: Path) -> None:
        self.registry, self.folder = registry, folder
        self._kept: OrderedDict[str, Any] = OrderedDict()

    def replays(self, settings: Mapping[str, Any]) -> tuple[PreparedCase, tuple[Replay, ...]]:
        """Return the case of a run, and its records with the run's own noise, ready to be simulated."""
        shared = {word: settings[word] for word in SHARED if word in settings}
        level = settings["noise_deg_s"] or 0.0
        case = self._once("case", shared | {"noise": level}, lambda: self._prepared(settings, level))
        if level == 0.0:
            return case, case.replays
        noisy = [in_window(r, settings["window_s"]) for r in noisy_records(case.records, settings)]
        return case, tuple(_measured_again(r, record) for r, record in zip(case.replays, noisy, strict=True))

    def _prepared(self, settings: Mapping[str, Any], level: float) -> PreparedCase:
        if "suite" in settings:
            name, version = settings["suite"]
            if version != VERSION:
                raise ArmidError(f"problem '{name}' is of version {version} of the suite, {VERSION} is expected")
            problem = suite()[name].identification
            return PreparedCase(str(problem.replays[0].model), problem.space, (), problem.replays)
        model, whole = self._source(settings)
        bounds = {name: (low, high) for name, (low, high) in settings["bounds"].items()}
        space = space_of(model, {}, bounds, settings["fixed"])
        records = [in_window(record, settings["window_s"]) for record in whole]
        accuracy = None if settings["accuracy"] == "auto" else settings["accuracy"]
        if level:
            # the accuracy that is enough depends on how loud the noise is, not on how it turns out
            records = [r.with_signals(lambda s: replace(s, noise=replace(s.noise, rms=noise_rms(settings, s.unit))))
                       for r in records]  # fmt: skip
        made = replays(records, model, space, accuracy)
        train = iter(with_fitted_starts(tuple(r for r in made if r.record.role == "train"), space))
        made = tuple(next(train) if r.record.role == "train" else r for r in made)
        return PreparedCase(str(model), space, () if "campaign" in settings else tuple(whole), made)

    def _source(self, settings: Mapping[str, Any]) -> tuple[Model, tuple[Record, ...]]:
        source = settings.get("campaign")
        if source is None:
            plant = lookup(self.registry.plants, settings["plant"], "plant", "settings")
        else:
            campaign = self._once("campaign", source, lambda: self._campaign(**source))
            plant = campaign.plant
        model = self.registry.with_effects(Model(plant), settings["effects"], "settings")
        if source is not None:
            return model, tuple(r for r in campaign.records if r.file in source["records"])
        parts = {word: settings[word] for word in ("plant", "effects", "truth", "strokes", "interval_s")}
        return model, self._once("clean", parts, lambda: clean_records(settings, model))

    def _campaign(self, campaign: str, records: Sequence[str], digest: str) -> Campaign:
        path = campaign_folder(self.folder, campaign, "settings")
        return unchanged_campaign(path, (NAME, *records), digest, campaign, self.registry)

    def _once(self, what: str, of: Mapping[str, Any], make: Callable[[], Any]) -> Any:
        key = what + json.dumps(of, sort_keys=True)
        if key not in self._kept:
            self._kept[key] = make()
            if len(self._kept) > MOST_KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]


def _measured_again(replay: Replay, record: Record) -> Replay:
    """Return a replay of the same manoeuvre with another measurement, on the schedule that it has."""
    assert [p.window for p in replay.pieces] == [p.window for p in record.pieces]
    return replay.changed(record=record.until_window_end())
