"""The records of one machine, each to train on or to hold out."""

import os.path
import re
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armid.errors import ArmidError, DataError, caused_by, located, nearest, quoted
from armid.model import EFFECTS, PLANTS, Array, Effect, Model, Output, Parameter, Plant, effect_name, effect_named
from armid.model.effects.sensor import sensor_effects
from armid.model.parameter import resolve, warn_if_far
from armid.record.reader import CAMPAIGN_FILE, CSV_SUFFIX, campaign_path, gravity_of, record_of, record_path
from armid.record.record import Record, RecordWarning
from armid.record.resample import with_window
from armid.record.schema import CampaignSheet, Known, Override, RecordSheet, load_toml, unknown_name, validated
from armid.record.table import CsvTable, read_table, table_of, write_table
from armid.report.result import NewFiles, Shown
from armid.units import DEG, DEGREE, angle_of

if TYPE_CHECKING:
    from pandas import DataFrame

    from armid.report.document import Document

# Records of each role that a campaign's repr names.
MOST_RECORDS_NAMED = 8
# What [tolerances] of a file says of every constant that it does not name.
DEFAULT_TOLERANCE = "default"
# From this tolerance on, where 0 is within four deviations, a value is one to be found rather than one that is known.
ROUGH = 0.25


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(Shown):
    """Hold the records of one machine and what is declared of it.

    folder: where campaign.toml lies. plant: the sibling for the records' unit, with the outputs that some record
    holds; an axis has its scales set from the train records. unmeasured: its other outputs. effects: names of those
    declared beforehand. parameters: qualified name -> Override. constants: those of the campaign, SI; each record's
    manoeuvre holds all that apply to it. gyro_range: [rad/s], None when not given. tolerances: constant -> relative
    standard deviation. rough: those of a quarter or more, with parameters of the plant that are fixed.
    chances: effect -> its probability before the records. known: parameter of the plant -> what is known of it before.
    taken_as_exact: constants for which neither the plant nor the campaign says how well they are known. angle: deg, rad
    or rpm, in which results show angles and turning speeds. truth: true values of parameters, for figures alone.
    """

    name: str
    folder: Path
    plant: Plant
    effects: tuple[str, ...]
    records: tuple[Record, ...]
    parameters: Mapping[str, Override]
    constants: Mapping[str, float]
    gyro_range: float | None = None
    unmeasured: tuple[Output, ...] = ()
    tolerances: Mapping[str, float] = field(default_factory=dict)
    rough: Mapping[str, float] = field(default_factory=dict)
    taken_as_exact: tuple[str, ...] = ()
    chances: Mapping[str, float] = field(default_factory=dict)
    known: Mapping[str, Known] = field(default_factory=dict)
    angle: str = DEG
    truth: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        named = {role: [r.file for r in self.records if r.role == role] for role in ("train", "holdout")}
        shown = {role: files[:MOST_RECORDS_NAMED] + ["..."] * (len(files) > MOST_RECORDS_NAMED)
                 for role, files in named.items()}  # fmt: skip
        records = "; ".join(f"{len(named[role])} {role}: {', '.join(files)}" for role, files in shown.items())
        return f"<Campaign {self.name} of {self.plant.name} [{self.unit}]; {records}>"

    def document(self) -> "Document":
        """Return what a notebook shows of it: one line for each output of each record."""
        from armid.report.document import Document, Section, table

        rows = [(r.file, r.role, own.output or self.plant.output, own.unit, len(own.measured),
                 f"{(len(own.measured) - 1) * r.manoeuvre.interval:.4g}", f"{own.noise.rms:.3g}")
                for r in self.records for own in r.signals]  # fmt: skip
        headers = ("record", "role", "output", "unit", "samples", "duration [s]", "noise, rms [unit]")
        main = table("Records", headers, rows)
        return Document(self.name, "Campaign", "What was recorded?", (repr(self),), (Section("Records", (main,)),),
                        main=(main,))  # fmt: skip

    @property
    def fixed_as_exact(self) -> tuple[str, ...]:
        """Parameters that the campaign fixes, but at 0 or where it says how well it knows them."""
        return tuple(n for n, one in self.parameters.items() if one.fixed and "." not in n and n not in self.rough)

    @property
    def train(self) -> tuple[Record, ...]:
        """Records that an identification sees."""
        return tuple(r for r in self.records if r.role == "train")

    @property
    def holdout(self) -> tuple[Record, ...]:
        """Records that judge it."""
        return tuple(r for r in self.records if r.role == "holdout")

    @property
    def declared(self) -> Plant:
        """The plant with the outputs that no record holds, too."""
        return replace(self.plant, outputs=(*self.plant.outputs, *self.unmeasured))

    @property
    def unit(self) -> str:
        """Unit of the first output that was measured, of a speed "rad/s" or "m/s"."""
        return self.plant.output_unit

    def model(self, effects: Mapping[str, Effect] | None = None) -> Model:
        """Return the declared model, the plant with the effects of the campaign; effects: name -> those known,
        None: armid.EFFECTS.

        Raises ModelError where they do not compose.
        """
        known = {**sensor_effects(self.declared), **(EFFECTS if effects is None else effects)}
        return Model(self.plant, tuple(effect_named(text, known, self.plant) for text in self.effects))

    @caused_by(DataError)
    def with_window(self, begin: float, end: float) -> "Campaign":
        """Return the campaign with one window [s] for every record, whatever its file says; both ends count.

        Raises DataError for a window that is empty, runs backward, or holds fewer than 20 samples of a record. Warns
        where it ends after all records, as milliseconds do.
        """
        records = tuple(with_window(r, (begin, end), f"window {begin:g}:{end:g}") for r in self.records)
        last = max((r.manoeuvre.start_time + r.manoeuvre.interval * r.measured.size for r in self.records), default=end)
        if end > last:
            warnings.warn(f"window {begin:g}:{end:g}: the longest record ends at {last:.4g} s, a window in seconds is "
                          "expected", RecordWarning, stacklevel=2)  # fmt: skip
        return replace(self, records=records)


