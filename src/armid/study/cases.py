"""Cases out of the study's file: simulated, random, campaigns; and what runs share, made once in a process."""

import fnmatch
import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from armid.engine import FINE, Schedule, calibrate, simulate
from armid.errors import ArmidError, located, quoted
from armid.estimation.least_squares import with_fitted_starts
from armid.model import Manoeuvre, Model, Plant, effect_name
from armid.model.parameter import warn_of_far
from armid.problem.problem import Replay, replays
from armid.problem.space import Space, space_of
from armid.problem.suite import DEFINITIONS, N_INSTANCES, VERSION, SuiteProblem, suite
from armid.record import Campaign, Override, Record, read_campaign
from armid.record.reader import CAMPAIGN_FILE, campaign_path, record_constants
from armid.record.record import made_record
from armid.record.resample import FEWEST_SAMPLES, is_constant, with_window
from armid.record.schema import RecordSheet, unknown_name, validated
from armid.study.inputs import input_values, inputs_of
from armid.study.spec import NOISES, CaseSpec, ManoeuvreSpec, RandomCasesSpec, StudyRegistry, StudySpec, SuiteSpec
from armid.units import DEG, SUFFIXES

MOST_SIMULATED = 10**7
# What a problem of the suite brings, so that no key of a study may tell it.
BROUGHT = ("noise_deg_s", "windows_s", "interval_s", "accuracy", "constants", "bounds", "fixed", "fitness")
# Steps at the truth are finer by this factor than those of the engine at its "fine" accuracy. The error falls with the
# fourth power: of the arm it is then about 1e-11 rad/s.
FINER_TRUTH = 8


@dataclass(frozen=True, eq=False)
class Case:
    """Hold one case: manoeuvres to simulate (strokes), a campaign to read (source) or a problem of `armid.suite()`.

    truth: parameter -> true value, SI, empty where not known. published: values of others to compare with. source:
    campaign, its folder relative to the study's file; records, its files; digest, of them and campaign.toml. angle: in
    which that campaign shows angles.
    """

    name: str
    model: Model
    space: Space
    truth: Mapping[str, float] = field(default_factory=dict)
    published: Mapping[str, float] = field(default_factory=dict)
    strokes: tuple[dict[str, Any], ...] = ()
    source: dict[str, Any] | None = None
    angle: str = DEG
    suite: SuiteProblem | None = None

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        box = zip(self.space.names, self.space.low, self.space.high, self.space.free, strict=True)
        return {name: (float(low), float(high)) for name, low, high, free in box if free}

    @property
    def fixed(self) -> dict[str, float]:
        values = zip(self.space.names, self.space.fixed, self.space.free, strict=True)
        return {name: float(value) for name, value, free in values if not free}


def cases_of(spec: StudySpec, model: Model, registry: StudyRegistry, folder: Path, where: str) -> tuple[Case, ...]:
    """Return the cases of a study, random ones last; model: the plant with the study's effects."""
    cases = []
    for i, table in enumerate(spec.cases):
        name = table.get("name")
        at = f"{where}, case {quoted(name) if isinstance(name, str) else i + 1}"
        cases.append(_case(validated(CaseSpec, table, at), spec, model, registry, folder, at))
    if spec.suite is not None:
        cases += suite_cases(spec, f"{where}, suite")
    if spec.random_cases is not None:
        cases += _random_cases(spec, model, folder, f"{where}, random_cases")
    if not cases:
        raise ArmidError(f"{where}: there is no case, a table [[cases]], [random_cases] or [suite] is expected")
    for name, count in Counter(case.name for case in cases).items():
        if count > 1:
            raise ArmidError(f"{where}: case '{name}' is there twice, each name once is expected")
        if "/" in name:
            raise ArmidError(f"{where}: the name of case '{name}' holds '/', which stands between case and "
                             "identifier, another sign is expected")  # fmt: skip
    return tuple(cases)


