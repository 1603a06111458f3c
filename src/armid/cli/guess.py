"""A campaign out of CSV files that somebody recorded: what their columns are, guessed from names, units and values."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armid.errors import ArmidError, quoted
from armid.model import Array
from armid.record.noise import FEWEST_REST_SAMPLES
from armid.record.sensor import sensor_of
from armid.record.signal import wraps_at
from armid.record.table import CsvTable, read_table
from armid.units import SUFFIXES, UNIT_ENDS

# Words of a header, without its unit, that tell what a column is; the first that fits.
WORDS = {
    "time": ("time", "t", "timestamp", "clock", "tempo", "zeit", "temps"),
    "speed": ("angular_velocity", "velocity", "speed", "omega", "vel", "w", "rate", "gyro"),
    "position": ("angle", "position", "pos", "theta", "phi", "q"),
    "drive": ("drive", "u", "voltage", "torque", "force", "command", "current", "duty", "pwm", "input", "motor"),
}
# End of a unit -> seconds.
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
# Quantity, linear or not -> what its header begins with in a record, the ends of units that it may have, and the one
# that is taken where the header has none.
HEADERS = {
    ("speed", False): ("angular_velocity", tuple(SUFFIXES["rad/s"]), "rad_s"),
    ("speed", True): ("velocity", ("m_s",), "m_s"),
    ("position", False): ("angle", tuple(SUFFIXES["rad"]), "rad"),
    ("position", True): ("position", ("m",), "m"),
    ("drive", False): ("drive", ("V", "N_m"), "V"),
    ("drive", True): ("drive", ("V", "N"), "V"),
}
# Units of a drive with a prefix -> end of the unit, and what turns a number into it.
DRIVEN_IN = {"mV": ("V", 1e-3), "kV": ("V", 1e3), "mA": ("A", 1e-3), "kN": ("N", 1e3), "mN m": ("N_m", 1e-3),
             "mNm": ("N_m", 1e-3), "kNm": ("N_m", 1e3), "kN m": ("N_m", 1e3)}  # fmt: skip
LINEAR, DRIVES = {"m", "mm", "m_s", "mm_s", "N"}, {"V", "A", "N", "N_m"}
# A machine is at rest as long as its signal stays within this share of its range.
AT_REST = 0.01
# Share of equal neighbours from which on an input keeps its value between samples.
KEPT = 0.5


@dataclass(frozen=True)
class Column:
    """One column.

    header: in the file; words: what it is called without its unit; end: of the unit, "" for none; unit: as the file has
    it, where armid does not know it; factor: what turns its numbers into the unit of the end.
    """

    header: str
    words: str
    end: str
    unit: str = ""
    factor: float = 1.0


def column_of(header: str) -> Column:
    bracketed = re.fullmatch(r"(.*?)[ _]*[\[(]([^\])]*)[\])]", header)
    if bracketed:
        words, unit = bracketed[1].strip().lower().replace(" ", "_"), bracketed[2].strip()
        end, factor = DRIVEN_IN.get(unit, (UNIT_ENDS.get(unit, ""), 1.0))
        return Column(header, words, end, "" if end else unit, factor)
    ends = {*UNIT_ENDS.values(), *SECONDS}
    end = max((e for e in ends if header.endswith(f"_{e}") or header == e == "rpm"), key=len, default="")
    return Column(header, header.removesuffix(f"_{end}").lower().replace(" ", "_") if end else header.lower(), end)


def quantity_of(column: Column) -> str:
    """Return what a column is: a key of WORDS, "" for nothing that is known."""
    parts = set(re.split(r"[^a-z]+", column.words))
    for quantity, words in WORDS.items():
        if any(word == column.words or word in parts for word in words):
            return quantity
    if column.end in SUFFIXES["rad/s"]:
        return "speed"
    return "position" if column.end in {"deg", "rad", "turns"} else ""


def guessed_campaign(name: str, files: Sequence[Path]) -> tuple[str, dict[str, dict[str, Array]]]:
    """Return campaign.toml and its tables, file -> header -> values, from CSV files of one machine.

    Raises ArmidError where no column of time, motion or drive is found.
    """
    names = [file.name for file in files]
    for i, file in enumerate(names):
        if file in names[:i]:
            raise ArmidError(f"{quoted(file)} is there twice: files of different names are expected")
    tables = [read_table(file, file.name) for file in files]
    roles = roles_of(tables[0])
    linear = any(roles[q].end in LINEAR for q in roles if q != "time")
    if linear and "speed" not in roles:
        raise ArmidError(f"{tables[0].where}: a position of a linear axis is there and no speed, which armid has no "
                         "plant for: a speed, or a plant of your own by `armid new plant`, is expected")  # fmt: skip
    known = ", ".join(unit for unit in (*UNIT_ENDS, *DRIVEN_IN) if " " not in unit)
    for column in roles.values():
        if column.unit:
            where = f"{tables[0].where}: the unit of {quoted(column.header)}"
            raise ArmidError(f"{where} is not known: one of {known} is expected")
    notes: list[str] = []
    renamed = {roles[quantity].header: header for quantity, header in new_headers(roles, linear, notes).items()}
    second = seconds_of(roles["time"], tables[0], notes)
    drive = renamed[roles["drive"].header], roles["drive"].factor
    written = {table.file: rewritten(table, renamed, roles["time"].header, second, drive) for table in tables}
    unused = [header for header in tables[0].columns if header not in (roles["time"].header, *renamed)]
    notes += [f"not used: {', '.join(map(quoted, unused))}"] if unused else []
    return campaign_text(name, tables, roles, written, renamed, linear, notes), written


def roles_of(table: CsvTable) -> dict[str, Column]:
    """Return quantity -> column of a file: the time, what was measured, and what drove it."""
    columns = [column_of(header) for header in table.columns]
    roles: dict[str, Column] = {}
    for column in columns:
        roles.setdefault(quantity_of(column), column)
    roles.pop("", None)
    driven = [c for c in columns if c.end in DRIVES and c not in roles.values()]
    if "drive" not in roles and driven:
        roles["drive"] = driven[0]
    if "time" not in roles:
        unknown = [c for c in columns if c not in roles.values()]
        rising = [c for c in unknown if np.all(np.diff(table.columns[c.header]) > 0.0)]
        if not rising:
            raise ArmidError(f"{table.where}: no column of {quoted(list(table.columns))} rises as a time does, a time "
                             "in each row is expected")  # fmt: skip
        roles["time"] = rising[0]
    if not {"speed", "position"} & roles.keys() or "drive" not in roles:
        motion = "a speed or an angle (angular_velocity_rad_s, angle_deg)"
        what = "an input (drive_V, current_A)" if "drive" not in roles else motion
        raise ArmidError(f"{table.where}: no name or unit among {quoted(list(table.columns))} is that of {what}: such "
                         "a name is expected")  # fmt: skip
    if "speed" in roles and roles.get("position", Column("", "", "")).end == "counts":
        del roles["position"]
    for quantity in ("speed", "position"):
        if quantity in roles and roles[quantity].end in ("counts", "counts_s"):
            raise ArmidError(f"{table.where}: {quoted(roles[quantity].header)} is in counts, and the counts of a turn "
                             "are not known: an angle or a speed in deg, rad or turns is expected")  # fmt: skip
    return roles


def new_headers(roles: Mapping[str, Column], linear: bool, notes: list[str]) -> dict[str, str]:
    """Return quantity -> header as a record has it, but for the time; notes: a line for each guess is added."""
    headers = {}
    for quantity, column in roles.items():
        if quantity == "time":
            continue
        begin, ends, usual = HEADERS[quantity, linear]
        end = column.end if column.end in ends else usual
        headers[quantity] = f"{begin}_{end}"
        guess = "" if end == column.end else f"; GUESS: its unit, which the header does not tell, is {end}"
        if quantity == "drive" and column.end == "A":
            headers[quantity], guess = "current_A", ""
        times = "" if column.factor == 1.0 else f", its numbers times {column.factor:g}"
        notes.append(f"{headers[quantity]}: the column {quoted(column.header)}{times}{guess}")
    return headers


def seconds_of(column: Column, table: CsvTable, notes: list[str]) -> float:
    """Return what turns a column of time into seconds."""
    times = table.numbers(column.header)
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        raise ArmidError(f"{table.file}: time does not rise from row {back[0] + 1} to row {back[0] + 2} of "
                         f"{quoted(column.header)}, {times[back[0]]:g} and {times[back[0] + 1]:g}: a time that rises "
                         "from row to row is expected")  # fmt: skip
    if column.end in SECONDS:
        notes.append(f"time_s: the column {quoted(column.header)}")
        return SECONDS[column.end]
    in_ms = bool(np.all(times == np.rint(times)) and np.median(np.diff(times)) >= 1.0)
    notes.append(f"time_s: the column {quoted(column.header)}; GUESS: it is in {'ms' if in_ms else 's'}")
    return SECONDS["ms" if in_ms else "s"]


def rewritten(
    table: CsvTable, renamed: Mapping[str, str], time: str, second: float, drive: tuple[str, float]
) -> dict[str, Array]:
    """Return the columns of a file under the headers of a record; numbers are kept where the unit is.

    drive: its header, and what its numbers are multiplied by.
    """
    for header in (time, *renamed):
        table.numbers(header, gaps=header != time) if header in table.headers else missing(table, header)
    times = table.columns[time] if second == 1.0 else np.round(table.columns[time] * second, 12)
    taken = {"time_s", *renamed.values()}
    others = {h: v for h, v in table.columns.items() if h not in (time, *renamed) and h not in taken and "," not in h}
    own = {new: table.columns[h] * (drive[1] if new == drive[0] else 1.0) for h, new in renamed.items()}
    return {"time_s": times} | own | others


def missing(table: CsvTable, header: str) -> None:
    raise ArmidError(f"{table.where}: no column {quoted(header)} is there, as in the first file: files of one machine "
                     "with the same columns are expected")  # fmt: skip


def campaign_text(
    name: str, tables: Sequence[CsvTable], roles: Mapping[str, Column], written: Mapping[str, Mapping[str, Array]],
    renamed: Mapping[str, str], linear: bool, notes: Sequence[str],
) -> str:  # fmt: skip
    drives = [columns[renamed[roles["drive"].header]] for columns in written.values()]
    # One device drives all records: steps show that it holds, a chirp cannot.
    held = [float(np.mean(np.diff(drive) == 0.0)) > KEPT for drive in drives]
    lines = ["# Written by `armid new campaign --from`: check each line with GUESS. The CSV files are copies with",
             "# headers that armid reads. Numbers are those of the originals unless a line says so, times are in",
             "# seconds.", "#"]  # fmt: skip
    lines += [f"# {note}" for note in notes]
    lines += [f'name = "{name}"']
    if linear:
        lines += [
            'plant = "driven_axis"  # GUESS: a linear axis',
            'effects = ["viscous"]  # GUESS: its speed is braked',
        ]
    else:
        lines += [
            'plant = "rotary_arm"  # GUESS: it turns; inertia, damping and the moment of gravity are searched,',
            "# all per unit of the drive, as the gain is 1: a known one goes into [parameters.gain] as `fixed`",
        ]
    stays = f"keeps its value from row to row in {held.count(True)} of {len(held)} files"
    kept = stays if any(held) else "changes in each row"
    lines += [f'hold = "{"zero" if any(held) else "linear"}"  # GUESS: the drive {kept}']
    wrapped = [new for old, new in renamed.items() for t in tables if wraps_at(t.columns[old], new)]
    if wrapped:
        lines += [f"unwrap = true  # {wrapped[0]} jumps by whole turns"]
    for i, (file, columns) in enumerate(written.items()):
        last = i == len(written) - 1 and len(written) > 1
        lines += ["", "[[records]]", f'file = "{file}"  # {about(columns, renamed)}']
        lines += [f'role = "{"holdout" if last else "train"}"' + ("  # GUESS: the last file judges" if last else "")]
    return "\n".join(lines) + "\n"


def about(columns: Mapping[str, Array], renamed: Mapping[str, str]) -> str:
    """Return rows, rate, rest and sensor of a record in words."""
    times = columns["time_s"]
    measured = next(h for h in renamed.values() if not h.startswith(("drive_", "current_")))
    values = columns[measured]
    present = np.flatnonzero(np.isfinite(values))
    moved = np.flatnonzero(np.abs(values[present] - values[present[0]]) > AT_REST * np.ptp(values[present]))
    n_rest = int(present[moved[0]]) if moved.size else 0
    rest = f"{times[n_rest] - times[0]:.3g} s of rest first" if n_rest >= FEWEST_REST_SAMPLES else "no rest first"
    sensor = sensor_of(values[present])
    step = f"steps of {sensor.step:.3g}" if sensor.step else "a fine sensor"
    hold = f", renewed every {sensor.hold} rows" if sensor.hold > 1 else ""
    return f"{times.size} rows at {1.0 / np.median(np.diff(times)):.4g} Hz, {rest}; {measured}: {step}{hold}"