@caused_by(DataError)
def read_campaign(
    path: str | Path, plants: Mapping[str, Plant] | None = None, effects: Mapping[str, Effect] | None = None
) -> Campaign:
    """Read a campaign: a folder with campaign.toml and one CSV file a record, or that campaign.toml.

    Parameters
    ----------
    path : str or Path
        The folder or the file.
    plants, effects : Mapping, optional
        Name -> those that the file may name; None: armid.PLANTS and armid.EFFECTS.

    Returns
    -------
    Campaign

    Warns
    -----
    RecordWarning
        Of what was assumed to read a file, and of samples that are no data. IrregularSamplingWarning, one of its kind:
        for a record that is resampled for its uneven times.

    Raises
    ------
    DataError
        One sentence (file, line or key, found, expected) for whatever cannot be used.
    """
    toml = campaign_path(path)
    above = toml.parent.name or toml.parent.resolve().name
    # what messages put before the files of the campaign: c00/
    folder = f"{above if above.isprintable() else quoted(above)}/" if above else ""
    where = f"{folder}{toml.name}"

    def source(file: str, at: str, named: Collection[str]) -> Callable[[float | None], CsvTable]:
        return partial(read_table, record_path(toml.parent, file, at, named), f"{folder}{file}")

    return campaign_of(load_toml(toml, where), source, toml.parent, where, plants, effects)


@caused_by(DataError)
def campaign_of_tables(
    plant: str, tables: Mapping[str, "DataFrame"], plants: Mapping[str, Plant], effects: Mapping[str, Effect]
) -> Campaign:
    """Return the campaign of tables of pandas, each with its name; their `attrs` hold the keys of [[records]]."""
    files = {f"{name}.csv": table for name, table in tables.items()}
    records = [{"role": "train", **as_toml(dict(table.attrs)), "file": file} for file, table in files.items()]
    sheet = {"name": "tables", "plant": plant, "records": records}
    return campaign_of(sheet, lambda file, *_: partial(table_of, files[file], file), Path("tables"), "tables", plants,
                       effects)  # fmt: skip


def as_toml(value: Any) -> Any:
    """Return a value with the types that a TOML file gives."""
    if isinstance(value, Mapping):
        return {str(key): as_toml(inner) for key, inner in value.items()}
    return [*map(as_toml, value)] if isinstance(value, list | tuple) else getattr(value, "item", lambda: value)()


