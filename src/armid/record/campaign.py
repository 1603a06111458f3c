"""The records of one machine, each to train on or to hold out."""

import os.path
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from armid.errors import ArmidError, nearest, shown
from armid.model import EFFECTS, PLANTS, Effect, Model, Parameter, Plant
from armid.model.parameter import resolve
from armid.record.pieces import with_window
from armid.record.reader import Shared, campaign_path, folder_name, gravity_of, load_toml, read_record, record_path
from armid.record.record import Record
from armid.record.schema import CampaignSheet, Override, RecordSheet, unknown_name, validated
from armid.record.table import DEGREE


def overrides_of(
    tables: Mapping[str, Mapping[str, Any]], plant: Plant, effects: Mapping[str, Effect], where: str
) -> dict[str, Override]:
    """Return qualified parameter name (`p0`, `coulomb.level`) -> Override.

    tables: [parameters] of the file; an effect's parameter is written [parameters."coulomb.level"] or
    [parameters.coulomb.level]. plant: with its scales set. effects: all that are known, used or not.

    Raises ArmidError for an unknown parameter, an unknown key, bounds of which low is not below high, and bounds of a
    parameter that is fixed.
    """
    known = known_parameters(plant, effects)
    overrides = {}
    for name, table in flattened(tables).items():
        if name not in known:
            raise unknown_name("parameter", name, known, where)
        overrides[name] = validated(Override, table, f"{where}, parameters.{name}")
        check_bounds(overrides[name], resolve(known[name], plant.scales), f"{where}, parameters.{name}")
    return overrides


def known_parameters(plant: Plant, effects: Mapping[str, Effect]) -> dict[str, Parameter]:
    """Return qualified name -> declaration, of the plant and of every known effect."""
    own = {p.name: p for p in plant.parameters}
    return own | {f"{e.name}.{p.name}": p for e in effects.values() for p in e.parameters}


def flattened(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, object]:
    """Return qualified name -> table, also where the name was written as nested tables."""
    flat: dict[str, object] = {}
    for name, table in tables.items():
        inner = {key: value for key, value in table.items() if isinstance(value, dict)}
        for key, value in inner.items():
            flat[f"{name}.{key}"] = value
        if len(inner) < len(table) or not table:
            flat[name] = {key: value for key, value in table.items() if key not in inner}
    return flat


def check_bounds(override: Override, declared: Parameter, where: str) -> None:
    """Refuse bounds that leave nothing between them, and bounds beside a fixed value, which would not count.

    The declared bound (SI) stands for one that is not given.
    """
    if override.fixed is not None and (override.low, override.high) != (None, None):
        raise ArmidError(f"{where}: 'fixed' and a bound are both there, a fixed value or bounds are expected")
    low = declared.low if override.low is None else override.low
    high = declared.high if override.high is None else override.high
    if not low < high:
        raise ArmidError(f"{where}: low is {low:g} and high is {high:g}, low below high is expected")


@dataclass(frozen=True, eq=False)
class Campaign:
    """Hold the records of one machine and what is declared of it.

    folder: where campaign.toml lies. plant: the sibling for the records' unit; an axis has its scales set from the
    train records. effects: names of those declared beforehand. parameters: qualified name -> Override. constants: those
    of the campaign, SI; each record's manoeuvre holds all that apply to it. gyro_range: [rad/s], None when not given.
    """

    name: str
    folder: Path
    plant: Plant
    effects: tuple[str, ...]
    records: tuple[Record, ...]
    parameters: Mapping[str, Override]
    constants: Mapping[str, float]
    gyro_range: float | None = None

    @property
    def train(self) -> tuple[Record, ...]:
        """Records that an identification sees."""
        return tuple(r for r in self.records if r.role == "train")

    @property
    def holdout(self) -> tuple[Record, ...]:
        """Records that judge it."""
        return tuple(r for r in self.records if r.role == "holdout")

    @property
    def unit(self) -> str:
        """Unit of the recorded speed, "rad/s" or "m/s"."""
        return self.plant.output_unit

    def model(self, effects: Mapping[str, Effect] = EFFECTS) -> Model:
        """Return the declared model, the plant with the effects of the campaign; effects: name -> those known.

        Raises ArmidError where they do not compose.
        """
        model = Model(self.plant)
        for name in self.effects:
            model = model + effects[name]
        return model

    def with_window(self, begin: float, end: float) -> "Campaign":
        """Return the campaign with one window [s] for every record, whatever its file says; both ends count.

        Raises ArmidError for a window that is empty, runs backward, or holds fewer than 20 samples of a record.
        """
        records = (with_window(r, (begin, end), f"window {begin:g}:{end:g}") for r in self.records)
        return replace(self, records=tuple(records))


