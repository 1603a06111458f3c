"""Public measured sets as campaigns: EMPS, a linear axis, and DFKI's torque-limited pendulum."""

import struct
import zipfile
import zlib
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError, nearest, shown
from armid.record.table import read_table
from armid.record.writer import write_campaign

Array = NDArray[np.float64]
TRAIN, HOLDOUT = "DATA_EMPS", "DATA_EMPS_PULSES"
CUTOFF_HZ = 100.0
FILTER_ORDER = 4
VARIABLES = ("t", "qm", "vir", "gtau")

EMPS_CAMPAIGN = """\
# EMPS (electro-mechanical positioning system), measured: a motor with a ball screw moves a carriage.
# Source: A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, 2019 Workshop on Nonlinear System
# Identification Benchmarks, Eindhoven, 10-12 April 2019 (www.nonlinearbenchmark.org). Cite the authors.
# The set states no licence: do not pass these files on without asking them.
# Velocity: encoder position through a Butterworth low-pass of order {order} at {cutoff:g} Hz, run forward and backward
# (no phase shift), then central differences. drive_V is the controller's output vir, in volt; gain is the file's gtau.
name = "emps"
plant = "driven_axis"

[constants]
gain = {gain!r}  # N/V

[[records]]
file = "{train}.csv"
role = "train"

[[records]]
file = "{holdout}.csv"
role = "holdout"
"""


@dataclass(frozen=True)
class Measurement:
    """Hold what one file of the set tells: times [s], position [m] and drive [V], (n_samples,), and gain [N/V]."""

    times: Array
    position: Array
    drive: Array
    gain: float


def import_emps(folder: str | Path | None, out: str | Path) -> Path:
    """Write the EMPS set as a campaign folder and return it.

    folder: where DATA_EMPS.mat (train) and DATA_EMPS_PULSES.mat (holdout) are; None loads them through the package
    `nonlinear_benchmarks`, which needs the extra `armid[measured]` and, the first time, the internet.
    out: a new or empty folder; each record gets `time_s,velocity_m_s,drive_V,position_m`.

    The velocity comes from the encoder position without phase shift, see `velocity_of`: cutoff 100 Hz.

    Raises ArmidError for a missing or damaged file, a missing variable, and an `out` that holds something already.
    """
    source = downloaded_folder() if folder is None else Path(folder)
    measured = {name: read_measurement(source / f"{name}.mat") for name in (TRAIN, HOLDOUT)}
    gains = [m.gain for m in measured.values()]
    if gains[0] != gains[1]:
        raise ArmidError(f"{HOLDOUT}.mat: gtau is {gains[1]:g}, {gains[0]:g} is expected as in {TRAIN}.mat")
    text = EMPS_CAMPAIGN.format(order=FILTER_ORDER, cutoff=CUTOFF_HZ, gain=gains[0], train=TRAIN, holdout=HOLDOUT)
    return write_campaign(out, text, {f"{name}.csv": columns_of(m) for name, m in measured.items()})


def columns_of(measured: Measurement) -> dict[str, Array]:
    """Return header -> values of a record's CSV file."""
    interval = float(measured.times[-1] - measured.times[0]) / (measured.times.size - 1)
    return {
        "time_s": measured.times,
        "velocity_m_s": velocity_of(measured.position, interval),
        "drive_V": measured.drive,
        "position_m": measured.position,
    }


def velocity_of(position: Array, interval: float) -> Array:
    """Return the velocity [m/s] of an encoder position [m], both (n_samples,), sampled every `interval` seconds.

    A Butterworth low-pass of order 4 with its cutoff at 100 Hz runs forward and backward, so that no phase is shifted
    (-6 dB at 100 Hz), then differences are central. On EMPS it leaves less than 0.01 mm/s of the encoder's 50 nm steps,
    and the best fit of a free-running model is within 0.01 mm/s of the one to unfiltered differences; at 40 Hz it is
    not.
    """
    # half a second to load, which only this import is worth
    from scipy.signal import butter, sosfiltfilt

    sections = butter(FILTER_ORDER, CUTOFF_HZ, fs=1 / interval, output="sos")
    return np.asarray(np.gradient(sosfiltfilt(sections, position), interval, edge_order=2), dtype=np.float64)