def suite_cases(spec: StudySpec, where: str, train: bool = False) -> list[Case]:
    """Return the instances of the suite that a study names, or those that `armid tune` learns from."""
    wanted = validated(SuiteSpec, spec.suite, where)
    if spec.plant != "shell_transfer_arm" or spec.effects:
        raise ArmidError(f"{where}: the suite brings its effects, plant 'shell_transfer_arm' without any is expected")
    given = [f.name for f in fields(spec) if f.name in BROUGHT and getattr(spec, f.name) not in (f.default, {})]
    given += ["fitness"] if any("fitness" in table for table in spec.identifiers) else []
    if given and not spec.cases and spec.random_cases is None:
        raise ArmidError(f"{where}: '{given[0]}' is given, but a problem of the suite brings its own, no such key is "
                         "expected")  # fmt: skip
    for pattern in wanted.problems:
        if not fnmatch.filter(DEFINITIONS, pattern):
            raise unknown_name("problem", pattern, DEFINITIONS, where)
    instances = wanted.train if train else wanted.instances
    if not instances or max(instances) > N_INSTANCES or len(set(instances)) < len(instances):
        raise ArmidError(f"{where}: {'train' if train else 'instances'} is {list(instances)}, different ones from 1 to "
                         f"{N_INSTANCES} are expected")  # fmt: skip
    names = [name for name in DEFINITIONS if any(fnmatch.fnmatchcase(name, p) for p in wanted.problems)]
    problems = [SuiteProblem(name, i, units="SI") for name in names for i in instances]
    return [
        Case(p.name.replace("/", " "), p.model, p.space, dict(zip(p.names, p.truth.tolist(), strict=True)), suite=p)
        for p in problems
    ]


def _case(
    entry: CaseSpec, spec: StudySpec, model: Model, registry: StudyRegistry, folder: Path, where: str
) -> Case:  # fmt: skip
    if (entry.campaign is None) == (not entry.manoeuvres):
        both = "both are" if entry.campaign is not None else "neither is"
        raise ArmidError(f"{where}: manoeuvres to simulate or a campaign to read is expected, {both} given")
    if entry.campaign is not None:
        case = _campaign_case(entry, entry.campaign, spec, registry, folder, where)
        _check_truth(case, where)
        return case
    if entry.records is not None:
        raise ArmidError(f"{where}: 'records' are files of a campaign, and no campaign is given")
    space = _space(model, {}, spec, entry, where)
    case = Case(entry.name, model, space, dict(entry.truth), dict(entry.published))
    return _simulated_case(case, entry.manoeuvres, spec, folder, where)


def _space(
    model: Model, overrides: Mapping[str, Override], spec: StudySpec, entry: CaseSpec, where: str
) -> Space:  # fmt: skip
    """Return bounds and fixed values; what the case fixes or frees holds against what the study says."""
    fixed = {name: v for name, v in spec.fixed.items() if name not in entry.bounds} | dict(entry.fixed)
    bounds = {name: b for name, b in spec.bounds.items() if name not in entry.fixed} | dict(entry.bounds)
    with located(where):
        warn_of_far(model.parameters, fixed, bounds)
        return space_of(model, overrides, bounds, fixed)


def _campaign_case(
    entry: CaseSpec, folder_name: str, spec: StudySpec, registry: StudyRegistry, folder: Path, where: str
) -> Case:
    path = campaign_folder(folder, folder_name, where)
    campaign = _with_records(read_campaign(path, registry.plants, registry.effects), entry.records, where)
    if campaign.plant.name not in {v.name for v in registry.plants[spec.plant].variants} | {spec.plant}:
        raise ArmidError(f"{where}: the campaign is of plant '{campaign.plant.name}', '{spec.plant}' is expected")
    declared = campaign.model(registry.effects)
    there = {effect.name for effect in declared.effects}
    further = [text for text in dict.fromkeys(spec.effects) if effect_name(text) not in there]
    model = registry.with_effects(declared, further, where)
    space = _space(model, campaign.parameters, spec, entry, where)
    for window in spec.windows_s:
        if not isinstance(window, str):
            for record in campaign.records:
                with_window(record, window, f"{where}, windows_s")
    files = tuple(r.file for r in campaign.records)
    source = {"campaign": folder_name, "records": files, "digest": digest_of(path, (CAMPAIGN_FILE, *files))}
    return Case(entry.name, model, space, dict(entry.truth), dict(entry.published), (), source, campaign.angle)