def refuse_effects(texts: Sequence[str], known: Mapping[str, Effect], where: str) -> None:
    """Refuse effects, NAME or NAME:FORM, that are unknown, and one that is given twice."""
    names = [*map(effect_name, texts)]
    for i, (name, text) in enumerate(zip(names, texts, strict=True)):
        if name not in known:
            raise unknown_name("effect", text, known, where)
        if name != text:
            with located(where):
                known[name].in_form(text.partition(":")[2])
        if name in names[:i]:
            raise ArmidError(f"{where}: effect '{name}' is declared twice, each effect once is expected")


def campaign_of(
    given: Mapping[str, Any], source: Callable[[str, str, Collection[str]], Callable[[float | None], CsvTable]],
    folder: Path, where: str, plants: Mapping[str, Plant] | None, effects: Mapping[str, Effect] | None,
) -> Campaign:  # fmt: skip
    """Return a campaign; given: what campaign.toml holds. where: how messages name that.

    source: file, how messages name its entry, the files of all entries -> what reads its table, with the counts of a
    turn.
    """
    sheet, plants = validated(CampaignSheet, given, where), PLANTS if plants is None else plants
    if sheet.plant not in plants:
        raise unknown_name("plant", sheet.plant, plants, where)
    effects = {**sensor_effects(plants[sheet.plant]), **(EFFECTS if effects is None else effects)}
    refuse_effects(sheet.effects, effects, where)
    declared = plants[sheet.plant]
    chances, known = priors_of(sheet.priors, declared, effects, where)
    sheet = with_known_constants(sheet, known, declared, where)
    entries = record_entries(sheet.records, [key.key for key in declared.keys], where)
    places = [f"{where}, record {quoted(entry.file)}" for entry in entries]
    named = {entry.file for entry in entries}
    sources = [source(entry.file, at, named) for entry, at in zip(entries, places, strict=True)]
    records: list[Record] = []
    with warned_once():
        for read, entry, at in zip(sources, entries, places, strict=True):
            table = read(sheet.counts_per_turn)
            records.append(record_of(table, entry, sheet, declared, at))
            if declared.records_one_speed and records[-1].unit != records[0].unit:
                raise ArmidError(f"{table.file}: the speed is in {records[-1].unit}, {records[0].unit} is expected as "
                                 f"in {records[0].file}")  # fmt: skip
    recorded = {signal.output for record in records for signal in record.signals}
    whole = declared.for_unit(records[0].unit) if declared.records_one_speed else declared
    own = [{*e.constants, *(k.constant for k in declared.keys if k.key in e.keys)} for e in entries]
    for name in sheet.constants:
        if all(name in constants for constants in own):
            warnings.warn(f"{where}: constant '{name}' counts nowhere, since every record sets its own", stacklevel=2)
    train = [r for r in records if r.role == "train"]
    plant = scaled(with_sizes(whole.recording(recorded), train), train, where)
    parameters = with_free(overrides_of(sheet.parameters, plant, effects, where), known, plant, where)
    for name in sheet.truth:
        if name not in (names := named_parameters(plant, effects)):
            raise unknown_name("parameter", name, names, f"{where}, truth")
    held = ((p.name, parameters.get(p.name, Override()).fixed) for p in plant.parameters)
    fixed = {name: value for name, value in held if value is not None}
    tolerances = tolerances_of(sheet.tolerances, plant, where, fixed)
    for name in fixed.keys() & sheet.tolerances.keys():
        value, tolerance = fixed[name], sheet.tolerances[name]
        if value and 0.0 < tolerance < ROUGH:
            prior = f"[priors] {name} = {{ mean = {value:g}, sd = {abs(tolerance * value):g} }}"
            raise ArmidError(f"{where}, tolerances: '{name}' is a parameter that is fixed, and known to {tolerance:g}: "
                             f"{prior} in place of 'fixed' is expected")  # fmt: skip
    values = {c.name: c.value for c in plant.constants} | dict(sheet.constants) | fixed
    # of what is 0 in every record nothing is known by a share of it
    sized = {name for name, value in values.items() if any(r.constants.get(name, value) for r in records)}
    recorded_in = {angle_of(own.header) for r in records for own in r.signals if own.unit in ("rad", "rad/s")}
    return Campaign(
        name=sheet.name,
        folder=folder,
        plant=plant,
        effects=tuple(sheet.effects),
        records=tuple(records),
        parameters=parameters,
        constants=dict(sheet.constants),
        gyro_range=None if sheet.gyro_range_deg_s is None else sheet.gyro_range_deg_s * DEGREE,
        tolerances={name: t for name, t in tolerances.items() if name not in fixed and name in sized},
        rough={name: t for name, t in tolerances.items() if t >= ROUGH and name in sized},
        taken_as_exact=tuple(c.name for c in plant.constants if c.tolerance is None and c.name in sized
                             and not {c.name, DEFAULT_TOLERANCE} & {*sheet.tolerances, *set_by_records(plant)}),
        unmeasured=tuple(o for o in whole.outputs if o.name not in recorded),
        chances=chances,
        truth=dict(sheet.truth),
        angle=recorded_in.pop() if len(recorded_in) == 1 else DEG,
        known={name: one for name, one in known.items() if name in {p.name for p in plant.parameters}},
    )  # fmt: skip