def read_measurement(path: Path) -> Measurement:
    """Return what a file of the set tells.

    Raises ArmidError for a file that is missing or no MATLAB file, for a missing variable, for series of different
    length, and for times that are not even or too slow for the velocity filter.
    """
    variables = load_mat(path)
    for name in VARIABLES:
        if name not in variables:
            raise ArmidError(f"{path.name}: variable '{name}' is missing, {', '.join(VARIABLES)} are expected")
    times, position, drive, gain = (numbers(variables[name], name, path.name) for name in VARIABLES)
    if gain.size != 1 or not times.size == position.size == drive.size >= 100:
        raise ArmidError(f"{path.name}: t, qm, vir, gtau hold {times.size}, {position.size}, {drive.size}, {gain.size} "
                         "numbers, three series of one length from 100 on and one number are expected")  # fmt: skip
    intervals = np.diff(times)
    if not 0 < np.max(intervals) < min(1.01 * float(np.min(intervals)), 0.4 / CUTOFF_HZ):
        raise ArmidError(f"{path.name}: the intervals of t run from {np.min(intervals):.6g} to {np.max(intervals):.6g} "
                         f"s, even ones below {0.4 / CUTOFF_HZ:g} s are expected")  # fmt: skip
    return Measurement(times, position, drive, float(gain[0]))


def load_mat(path: Path) -> dict[str, Any]:
    """Return the variables of a MATLAB file."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    if not path.is_file():
        raise ArmidError(f"{shown(str(path))} does not exist, the file {path.name} of the EMPS set is expected")
    damaged = (ValueError, TypeError, KeyError, IndexError, EOFError, OverflowError, NotImplementedError, OSError,
               MatReadError, zlib.error, struct.error)  # fmt: skip
    try:
        variables: dict[str, Any] = loadmat(path)
    except damaged as error:
        raise ArmidError(f"{path.name} is no readable MATLAB file: {shown(str(error))}") from error
    return variables


def numbers(variable: object, name: str, file: str) -> Array:
    """Return a variable as a series of finite numbers, shape (n,)."""
    values = np.asarray(variable)
    if values.dtype.kind not in "iuf" or not np.all(np.isfinite(values)):
        raise ArmidError(f"{file}: variable '{name}' holds no plain finite numbers, which are expected")
    return values.astype(np.float64).ravel()


def downloaded_folder() -> Path:
    """Return where the package `nonlinear_benchmarks` keeps the set, downloading it the first time."""
    try:
        package = import_module("nonlinear_benchmarks")
    except ImportError as error:
        raise ArmidError("the package nonlinear_benchmarks is missing: install armid[measured], or name the folder "
                         f"with {TRAIN}.mat") from error  # fmt: skip
    try:
        files = package.EMPS(data_file_locations=True)
    except (OSError, ValueError, RuntimeError, zlib.error, zipfile.BadZipFile) as error:
        raise ArmidError(f"the EMPS set could not be downloaded: {shown(str(error))}; name the folder with "
                         f"{TRAIN}.mat instead") from error  # fmt: skip
    return Path(files[0]).parent


RECORDS = ("ddp", "direct_collocation")
# What the set calls its columns -> headers of a record.
COLUMNS = {
    "time": "time_s",
    "velocity": "angular_velocity_rad_s",
    "torque": "drive_N_m",
    "position": "angle_rad",
}
GRAVITY = 9.81
# As the set's hardware/testbench_description.md states them: geometry from CAD [kg, m], the motor's rotor [kg m2].
POINT_MASS, ROD_MASS, LENGTH = 0.546, 0.13, 0.5
ROTOR_INERTIA, GEAR = 6.0719e-5, 6
PIECE_S = 1.0

CAMPAIGN = """\
# Torque-limited simple pendulum, measured: one quasi-direct drive AK80-6 (6:1) swings a rod with a mass at its end.
# Source: github.com/dfki-ric-underactuated-lab/torque_limited_simple_pendulum, commit ed17ea2d32a3, folder results/.
# Licence of the set: BSD-3-Clause; cite F. Wiebe et al., JOSS 7(74), 2022, 3884, doi:10.21105/joss.03884.
# Angle 0 hangs (steps of 0.0029 rad). The drive measures the speed (steps of 0.022 rad/s) and tells the torque at its
# output from the current in its windings, so the torque is no measurement at the shaft.
name = "dfki"
plant = "driven_axis"