def campaign_folder(folder: Path, campaign: str, where: str) -> Path:
    """Return where the campaign of a study is; refuse one outside the folder of its file, also through a link."""
    path = folder / campaign.replace("\\", "/")
    # of a text with a null byte no path can be resolved
    if not campaign.isprintable() or not all(
        each.resolve().is_relative_to(folder.resolve()) for each in (path, path / CAMPAIGN_FILE)
    ):
        raise ArmidError(f"{where}: campaign {quoted(campaign)} leads out of the folder of the study, a folder inside "
                         "is expected")  # fmt: skip
    with located(where):
        toml = campaign_path(path)
    if toml.name != CAMPAIGN_FILE:
        raise ArmidError(
            f"{where}: campaign {quoted(campaign)} is a file: a folder that holds {CAMPAIGN_FILE} is expected"
        )
    return toml.parent


def _with_records(campaign: Campaign, files: Sequence[str] | None, where: str) -> Campaign:
    if files is None:
        return campaign
    known = [r.file for r in campaign.records]
    for file in files:
        if file not in known:
            raise unknown_name("record", file, known, where)
    some = replace(campaign, records=tuple(r for r in campaign.records if r.file in files))
    if not some.train:
        raise ArmidError(f"{where}: none of the records {', '.join(files)} has the role 'train'")
    return some


def unchanged_campaign(folder: Path, files: Iterable[str], digest: str, name: str, registry: StudyRegistry) -> Campaign:
    """Read a campaign whose files are still those that were hashed; name: as the study calls it."""
    if digest_of(folder, files) != digest:
        raise ArmidError(f"campaign {name} has changed since the study was started: start it again")
    return read_campaign(folder, registry.plants, registry.effects)


def digest_of(folder: Path, files: Iterable[str]) -> str:
    digest = hashlib.sha256()
    for name in files:
        content = (folder / name).read_bytes()
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def _simulated_case(
    case: Case, manoeuvres: Sequence[Mapping[str, Any]], spec: StudySpec, folder: Path, where: str
) -> Case:
    """Return a case with manoeuvres to simulate, and with the true value of every parameter."""
    plant = case.model.plant
    strokes = tuple(_stroke(m, spec, plant, folder, f"{where}, manoeuvre {i + 1}") for i, m in enumerate(manoeuvres))
    if not any(s["role"] == "train" for s in strokes):
        raise ArmidError(f"{where}: no manoeuvre has the role 'train', at least one is expected")
    case = replace(case, truth=_completed(case.truth, case.model, where), strokes=strokes)
    _check_truth(case, where)
    return case


def _stroke(table: Mapping[str, Any], spec: StudySpec, plant: Plant, folder: Path, where: str) -> dict[str, Any]:
    manoeuvre = validated(ManoeuvreSpec, table, where, [key.key for key in plant.keys])
    record = RecordSheet(file="", role=manoeuvre.role, constants=manoeuvre.constants, keys=manoeuvre.keys)
    constants = record_constants(plant, spec.constants, record, where)
    if not FEWEST_SAMPLES - 1 <= manoeuvre.duration_s / spec.interval_s <= MOST_SIMULATED:
        raise ArmidError(f"{where}: duration_s is {manoeuvre.duration_s:g}, {FEWEST_SAMPLES} to {MOST_SIMULATED} "
                         f"samples of {spec.interval_s:g} s are expected")  # fmt: skip
    times = spec.interval_s * np.arange(round(manoeuvre.duration_s / spec.interval_s) + 1, dtype=np.float64)
    inputs = inputs_of(manoeuvre.inputs, plant, folder, times, where)
    # a plant without inputs keeps the settings, and with them the runs, that it had
    driven = {"inputs": inputs} if plant.inputs else {}
    return {"constants": constants, "duration_s": manoeuvre.duration_s, "role": manoeuvre.role, **driven}