@caused_by(DataError)
def write_campaign(out: str | Path, campaign_toml: str, tables: Mapping[str, Mapping[str, Array]]) -> Path:
    """Write campaign.toml and its CSV files, whole or not at all.

    Parameters
    ----------
    out : str or Path
        The new folder, in which nothing half-written is ever found.
    campaign_toml : str
        The text.
    tables : Mapping
        File -> header -> values, (n_rows,); every number is written with all its digits.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    DataError
        The folder holds something already, or cannot be written.
    """
    folder = Path(out)
    if os.path.lexists(folder) and not (folder.is_dir() and not any(folder.iterdir())):
        raise ArmidError(f"{quoted(str(out))} exists already, a new or empty folder is expected")
    try:
        with NewFiles(folder) as files:
            files.path(CAMPAIGN_FILE).write_text(campaign_toml, encoding="utf-8")
            for file, columns in tables.items():
                write_table(files.path(file), columns)
    except OSError as error:
        raise ArmidError(f"{quoted(str(out))} cannot be written: {error.strerror or error}") from error
    return folder


@contextmanager
def warned_once(kind: type[Warning] = RecordWarning) -> Iterator[None]:
    """Warn of what holds for several records once, with their names; numbers are those of the first."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", kind)
        yield
    alike: dict[str, list[tuple[str, str, type[Warning]]]] = {}
    for warning in caught:
        file, dot, said = str(warning.message).partition(f"{CSV_SUFFIX}: ")
        key = re.sub(r"\d[\d.e+-]*", "", said) if dot else file
        alike.setdefault(key, []).append((f"{file}{dot.removesuffix(': ')}", said, warning.category))
    for (first, said, category), *others in alike.values():
        names = [file.rpartition("/")[2] for file, _, _ in others]
        more = f" and {len(names) - MOST_RECORDS_NAMED} more" if len(names) > MOST_RECORDS_NAMED else ""
        if not said:
            sentence = first
        elif all(also == said for _, also, _ in others):
            sentence = f"{', '.join([first, *names[:MOST_RECORDS_NAMED]])}{more}: {said}"
        else:
            sentence = f"{first}: {said}; the same with other numbers: {', '.join(names[:MOST_RECORDS_NAMED])}{more}"
        warnings.warn(sentence, category, stacklevel=5)


def record_entries(tables: Sequence[Mapping[str, Any]], keys: Sequence[str], where: str) -> list[RecordSheet]:
    """Return the [[records]] entries; keys: those of the plant."""
    entries = []
    for i, table in enumerate(tables):
        file = table.get("file")
        place = f"{where}, record {quoted(file) if isinstance(file, str) else i + 1}"
        entries.append(validated(RecordSheet, table, place, keys))
    files = [os.path.normpath(entry.file) for entry in entries]
    for i, entry in enumerate(entries):
        if files[i] in files[:i]:
            raise ArmidError(f"{where}: file {quoted(entry.file)} is in two records, each file once is expected")
        others = [other.file for other in entries if other.file != entry.file]
        if entry.repeat_of is not None and entry.repeat_of not in others:
            raise ArmidError(f"{where}, record {quoted(entry.file)}: repeat_of {quoted(entry.repeat_of)} is not a file "
                             f"of another record, {nearest(entry.repeat_of, others)}")  # fmt: skip
    repeats = {entry.file: entry.repeat_of for entry in entries if entry.repeat_of is not None}
    entries = [replace(e, repeat_of=original_of(e.file, repeats, where)) if e.file in repeats else e for e in entries]
    if not any(entry.role == "train" for entry in entries):
        raise ArmidError(f"{where}: no record has the role 'train', at least one is expected")
    return entries


def original_of(file: str, repeats: Mapping[str, str], where: str) -> str:
    """Return the record that one repeats in the end. Raises ArmidError where repeats go in a circle."""
    seen = [file]
    while seen[-1] in repeats:
        seen.append(repeats[seen[-1]])
        if seen[-1] in seen[:-1]:
            raise ArmidError(f"{where}: repeat_of goes in a circle, {', '.join(map(quoted, seen))}: one of them is "
                             "expected to repeat none")  # fmt: skip
    return seen[-1]


def with_sizes(plant: Plant, train: Sequence[Record]) -> Plant:
    """Return the plant whose outputs that are no motion have the largest value that its train records hold."""
    largest: dict[str, float] = {}
    for signal in (s for r in train for s in r.signals if s.unit in ("N", "N m", "A", "V")):
        largest[signal.output] = max(largest.get(signal.output, 0.0), float(np.max(np.abs(signal.measured))))
    outputs = tuple(replace(o, size=largest.get(o.name, 0.0)) for o in plant.outputs)
    return replace(plant, output="", output_unit="", outputs=outputs) if largest else plant


def scaled(plant: Plant, train: Sequence[Record], where: str) -> Plant:
    """Return the plant with the sizes of effort and speed that its train records show, where it asks for that.

    Effort = max |gain x drive| of the first input, or the moment of gravity where the drive rests.
    Speed = max |measured speed|, or of the change of a position over a hundredth of the record.
    """
    if not plant.scales_from_records:
        return plant
    speed = max(map(largest_speed, (one for r in train for one in r.each)))
    if speed == 0.0:
        raise ArmidError(f"{where}: no train record holds a speed or a position, from which the scale of speed comes: "
                         "one of them, or a plant that states its scales, is expected")  # fmt: skip
    default = {c.name: c.value for c in plant.constants}.get("gain", 1.0)
    effort = 0.0
    for r in train if plant.inputs else ():
        drive = float(np.max(np.abs(r.manoeuvre.inputs[plant.inputs[0].name])))
        effort = max(effort, abs(r.constants.get("gain", default)) * drive)
    effort = effort or max(abs(gravity_of(plant, r.constants)) for r in train)
    if effort < 1e-30:
        raise ArmidError(f"{where}: the drive of every train record is 0 throughout, a driven motion is expected")
    return replace(plant, scales=replace(plant.scales, effort=effort, speed=speed))


def tolerances_of(given: Mapping[str, float], plant: Plant, where: str, fixed: Iterable[str] = ()) -> dict[str, float]:
    """Return the tolerance of each constant above 0: what the campaign tells, by name or as `default`, else the plant.

    What the plant declares as exact, or a record sets (start, target, load), keeps 0 unless it is named. fixed:
    parameters of the plant that the campaign fixes, which are constants then.
    """
    declared = {**dict.fromkeys(fixed), **{c.name: c.tolerance for c in plant.constants}}
    for name in given:
        if name not in declared and name != DEFAULT_TOLERANCE:
            raise unknown_name("constant", name, [*declared, DEFAULT_TOLERANCE], f"{where}, tolerances")
    of_records, tolerances = set_by_records(plant), {}
    for name, usual in declared.items():
        otherwise = 0.0 if usual == 0.0 or name in of_records else given.get(DEFAULT_TOLERANCE, usual or 0.0)
        tolerances[name] = given.get(name, otherwise)
    return {name: tolerance for name, tolerance in tolerances.items() if tolerance > 0.0}


def priors_of(
    priors: Mapping[str, Any], plant: Plant, effects: Mapping[str, Effect], where: str
) -> tuple[dict[str, float], dict[str, Known]]:
    """Return the probabilities of effects, and what is known of parameters and constants, before the records."""
    chances, known = dict[str, float](), dict[str, Known]()
    values = {*(p.name for p in plant.parameters), *(c.name for c in plant.constants)}
    for name, prior in priors.items():
        if isinstance(prior, float):
            if name not in effects:
                raise unknown_name("effect", name, effects, f"{where}, priors")
            chances[name] = prior
        elif name not in values:
            raise unknown_name("parameter or constant", name, values, f"{where}, priors")
        else:
            known[name] = validated(Known, prior, f"{where}, priors.{name}")
    return chances, known


def with_known_constants(
    sheet: CampaignSheet, known: Mapping[str, Known], plant: Plant, where: str
) -> CampaignSheet:  # fmt: skip
    """Return a sheet whose known constants have the mean as value and the standard deviation as tolerance."""
    constants, tolerances = dict(sheet.constants), dict(sheet.tolerances)
    for name in known.keys() & {c.name for c in plant.constants}:
        one = known[name]
        if name in constants or name in tolerances:
            raise ArmidError(f"{where}: constant '{name}' stands in priors and in constants or tolerances, one place "
                             "is expected")  # fmt: skip
        if one.mean == 0.0:
            raise ArmidError(f"{where}, priors.{name}: a mean other than 0 is expected of a constant")
        constants[name], tolerances[name] = one.mean, one.sd / abs(one.mean)
    return replace(sheet, constants=constants, tolerances=tolerances)


def set_by_records(plant: Plant) -> set[str]:
    return {*plant.start_constants.values(), *(key.constant for key in plant.keys)}


def largest_speed(record: Record) -> float:
    """Return the largest speed that a record of a speed or a position shows, SI, 0 for another output."""
    if record.signals[0].is_speed:
        return float(np.max(np.abs(record.measured)))
    if record.unit not in ("rad", "m"):
        return 0.0
    lag = max(record.measured.size // 100, 1)
    return float(np.max(np.abs(record.measured[lag:] - record.measured[:-lag]))) / (lag * record.manoeuvre.interval)


def overrides_of(
    tables: Mapping[str, Mapping[str, Any]], plant: Plant, effects: Mapping[str, Effect], where: str
) -> dict[str, Override]:
    """Return qualified parameter name (`p0`, `coulomb.level`) -> Override; an effect's name may be quoted or nested."""
    known, overrides = named_parameters(plant, effects), {}
    for name, table in flattened(tables).items():
        if name not in known and name in {c.name for c in plant.constants}:
            raise ArmidError(f"{where}: '{name}' under [parameters] is a constant of plant '{plant.name}': its value "
                             "is expected under [constants], how well that is known under [tolerances]")  # fmt: skip
        if name not in known:
            raise unknown_name("parameter", name, known, where)
        place = f"{where}, parameters.{name}"
        overrides[name] = validated(Override, table, place)
        check_bounds(overrides[name], resolve(known[name], plant.scales), place)
    return overrides


