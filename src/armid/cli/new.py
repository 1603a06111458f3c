"""Commands `armid new`, a commented starting file or a campaign guessed from CSV files, and `armid schema`."""

import json
import os.path
import re
import sys
import sysconfig
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from string import Template
from token import NAME
from tokenize import generate_tokens

import click
import numpy as np

from armid.cli.listing import things_of
from armid.cli.options import command, completes, examples, give, plugin_option, say
from armid.errors import ArmidError, quoted, refuse_unless_known
from armid.model import PLANTS, Array, Plant
from armid.model.effect import RESERVED_WORDS
from armid.model.parameter import check_name
from armid.record.reader import wraps_at
from armid.record.resample import check_number
from armid.record.sensor import FEWEST_REST_SAMPLES, sensor_of, stands_still
from armid.record.table import CsvTable, missing, read_table
from armid.registry import load_registry
from armid.report.document import listed
from armid.report.result import NewFiles
from armid.units import ENDS, SUFFIXES, UNIT_ENDS

CATALOGUES = {"effect": "effects", "fitness": "fitness", "identifier": "identifiers", "plant": "plants",
              "analysis": "analyses"}  # fmt: skip
# Kind and --style -> the template that replaces the kind's own.
STYLES = {("identifier", "function"): "identifier_function"}
CAMPAIGN, NEW_STUDY = "campaign", "study"
NEW_KINDS = (*CATALOGUES, CAMPAIGN, NEW_STUDY)
# What the kinds that are no Python file become, and the command that tries them.
FILES = {CAMPAIGN: ("{}", "armid check {}"), NEW_STUDY: ("{}.toml", "armid study {}")}
TRYING = {"analysis": "armid report out/STUDY --plugin {}"}
FOLDER_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
# The made-up axis: inertia [kg m2], viscous friction [N m s/rad], noise of the speed [rad/s].
INERTIA, FRICTION_OF_SHAFT, NOISE_OF_RECORDS = 0.05, 0.03, 0.01
RECORD_INTERVAL, RECORD_SAMPLES = 0.005, 501
# Constants that a guessed campaign names, of those that a record may hold.
MOST_OF_RECORD = 6
# File -> size [N m] and frequency [Hz] of the drive, seed of the noise.
RECORDS = {"synthetic_train.csv": (1.0, 0.8, 1), "synthetic_holdout.csv": (0.7, 1.3, 2)}
DRIVEN_FROM_S = 0.5
DIGITS = 6