def read_campaign(
    path: str | Path, plants: Mapping[str, Plant] = PLANTS, effects: Mapping[str, Effect] = EFFECTS
) -> Campaign:
    """Read a campaign: a folder with campaign.toml and one CSV file a record, or that campaign.toml.

    plants, effects: name -> those that the file may name. Warns with IrregularSamplingWarning for a record that is
    resampled for its uneven times.

    Raises ArmidError with one sentence (file, line or key, found, expected) for whatever cannot be used.
    """
    toml = campaign_path(path)
    folder = folder_name(toml)
    where = f"{folder}{toml.name}"
    sheet = validated(CampaignSheet, load_toml(toml, where), where)
    if sheet.plant not in plants:
        raise unknown_name("plant", sheet.plant, plants, where)
    check_effects(sheet.effects, effects, where)
    keys = [key.key for key in plants[sheet.plant].keys]
    entries = [validated(RecordSheet, entry, place(entry, i, where), keys) for i, entry in enumerate(sheet.records)]
    check_entries(entries, where)
    gyro_range = None if sheet.gyro_range_deg_s is None else sheet.gyro_range_deg_s * DEGREE
    shared = Shared(folder, sheet.constants, sheet.inputs, sheet.hold, gyro_range)
    places = [f"{where}, record {shown(entry.file)}" for entry in entries]
    paths = [record_path(toml.parent, entry.file, at) for entry, at in zip(entries, places, strict=True)]
    records = [
        read_record(file, entry, plants[sheet.plant], shared, at)
        for file, entry, at in zip(paths, entries, places, strict=True)
    ]
    check_units(records, folder)
    plant = scaled(plants[sheet.plant].for_unit(records[0].unit), records, where)
    return Campaign(
        name=sheet.name,
        folder=toml.parent,
        plant=plant,
        effects=tuple(sheet.effects),
        records=tuple(records),
        parameters=overrides_of(sheet.parameters, plant, effects, where),
        constants=dict(sheet.constants),
        gyro_range=gyro_range,
    )


def place(entry: Mapping[str, object], index: int, where: str) -> str:
    """Return how messages name a [[records]] entry: by its file where it has one."""
    file = entry.get("file")
    return f"{where}, record {shown(file) if isinstance(file, str) else index + 1}"


def check_effects(names: Sequence[str], effects: Mapping[str, Effect], where: str) -> None:
    """Refuse an effect that nobody registered, and one that is declared twice."""
    for i, name in enumerate(names):
        if name not in effects:
            raise unknown_name("effect", name, effects, where)
        if name in names[:i]:
            raise ArmidError(f"{where}: effect '{name}' is declared twice, each effect once is expected")


def check_entries(entries: Sequence[RecordSheet], where: str) -> None:
    """Refuse a file that is named twice, a repeat of nothing, and a campaign without a record to train on."""
    files = [os.path.normpath(entry.file) for entry in entries]
    for i, entry in enumerate(entries):
        if files[i] in files[:i]:
            raise ArmidError(f"{where}: file {shown(entry.file)} is in two records, each file once is expected")
        others = [other.file for other in entries if other.file != entry.file]
        if entry.repeat_of is not None and entry.repeat_of not in others:
            raise ArmidError(f"{where}, record {shown(entry.file)}: repeat_of {shown(entry.repeat_of)} is no file of "
                             f"another record, {nearest(entry.repeat_of, others)}")  # fmt: skip
    if not any(entry.role == "train" for entry in entries):
        raise ArmidError(f"{where}: no record has the role 'train', at least one is expected")


def check_units(records: Sequence[Record], folder: str) -> None:
    """Refuse records of which one tells an angular and one a linear speed."""
    for record in records:
        if record.unit != records[0].unit:
            raise ArmidError(f"{folder}{record.file}: the speed is in {record.unit}, {records[0].unit} is expected "
                             f"as in {records[0].file}")  # fmt: skip


def scaled(plant: Plant, records: Sequence[Record], where: str) -> Plant:
    """Return the plant with the sizes of effort and speed that its train records show, where it asks for that.

    Effort = max |gain x drive|, the moment of gravity where the drive rests, and speed = max |measured speed|; a
    holdout record has no say.
    """
    if not plant.scales_from_records:
        return plant
    train = [r for r in records if r.role == "train"]
    speed = max(float(np.max(np.abs(r.measured))) for r in train)
    effort = max(drive_effort(plant, r) for r in train) or max(abs(gravity_of(plant, r.constants)) for r in train)
    if effort < 1e-30:
        raise ArmidError(f"{where}: the drive of every train record is 0 throughout, a driven motion is expected")
    return replace(plant, scales=replace(plant.scales, effort=effort, speed=speed))


def drive_effort(plant: Plant, record: Record) -> float:
    """Return the largest |gain x drive| of a record [N or N m], the drive being the plant's first input."""
    if not plant.inputs:
        return 0.0
    default = {c.name: c.value for c in plant.constants}.get("gain", 1.0)
    drive = record.manoeuvre.inputs[plant.inputs[0].name]
    return abs(record.constants.get("gain", default)) * float(np.max(np.abs(drive)))