def with_free(
    overrides: Mapping[str, Override], known: Mapping[str, Known], plant: Plant, where: str
) -> dict[str, Override]:
    """Return overrides that free parameters which the plant fixes, and for which a prior is given."""
    freed = dict(overrides)
    for p in (p for p in plant.parameters if p.name in known):
        own = overrides.get(p.name, Override())
        if own.fixed is not None:
            raise ArmidError(f"{where}: parameter '{p.name}' stands in priors and is fixed, one of the two is expected")
        if p.fixed is not None:
            scaled = resolve(p, plant.scales)
            freed[p.name] = replace(own, low=scaled.low if own.low is None else own.low,
                                    high=scaled.high if own.high is None else own.high)  # fmt: skip
    return freed


def named_parameters(plant: Plant, effects: Mapping[str, Effect]) -> dict[str, Parameter]:
    of_effects = {f"{e.name}.{p.name}": p for e in effects.values() for p in e.parameters}
    return {p.name: p for p in plant.parameters} | of_effects


def flattened(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, object]:
    flat: dict[str, object] = {}
    for name, table in tables.items():
        inner = {key: value for key, value in table.items() if isinstance(value, dict)}
        for key, value in inner.items():
            flat[f"{name}.{key}"] = value
        if len(inner) < len(table) or not table:
            flat[name] = {key: value for key, value in table.items() if key not in inner}
    return flat


def check_bounds(override: Override, declared: Parameter, where: str) -> None:
    """Refuse bounds that leave nothing between them, and bounds of a fixed parameter; warn of values far outside."""
    if override.fixed is not None and (override.low, override.high) != (None, None):
        raise ArmidError(f"{where}: 'fixed' and a bound are both there, a fixed value or bounds are expected")
    low = declared.low if override.low is None else override.low
    high = declared.high if override.high is None else override.high
    if not low < high:
        raise ArmidError(f"{where}: low is {low:g} and high is {high:g}, low below high is expected")
    given = [v for v in (override.low, override.high, override.fixed) if v is not None]
    if given:
        warn_if_far(declared, given, f"{where}: {' to '.join(f'{v:g}' for v in given)}")