def _completed(truth: Mapping[str, float], model: Model, where: str) -> dict[str, float]:
    """Return the true value of every parameter: an effect's that is not given is its null value."""
    for name in truth:
        if name not in model.parameters:
            raise unknown_name("parameter of the truth", name, model.parameters, where)
    known = {name: p.null for name, p in model.parameters.items()} | dict(truth)
    for name, value in known.items():
        if value is None:
            raise ArmidError(f"{where}: the truth does not tell '{name}', a value in SI is expected")
    return {name: float(value) for name, value in known.items() if value is not None}


def _check_truth(case: Case, where: str) -> None:
    """Refuse a truth that the search cannot find, and published values of what is not in the model."""
    for name in (*case.truth, *case.published):
        if name not in case.space.names:
            raise unknown_name("parameter", name, case.space.names, where)
    for name, (low, high) in case.bounds.items():
        value = case.truth.get(name)
        if value is not None and not low <= value <= high:
            raise ArmidError(f"{where}: the truth of '{name}' is {value:.10g}, outside its bounds {low:g} to {high:g}")
    if not case.bounds:
        raise ArmidError(f"{where}: every parameter is fixed, at least one that is searched is expected")


def _random_cases(spec: StudySpec, model: Model, folder: Path, where: str) -> list[Case]:
    """Return n cases whose truths are a Latin hypercube over the bounds, a margin kept free at each side.

    Written out, as the points that a library draws from a seed change between its versions, and with them the cases.
    Source: McKay, Beckman, Conover 1979, doi:10.2307/1268522.
    """
    wanted = validated(RandomCasesSpec, spec.random_cases, where)
    if wanted.margin >= 0.5:
        raise ArmidError(f"{where}: margin is {wanted.margin:g}, a share of the range from 0 to below 0.5 is expected")
    space, n = _space(model, {}, spec, CaseSpec(name="random"), where), wanted.n
    rng = np.random.default_rng(wanted.seed)
    low, high = space.low[space.free], space.high[space.free]
    parts = np.array([rng.permutation(n) for _ in low]).T
    points = (parts + rng.random(parts.shape)) / n
    whole = space.complete(low + (high - low) * (wanted.margin + (1.0 - 2.0 * wanted.margin) * points))
    truths = [dict(zip(space.names, row.tolist(), strict=True)) for row in whole]
    first = _simulated_case(Case("", model, space, truths[0]), wanted.manoeuvres, spec, folder, where)
    return [replace(first, name=f"random {i:0{len(str(n))}d}", truth=truth) for i, truth in enumerate(truths, 1)]


def clean_records(settings: Mapping[str, Any], model: Model) -> tuple[Record, ...]:
    """Return the records of a simulated case over their whole length, without noise; refuse one without a motion."""
    truth = np.array([settings["truth"][name] for name in model.parameters])[np.newaxis]
    interval, records = settings["interval_s"], []
    for i, stroke in enumerate(settings["strokes"], 1):
        name, n_samples = f"manoeuvre {i}", round(stroke["duration_s"] / interval) + 1
        times, given = interval * np.arange(n_samples), stroke.get("inputs", {})
        inputs = {each.name: input_values(given[each.name], times) if each.name in given else
                  np.full(n_samples, each.default) for each in model.plant.inputs}  # fmt: skip
        manoeuvre = Manoeuvre(interval, n_samples, stroke["constants"], inputs)
        coarse = calibrate(model, manoeuvre, truth, FINE, spans=False).schedule
        run = simulate(model, manoeuvre, truth, Schedule(FINER_TRUTH * coarse.substeps))
        if run.failed[0]:
            raise ArmidError(f"{name}: the simulation diverges at the truth, a motion is expected")
        if is_constant(run.output[0]):
            raise ArmidError(f"{name}: the machine does not move at the truth, a motion is expected")
        records.append(made_record(name, stroke["role"], manoeuvre, model.plant.outputs[0], run.output[0], 0.0))
    return tuple(records)