# ESTIMATES from what the set states (hardware/testbench_description.md): from CAD a point mass of {point_mass:g} kg at
# {length:g} m; rod, fixings and screws {rod_mass:g} kg, taken for a uniform rod; the motor's rotor of {rotor:.5g} kg m2
# behind its gear of {gear}:1. None of them was measured on the moving pendulum.
[constants]
gain = 1.0  # the torque is taken as it was recorded
gravity_moment = {moment:.5g}  # N m = {gravity:g} m/s2 x {mass_moment:.5g} kg m

[parameters.inertia]
fixed = {inertia:.5g}  # kg m2, of which the rotor {reflected:.5g}; free it by --bounds inertia=LOW:HIGH
"""
ENTRY = """
[[records]]
file = "{file}"
role = "{role}"
restart_s = {piece:.1f}
"""


def import_dfki(folder: str | Path, out: str | Path, holdout: str | None = None) -> Path:
    """Write the pendulum's records `ddp` and `direct_collocation` as a campaign folder and return it.

    folder: where ddp_measured.csv and direct_collocation_measured.csv are, each with time, position, velocity, torque.
    out: a new or empty folder; each record gets `time_s,angular_velocity_rad_s,drive_N_m,angle_rad`, numbers unchanged.
    holdout: the record to hold out; None: both train. Records are simulated in pieces of 1 s, as the pendulum runs
    through its unstable upright position.

    The campaign declares gravity and inertia from CAD (a rod and a point mass, estimates) and leaves nothing free:
    m g l = g (m l + m_r l/2), J = m l^2 + m_r l^2/3 + gear^2 J_rotor.

    Raises ArmidError for a missing or unreadable file, a missing column, an unknown record to hold out, and an `out`
    that holds something already.
    """
    if holdout is not None and holdout not in RECORDS:
        raise ArmidError(f"--holdout '{holdout}' is no record of the set, {nearest(holdout, RECORDS)}")
    tables = {f"{name}.csv": measurement(Path(folder), f"{name}_measured.csv") for name in RECORDS}
    return write_campaign(out, campaign_text(holdout), tables)


def campaign_text(holdout: str | None) -> str:
    """Return the text of campaign.toml."""
    mass_moment, reflected = (POINT_MASS + ROD_MASS / 2) * LENGTH, ROTOR_INERTIA * GEAR**2
    text = CAMPAIGN.format(
        point_mass=POINT_MASS, rod_mass=ROD_MASS, length=LENGTH, gravity=GRAVITY, mass_moment=mass_moment,
        moment=GRAVITY * mass_moment, rotor=ROTOR_INERTIA, gear=GEAR, reflected=reflected,
        inertia=(POINT_MASS + ROD_MASS / 3) * LENGTH**2 + reflected,
    )  # fmt: skip
    roles = {name: "holdout" if name == holdout else "train" for name in RECORDS}
    return text + "".join(ENTRY.format(file=f"{n}.csv", role=r, piece=PIECE_S) for n, r in roles.items())


def measurement(folder: Path, file: str) -> dict[str, Array]:
    """Return header -> values of one file of the set.

    Raises ArmidError for a file or column that is missing.
    """
    path = folder / file
    if not path.is_file():
        raise ArmidError(f"{folder}: {file} does not exist there, the folder results/ of the set, or its files in one "
                         "folder, is expected")  # fmt: skip
    columns = read_table(path, file).columns
    for name in COLUMNS:
        if name not in columns:
            raise ArmidError(f"{file}, line 1: column '{name}' is missing, {', '.join(COLUMNS)} are expected")
    return {header: columns[name] for name, header in COLUMNS.items()}