@command("new", short_help="Write a starting file of your own.", epilog=examples(
    "armid new effect my_drag", "armid check my_drag.py:my_drag", "armid new campaign my_axis --out studies/campaigns",
    "armid new campaign my_motor --from first.csv second.csv",
))  # fmt: skip
@click.argument("kind", metavar="|".join(NEW_KINDS), shell_complete=completes(words=NEW_KINDS))
@click.argument("name", metavar="NAME")
@click.option(
    "--style", default="", metavar="function",
    help="Of an identifier: function, for any optimiser that is not an algorithm of pymoo (scipy, nevergrad).",
)  # fmt: skip
@click.option(
    "--from", "files", multiple=True, type=click.Path(path_type=Path), metavar="FILE",
    help="Of a campaign: your CSV files, all after one --from. The meaning of each column is guessed.",
)  # fmt: skip
@click.option(
    "--out", default=".", show_default="this folder", type=click.Path(path_type=Path), metavar="FOLDER",
    help="Folder to write to.",
)  # fmt: skip
@click.argument("more", nargs=-1, type=click.Path(path_type=Path), metavar="[FILE]...")
@plugin_option
def new_command(
    kind: str, name: str, style: str, files: tuple[Path, ...], out: Path, more: tuple[Path, ...],
    plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """Write a commented starting file of your own that works as it stands.

    An effect, a fitness, an identifier, a plant or an analysis becomes FOLDER/NAME.py, a Python file that declares
    NAME. `armid check` tries it, `armid report` an analysis. A study becomes FOLDER/NAME.toml, which `armid study`
    runs. A campaign becomes the folder FOLDER/NAME with campaign.toml and two small records, which are synthetic and
    say so; with --from FILE... it has copies of your records, and a comment at each guess; its plant is guessed, or
    that of --plugin. Nothing that exists is overwritten.
    """
    from armid.record import write_campaign

    refuse_unless_known(kind, NEW_KINDS, f"kind '{kind}' is not known")
    if style and (kind, style) not in STYLES:
        raise ArmidError(f"--style '{style}' of kind '{kind}': an identifier has the style 'function'")
    if (files or more) and kind != CAMPAIGN:
        raise ArmidError(f"--from of kind '{kind}': records are expected of a campaign alone")
    if more and not files:
        raise ArmidError(f"{quoted(str(more[0]))} stands behind the name: --from before the files of a campaign is "
                         "expected")  # fmt: skip
    template, registry = STYLES.get((kind, style), kind), load_registry(plugins)
    plant = next(iter(registry.own["plants"].values()), None)
    if plugins and (plant is None or not files):
        raise ArmidError("--plugin: the plant of a campaign that is made by --from is expected")
    check_new_name(kind, name, things_of(CATALOGUES[kind], registry) if kind in CATALOGUES else (), template)
    file, trying = FILES.get(kind, ("{}.py", f"{TRYING.get(kind, 'armid check {}')}:{name}"))
    target = out / file.format(name)
    if os.path.lexists(target):
        raise ArmidError(f"{target} exists already: another name, or another folder by --out, is expected")
    if kind == CAMPAIGN:
        records = [*files, *more]
        text, tables = guessed_campaign(name, records, plant) if records else (campaign_text(name), synthetic_records())
        write_campaign(target, text, tables)
    else:
        with NewFiles(out) as new_files:
            text = filled(f"{template}.{'toml' if kind == NEW_STUDY else 'py'}.txt", name=name)
            new_files.path(target.name).write_text(text, encoding="utf-8")
    check = " --plugin ".join([trying.format(target), *plugins])
    say(f"wrote {target}; try: {check}")
    give(wrote=target, check=check)


@command("schema", short_help="Print the JSON Schema of a campaign or a study.", epilog=examples(
    "armid schema study > study.schema.json", "armid schema campaign --plugin mine.py:my_plant",
))  # fmt: skip
@click.argument("what", metavar="campaign|study", shell_complete=completes(words=(CAMPAIGN, NEW_STUDY)))
@plugin_option
def schema_command(what: str, plugins: tuple[str, ...]) -> None:
    """Print the JSON Schema of campaign.toml or of a study's file.

    An editor that knows it completes keys and names, and marks what is wrong. It is made of the definitions that armid
    reads these files with, and offers what is registered. With taplo or Even Better TOML the first line of the file is
    `#:schema ./study.schema.json`.
    """
    from armid.record.schema import CampaignSheet, json_schema, key_schema, sheet_schema
    from armid.study.spec import study_schema

    refuse_unless_known(what, (CAMPAIGN, NEW_STUDY), f"schema '{what}' is not known")
    registry = load_registry(plugins)
    registered = {kind: getattr(registry, kind) for kind in ("plants", "effects", "identifiers")}
    keys = {key.key: key_schema(key) for plant in registry.plants.values() for key in plant.keys}
    schema = json_schema(sheet_schema(CampaignSheet) if what == CAMPAIGN else study_schema(), registered, keys)
    say(*json.dumps(schema, indent=2).splitlines())
    give(**schema)


def filled(file: str, **values: object) -> str:
    """Return a file of templates with values in place of their `$name`."""
    return Template((files("armid.cli") / "templates" / file).read_text(encoding="utf-8")).substitute(values)


def check_new_name(kind: str, name: str, taken: Collection[str], template: str) -> None:
    """Refuse a name that a starting file could not have; taken: names of the same kind that are registered."""
    if kind in FILES:
        if not FOLDER_NAME.fullmatch(name) or name.endswith("."):
            raise ArmidError(f"{kind} '{name}' is not a usable name: letters, digits, '_', '-' and '.' are expected")
        return
    check_name(name, kind)
    if name in taken or (kind == "effect" and name in RESERVED_WORDS):
        raise ArmidError(f"{kind} '{name}' is there already: another name is expected")
    tokens = generate_tokens(StringIO(filled(f"{template}.py.txt", name="_")).readline)
    if any(token.type == NAME and token.string == name for token in tokens):
        raise ArmidError(f"{kind} '{name}' cannot have this name, which the file itself uses: another is expected")
    module = find_spec(name)
    installed = module is not None and str(module.origin).startswith(tuple(sysconfig.get_paths().values()))
    if installed or name == "armid" or name in sys.stdlib_module_names:
        raise ArmidError(f"{kind} '{name}' cannot have this name: {name}.py would hide the module '{name}'")


def campaign_text(name: str) -> str:
    return filled("campaign.toml.txt", name=name, inertia=INERTIA, friction=FRICTION_OF_SHAFT, noise=NOISE_OF_RECORDS)


def synthetic_records() -> dict[str, dict[str, Array]]:
    return {file: record(*arguments) for file, arguments in RECORDS.items()}


def record(size: float, frequency: float, seed: int) -> dict[str, Array]:
    """Return header -> values of one record: a drive that steps to and fro, and the speed with noise.

    J dv/dt = u - c v with u constant between samples is solved exactly: v' = v exp(-c dt/J) + u/c (1 - exp(-c dt/J)).
    """
    from scipy.signal import lfilter

    times = RECORD_INTERVAL * np.arange(RECORD_SAMPLES)
    drive = np.where(
        times < DRIVEN_FROM_S, 0.0, size * np.sign(np.cos(2.0 * np.pi * frequency * (times - DRIVEN_FROM_S)))
    )
    kept = np.exp(-FRICTION_OF_SHAFT * RECORD_INTERVAL / INERTIA)
    speed = lfilter([0.0, (1.0 - kept) / FRICTION_OF_SHAFT], [1.0, -kept], drive)
    measured = speed + NOISE_OF_RECORDS * np.random.default_rng(seed).standard_normal(RECORD_SAMPLES)
    columns = {"time_s": times, "angular_velocity_rad_s": measured, "drive_N_m": drive}
    return {header: np.round(values, DIGITS) for header, values in columns.items()}


# Words of a header, without its unit, that tell what a column is; the first that fits.
WORDS_OF_HEADERS = {
    "time": ("time", "t", "timestamp", "date", "datetime", "clock", "tempo", "zeit", "temps"),
    "speed": ("angular_velocity", "velocity", "speed", "omega", "vel", "w", "rate", "gyro", "tacho", "tachometer"),
    "position": ("angle", "position", "pos", "theta", "phi", "q"),
    "drive": ("drive", "u", "voltage", "torque", "force", "command", "current", "duty", "pwm", "input", "motor"),
}
# End of a unit -> seconds.
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
# Quantity, linear or not -> what its header begins with in a record, the ends of units that it may have, and the one
# that is taken where the header has none. An input in another unit is a `command`.
HEADERS = {
    ("speed", False): ("angular_velocity", tuple(SUFFIXES["rad/s"]), "rad_s"),
    ("speed", True): ("velocity", tuple(SUFFIXES["m/s"]), "m_s"),
    ("position", False): ("angle", tuple(SUFFIXES["rad"]), "rad"),
    ("position", True): ("position", tuple(SUFFIXES["m"]), "m"),
    ("drive", False): ("drive", ("V", "N_m", "A"), ""),
    ("drive", True): ("drive", ("V", "N", "A"), ""),
}
COMMAND, CURRENT = "command", "current_A"
LINEAR, DRIVES = {*SUFFIXES["m"], *SUFFIXES["m/s"], "N"}, {"V", "A", "N", "N_m"}
# Units of a drive with a prefix -> end of the unit, and what turns a number into it.
DRIVEN_IN = {word: (UNIT_ENDS[unit], factor) for end, (unit, factor, words) in ENDS.items()
             if UNIT_ENDS.get(unit) in DRIVES - {end} for word in (end, *words)}  # fmt: skip
COUNT_ENDS = ("counts", "counts_s")
TURNING_ENDS = {*SUFFIXES["rad/s"], *SUFFIXES["rad"]}
# A machine is at rest as long as its signal is nearer to its first rows than so many times their range.
BEYOND_REST = 2.5
# Share of equal neighbours from which on an input keeps its value between samples.
KEPT = 0.5
# Of a machine that turns or is linear: its lines of campaign.toml.
GUESSED_MODELS = {
    False: ('plant = "rotary_arm"  # GUESS: it turns; inertia, damping and the moment of gravity are searched,',
            "# all per unit of the drive, as the gain is 1: a known one goes into [parameters.gain] as `fixed`"),
    True: ('plant = "linear_axis"  # GUESS: it moves straight; mass and damping are searched, all per unit',
           "# of the drive, as the gain is 1: a known one goes into [parameters.gain] as `fixed`"),
}  # fmt: skip


@dataclass(frozen=True)
class FileColumn:
    """One column.

    header: in the file; words: what it is called without its unit; end: of the unit, "" for none; unit: as the file has
    it, where armid does not know it; factor: what turns its numbers into the unit of the end.
    """

    header: str
    words: str
    end: str
    unit: str = ""
    factor: float = 1.0


def column_of(header: str) -> FileColumn:
    apart = re.fullmatch(r"(.*?)[ _]*[\[(]([^\])]*)[\])]", header)
    if apart is None and header.rpartition(" ")[2] in {*UNIT_ENDS, *DRIVEN_IN}:
        apart = re.fullmatch(r"(.*) (\S+)", header)
    if apart:
        words, unit = apart[1], apart[2].strip()
        end = UNIT_ENDS.get(unit, "")
    else:
        ends = {end: end for end in (*UNIT_ENDS.values(), *SECONDS)} | UNIT_ENDS
        last = max((e for e in ends if header.endswith(f"_{e}") or header == e == "rpm"), key=len, default="")
        words, unit, end = header.removesuffix(f"_{last}"), "", ends.get(last, "")
    end, factor = DRIVEN_IN.get(unit or end, (end, 1.0))
    return FileColumn(header, words.strip().lower().replace(" ", "_"), end, "" if end else unit, factor)


def columns_in(table: CsvTable) -> list[FileColumn]:
    """Return the columns of a file that hold numbers or times of day."""
    return [column_of(header) for header in (*table.columns, *table.clocks)]


def quantity_of(column: FileColumn) -> str:
    """Return what a column is: a key of WORDS, "" for nothing that is known."""
    parts = set(re.split(r"[^a-z]+", column.words))
    for quantity, words in WORDS_OF_HEADERS.items():
        if any(word == column.words or word in parts for word in words):
            return quantity
    if column.end in {*SUFFIXES["rad/s"], *SUFFIXES["m/s"]}:
        return "speed"
    return "position" if column.end in {"deg", "rad", "turns", *SUFFIXES["m"]} else ""


def guessed_campaign(
    name: str, files: Sequence[Path], plant: Plant | None = None
) -> tuple[str, dict[str, dict[str, Array]]]:
    """Return campaign.toml and its tables, file -> header -> values, from CSV files of one machine.

    plant: of the user; None: it is guessed.
    Raises ArmidError where no column of time, motion or drive is found.
    """
    names = [file.name for file in files]
    for i, file in enumerate(names):
        if file in names[:i]:
            raise ArmidError(f"{quoted(file)} is there twice: files of different names are expected")
    tables = [read_table(file, file.name) for file in files]
    notes: list[str] = []
    is_given, plant = plant is not None, plant or plant_of(tables[0])
    if plant is None:
        roles = roles_of(tables[0])
        linear = moves_straight(roles, tables[0])
        headers, inputs, named = new_headers(roles, linear, notes), ["drive"], list[str]()
    else:
        roles, headers = roles_in(tables[0], plant, notes)
        inputs = [i.name for i in plant.inputs if i.name in roles]
        named = [f'{i} = "{headers[i]}"' for i in inputs]
    guess = "" if is_given else "  # GUESS: it has outputs of these names"
    model = GUESSED_MODELS[linear] if plant is None else (f'plant = "{plant.name}"{guess}',)
    read = headers_of(plant or PLANTS["linear_axis" if linear else "rotary_arm"])
    renamed = {roles[quantity].header: header for quantity, header in headers.items()}
    drives = {headers[i]: roles[i].factor for i in inputs}
    second = seconds_of(roles["time"], tables[0], notes)
    written = {table.file: rewritten(table, renamed, roles["time"].header, second, drives, read) for table in tables}
    unused = [header for header in tables[0].columns if header not in (roles["time"].header, *renamed)]
    notes += [f"not used: {', '.join(map(quoted, unused))}"] if unused else []
    if any(column_of(h).end in COUNT_ENDS for h in unused):
        notes.append("counts of an encoder are an angle as angle_counts, with counts_per_turn in this file")
    for table in tables:
        check_number(len(table.lines), f"{table.file}:", "in the record")
        for header in (old for old, new in renamed.items() if new not in drives):
            told = int(np.isfinite(table.columns[header]).sum())
            check_number(told, f"{table.file}: {quoted(header)} has", "with a number")
    # what the plant says of an input counts, whatever the file says
    known = {i.name for i in plant.inputs if i.hold} if plant is not None else set[str]()
    open_drives = [headers[i] for i in inputs if i not in known]
    others = f"; what the plant says of {' and '.join(sorted(known))} counts" if known else ""
    hold = [guessed_hold(written.values(), open_drives, others)] if open_drives else []
    counted = [header for header in headers.values() if column_of(header).end in COUNT_ENDS]
    turn = (
        [f"# counts_per_turn = 4096  # of the encoder of {listed(counted)}: how many make a turn?"] if counted else []
    )
    own = constants_of_record(plant) if is_given and plant is not None else []
    about_all = [*model, *turn, *hold]
    return guessed_text(name, tables, written, renamed, [*drives], notes, about_all, named, own), written


def constants_of_record(plant: Plant) -> list[str]:
    """Return the line, commented out, with which a record tells a constant that is another than the plant's."""
    ordered = sorted(plant.constants, key=lambda c: c.tolerance is not None)
    names = listed([c.name for c in ordered], MOST_OF_RECORD)
    return [f"# constants = {{ {c.name} = {c.value:g} }}  # of this record alone, SI: {names}" for c in ordered[:1]]


def plant_of(table: CsvTable) -> Plant | None:
    """Return the plant of armid that reads several outputs of a file and its inputs by their names, or None.

    It has to read more columns than the guess of a machine from the words of its headers.
    """

    def n_read(plant: Plant) -> int:
        return sum(any(header in table.headers for header in o.factors) for o in plant.outputs)

    def is_driven(plant: Plant) -> bool:
        return all(any(h in table.headers for h in i.columns) for i in plant.inputs if i.required)

    columns = columns_in(table)
    n_guessed = len({quantity_of(c) for c in columns} & {"speed", "position"})
    likely = [plant for plant in PLANTS.values() if is_driven(plant) and n_read(plant) > n_guessed]
    return max(likely, key=n_read, default=None)


def headers_of(plant: Plant) -> frozenset[str]:
    """Return every header of a record that a plant reads, its inputs' own names too."""
    inputs = [header for i in plant.inputs for header in (*i.columns, i.name)]
    return frozenset([*inputs, *(header for o in plant.outputs for header in o.factors)])


def moves_straight(roles: Mapping[str, FileColumn], table: CsvTable) -> bool:
    """Return whether a machine is a linear axis; refuse one that moves straight and turns, and units not known."""
    linear = any(roles[q].end in LINEAR for q in roles if q != "time")
    turns = [quoted(roles[q].header) for q in ("speed", "position") if q in roles and roles[q].end in TURNING_ENDS]
    if linear and turns:
        straight = next(quoted(c.header) for c in roles.values() if c.end in LINEAR)
        raise ArmidError(f"{table.where}: {straight} tells of a machine that moves straight and {turns[0]} of one "
                         "that turns, which armid has no plant for: a plant of your own by `armid new plant` is "
                         "expected")  # fmt: skip
    for quantity, column in roles.items():
        ends = HEADERS[quantity, linear][1] if quantity not in ("time", "drive") else ()
        if ends and (column.unit or (column.end and column.end not in ends)):
            known = [unit for unit, end in UNIT_ENDS.items() if end in ends and " " not in unit]
            raise ArmidError(f"{table.where}: the unit of {quoted(column.header)} is "
                             f"{quoted(column.unit or column.end)}: one of {', '.join(known)} is expected")  # fmt: skip
    return linear


def roles_in(table: CsvTable, plant: Plant, notes: list[str]) -> tuple[dict[str, FileColumn], dict[str, str]]:
    """Return output or input of a known plant -> column, and -> header in a record; the time is a column as well.

    The plant reads a column by its name, else it is the first in the unit. That of an input may have no unit.
    """
    outputs = {o.name: (tuple(o.factors), tuple(SUFFIXES[o.unit])) for o in plant.outputs}
    ports = outputs | {i.name: ((*i.columns, i.name), (UNIT_ENDS.get(i.unit, ""),)) for i in plant.inputs}
    columns = columns_in(table)
    by_name = headers_of(plant)
    roles, headers = dict[str, FileColumn](), dict[str, str]()
    for name, (read, ends) in ports.items():
        spare = [c for c in columns if c not in roles.values() and c.header not in by_name and not c.unit]
        fit = [c for c in spare if c.end and c.end in ends and c.end not in COUNT_ENDS]
        if name in outputs:  # a record has numbers of an output in the unit of a header that is read
            fit = [c for c in fit if c.factor == 1.0 and any(header.endswith(f"_{c.end}") for header in read)]
        else:
            fit += [c for c in spare if not c.end and quantity_of(c) == "drive"]
        for column in [*(c for c in columns if c.header in read), *fit][:1]:
            alike = [header for header in read if column.end and header.endswith(f"_{column.end}")]
            new = column.header if column.header in read else [*alike, "_".join(filter(None, (name, column.end)))][0]
            times = "" if column.factor == 1.0 else f", its numbers times {column.factor:g}"
            guess = "" if column.header in read else f"; GUESS: it is {name}"
            notes.append(f"{new}: the column {quoted(column.header)}{times}{guess}")
            roles[name], headers[name] = column, new
    if not outputs.keys() & roles.keys():
        raise missing(table, "output", [header for read, _ in outputs.values() for header in read])
    for wanted in plant.inputs:
        if wanted.required and wanted.name not in roles:
            raise missing(table, f"column for input '{wanted.name}'", ports[wanted.name][0])
    return {"time": time_of(table, columns, roles), **roles}, headers


def roles_of(table: CsvTable) -> dict[str, FileColumn]:
    """Return quantity -> column of a file: the time, what was measured, and what drove it."""
    columns = columns_in(table)
    roles: dict[str, FileColumn] = {}
    for column in columns:
        roles.setdefault(quantity_of(column), column)
    roles.pop("", None)
    driven = [c for c in columns if c.end in DRIVES and c not in roles.values()]
    if "drive" not in roles and driven:
        roles["drive"] = driven[0]
    roles["time"] = time_of(table, columns, roles)
    if not {"speed", "position"} & roles.keys() or "drive" not in roles:
        motion = "a speed or an angle (angular_velocity_rad_s, angle_deg)"
        what = "an input (drive_V, current_A)" if "drive" not in roles else motion
        raise ArmidError(f"{table.where}: no name or unit among {quoted(list(table.columns))} is that of {what}: such "
                         "a name is expected")  # fmt: skip
    if "speed" in roles and roles.get("position", FileColumn("", "", "")).end == "counts":
        del roles["position"]
    for quantity in ("speed", "position"):
        if quantity in roles and roles[quantity].end in COUNT_ENDS:
            raise ArmidError(f"{table.where}: {quoted(roles[quantity].header)} is in counts, and how many "
                             "make a turn is not known: an angle or a speed in deg, rad or turns is expected, or a "
                             "campaign.toml of your own with counts_per_turn")  # fmt: skip
    return roles


def time_of(table: CsvTable, columns: Sequence[FileColumn], roles: Mapping[str, FileColumn]) -> FileColumn:
    """Return the column of the time: by its name, else the first that rises."""
    unknown = [c for c in columns if c not in roles.values()]
    named = [c for c in columns if quantity_of(c) == "time"]
    known = table.columns | table.clocks
    rising = [c for c in unknown if np.all(np.diff(known[c.header]) > 0.0)]
    if not named and not rising:
        raise ArmidError(f"{table.where}: no column of {quoted(list(table.headers))} rises as a time does, a time "
                         "in each row is expected")  # fmt: skip
    return [*named, *rising][0]


def new_headers(roles: Mapping[str, FileColumn], linear: bool, notes: list[str]) -> dict[str, str]:
    """Return quantity -> header as a record has it, but for the time; notes: a line for each guess is added."""
    headers = {}
    for quantity, column in roles.items():
        if quantity == "time":
            continue
        begin, ends, usual = HEADERS[quantity, linear]
        end = column.end if column.end in ends else usual
        names_of_drive = {("drive", "A"): CURRENT, ("drive", ""): COMMAND}
        headers[quantity] = names_of_drive.get((quantity, end), f"{begin}_{end}")
        guess = "" if end in ("", column.end) else f"; GUESS: its unit, which the header does not tell, is {end}"
        times = "" if column.factor == 1.0 else f", its numbers times {column.factor:g}"
        notes.append(f"{headers[quantity]}: the column {quoted(column.header)}{times}{guess}")
    return headers


def seconds_of(column: FileColumn, table: CsvTable, notes: list[str]) -> float | None:
    """Return what turns a column of time into seconds; None of times of day, which are read in seconds."""
    times = table.times(column.header)
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        raise ArmidError(f"{table.file}: time does not rise from row {back[0] + 1} to row {back[0] + 2} of "
                         f"{quoted(column.header)}, {times[back[0]]:g} and {times[back[0] + 1]:g}: a time that rises "
                         "from row to row is expected")  # fmt: skip
    end, guess = column.end, ""
    if column.header in table.clocks:
        notes.append(f"time_s: the column {quoted(column.header)}, times of day, as seconds after the first row")
        return None
    if end not in SECONDS:
        end = "ms" if np.all(times == np.rint(times)) and np.median(np.diff(times)) >= 1.0 else "s"
        guess = f"; GUESS: it is in {end}"
    notes.append(f"time_s: the column {quoted(column.header)}{guess}")
    return SECONDS[end]


def rewritten(
    table: CsvTable, renamed: Mapping[str, str], time: str, second: float | None, drives: Mapping[str, float],
    read: frozenset[str],
) -> dict[str, Array]:  # fmt: skip
    """Return the columns of a file under the headers of a record; numbers are kept where the unit is.

    second: see `seconds_of`. drives: header of an input -> what its numbers are multiplied by. read: headers that the
    plant reads.
    """
    for header in (time, *renamed):
        if header not in table.headers:
            raise ArmidError(f"{table.where}: no column {quoted(header)} is there, as in the first file: files of one "
                             "machine with the same columns are expected")  # fmt: skip
    if (second is None) != (time in table.clocks):
        kinds = ("times of day", "numbers") if second is not None else ("numbers", "times of day")
        raise ArmidError(f"{table.where}: {quoted(time)} holds {kinds[0]}, {kinds[1]} are expected, as in the first "
                         "file")  # fmt: skip
    for header, new in renamed.items():
        table.numbers(header, gaps=new not in drives)
    times = table.times(time)
    times = times if second in (None, 1.0) else np.round(times * second, 12)
    taken = {"time_s", *renamed.values()}
    # what is not used must not be taken for another input or output, as the counts of an encoder, which want its turn
    kept = {h: f"unused_{h}" if h in read or column_of(h).end in COUNT_ENDS else h for h in table.columns
            if h not in (time, *renamed) and h not in taken and "," not in h}  # fmt: skip
    own = {new: table.columns[h] * drives.get(new, 1.0) for h, new in renamed.items()}
    return {"time_s": times} | own | {new: table.columns[h] for h, new in kept.items()}


def guessed_text(
    name: str, tables: Sequence[CsvTable], written: Mapping[str, Mapping[str, Array]], renamed: Mapping[str, str],
    drives: Sequence[str], notes: Sequence[str], model: Sequence[str], named: Sequence[str], own: Sequence[str],
) -> str:  # fmt: skip
    lines = [
        "# Written by `armid new campaign --from`: check each line with GUESS. The CSV files are copies with",
        "# headers that armid reads. Numbers are those of the originals unless a line says so, times are in",
        "# seconds.", "#", *(f"# {note}" for note in notes), f'name = "{name}"', *model,
    ]  # fmt: skip
    wrapped = [new for old, new in renamed.items() for t in tables if wraps_at(t.columns[old], new)]
    lines += [f"unwrap = true  # {wrapped[0]} jumps by whole turns"] if wrapped else []
    lines += ["[inputs]", *named] if named else []
    measured = next(header for header in renamed.values() if header not in drives)
    for i, (file, columns) in enumerate(written.items()):
        last = i == len(written) - 1 and len(written) > 1
        lines += ["", "[[records]]", f'file = "{file}"  # {about(columns, measured)}']
        lines += [f'role = "{"holdout" if last else "train"}"' + ("  # GUESS: the last file judges" if last else "")]
        lines += own
    return "\n".join(lines) + "\n"


def guessed_hold(written: Iterable[Mapping[str, Array]], drives: Sequence[str], others: str) -> str:
    """Return the line that says what inputs do between two rows; others: what is added on other inputs."""
    # One device drives all records: steps show that it holds, a chirp cannot.
    held = [any(np.mean(np.diff(columns[drive]) == 0.0) > KEPT for drive in drives) for columns in written]
    steps = f"is constant between two rows, as its steps in {held.count(True)} of the {len(held)} files show"
    kept = ("zero", steps) if any(held) else ("linear", "runs straight between two rows, as it changes in each row")
    return f'hold = "{kept[0]}"  # GUESS: {" and ".join(drives)} {kept[1]}{others}'


def about(columns: Mapping[str, Array], measured: str) -> str:
    """Return rows, rate, rest and sensor of a record in words."""
    times = columns["time_s"]
    values = columns[measured]
    present = np.flatnonzero(np.isfinite(values))
    first = values[present[:FEWEST_REST_SAMPLES]]
    moved = np.flatnonzero(np.abs(values[present] - np.median(first)) > BEYOND_REST * np.ptp(first))
    n_rest = int(present[moved[0]]) if moved.size and stands_still(first, 0.0, False) else 0
    shorter = f"fewer than {FEWEST_REST_SAMPLES} rows of rest first"
    rest = f"{times[n_rest] - times[0]:.3g} s of rest first" if n_rest >= FEWEST_REST_SAMPLES else shorter
    sensor = sensor_of(values[present])
    step = f"steps of {sensor.step:.3g}" if sensor.step else "a fine sensor"
    hold = f", renewed every {sensor.hold} rows" if sensor.hold > 1 else ""
    return f"{times.size} rows at {1.0 / np.median(np.diff(times)):.4g} Hz, {rest}; {measured}: {step}{hold}"