def in_window(record: Record, window: Sequence[float] | str) -> Record:
    """Return the record in a window [s]; the word for the whole record keeps the window of its file."""
    if isinstance(window, str):
        return record
    return with_window(record, (float(window[0]), float(window[1])), f"{record.file}, windows_s")


def noise_rms(settings: Mapping[str, Any], unit: str) -> float:
    """Return the noise of a run, SI: `noise_deg_s` holds the level in the unit of the study's key, see `NOISES`."""
    return float(SUFFIXES[unit][NOISES[unit]] * settings["noise_deg_s"])


def noisy_records(records: Sequence[Record], settings: Mapping[str, Any]) -> tuple[Record, ...]:
    """Return the records with white noise of the gyro added, of an rms that is known and need not be estimated.

    The same study seed, case, level and seed give the same noise for every identifier, fitness and window.
    """
    words = "\0".join(str(settings[word]) for word in ("noise_seed", "case", "noise_deg_s", "seed"))
    rng = np.random.default_rng(np.frombuffer(hashlib.sha256(words.encode()).digest(), dtype="<u4"))
    noisy = []
    for record in records:
        (signal,) = record.signals
        rms = noise_rms(settings, signal.unit)
        measured = signal.measured + rms * rng.standard_normal(signal.measured.size)
        signal = replace(signal, measured=measured, noise=replace(signal.noise, rms=rms))
        noisy.append(replace(record, signals=(signal,)))
    return tuple(noisy)


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
        self._kept: dict[str, Any] = {}

    def replays(self, settings: Mapping[str, Any]) -> tuple[PreparedCase, tuple[Replay, ...]]:
        """Return the case of a run, and its records with the run's own noise, ready to be simulated."""
        shared = {word: settings[word] for word in SHARED if word in settings}
        level = settings["noise_deg_s"] or 0.0
        case = self._once("case", shared | {"noise": level}, lambda: self._prepared(settings, level))
        if level == 0.0:
            return case, case.replays
        # on the schedules of the records without noise: the manoeuvres are the same
        noisy = (in_window(r, settings["window_s"]) for r in noisy_records(case.records, settings))
        return case, tuple(r.changed(record=n.until_window_end()) for r, n in zip(case.replays, noisy, strict=True))

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
        if source := settings.get("campaign"):
            campaign = self._once("campaign", source, lambda: self._campaign(**source))
            model = self.registry.with_effects(Model(campaign.plant), settings["effects"], "settings")
            return model, tuple(r for r in campaign.records if r.file in source["records"])
        model = self.registry.model(settings["plant"], settings["effects"], "settings")
        parts = {word: settings[word] for word in ("plant", "effects", "truth", "strokes", "interval_s")}
        return model, self._once("clean", parts, lambda: clean_records(settings, model))

    def _campaign(self, campaign: str, records: Sequence[str], digest: str) -> Campaign:
        path = campaign_folder(self.folder, campaign, "settings")
        return unchanged_campaign(path, (CAMPAIGN_FILE, *records), digest, campaign, self.registry)

    def _once(self, what: str, of: Mapping[str, Any], make: Callable[[], Any]) -> Any:
        key = what + json.dumps(of, sort_keys=True)
        # what was asked for last stands last
        self._kept[key] = self._kept.pop(key) if key in self._kept else make()
        if len(self._kept) > MOST_KEPT:
            del self._kept[next(iter(self._kept))]
        return self._kept[key]
