"""Public measured sets as campaigns: EMPS, a linear axis, and DFKI's torque-limited pendulum."""

import struct
import zipfile
import zlib
from collections.abc import Collection
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError
from scipy.signal import butter, sosfiltfilt

from armid.errors import DataError, nearest, quoted
from armid.model import Array
from armid.record.campaign import write_campaign
from armid.record.table import read_table

EMPS_FILES = "DATA_EMPS", "DATA_EMPS_PULSES"
CUTOFF_HZ, FILTER_ORDER = 100.0, 4
EMPS_VARIABLES = ("t", "qm", "vir", "gtau")

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

DFKI_RECORDS = ("ddp", "direct_collocation")
# What the set calls its columns -> headers of a record.
DFKI_COLUMNS = {
    "time": "time_s", "velocity": "angular_velocity_rad_s", "torque": "drive_N_m", "position": "angle_rad",
}  # fmt: skip
GRAVITY, PIECE_S = 9.81, 1.0
# As the set's hardware/testbench_description.md states them: geometry from CAD [kg, m], the motor's rotor [kg m2].
POINT_MASS, ROD_MASS, LENGTH = 0.546, 0.13, 0.5
ROTOR_INERTIA, GEAR = 6.0719e-5, 6

DFKI_CAMPAIGN = """\
# Torque-limited simple pendulum, measured: one quasi-direct drive AK80-6 (6:1) swings a rod with a mass at its end.
# Source: github.com/dfki-ric-underactuated-lab/torque_limited_simple_pendulum, commit ed17ea2d32a3, folder results/.
# Licence of the set: BSD-3-Clause; cite F. Wiebe et al., JOSS 7(74), 2022, 3884, doi:10.21105/joss.03884.
# Angle 0 hangs (steps of 0.0029 rad). The drive measures the speed (steps of 0.022 rad/s) and tells the torque at its
# output from the current in its windings, so the torque is not a measurement at the shaft.
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
DFKI_ENTRY = """
[[records]]
file = "{file}"
role = "{role}"
restart_s = {piece:.1f}
"""


def import_emps(folder: str | Path | None, out: str | Path) -> Path:
    """Write the EMPS set as a campaign folder and return it; each record gets `time_s,velocity_m_s,drive_V,position_m`.

    folder: where DATA_EMPS.mat (train) and DATA_EMPS_PULSES.mat (holdout) are; None loads them through the package
    `nonlinear_benchmarks`, which needs the extra `armid[measured]` and, the first time, the internet.
    """
    source = downloaded_folder() if folder is None else Path(folder)
    measured = {name: read_emps(source / f"{name}.mat") for name in EMPS_FILES}
    (gain, _), (other, _) = measured.values()
    train, holdout = EMPS_FILES
    if other != gain:
        raise DataError(f"{holdout}.mat: gtau is {other:g}, {gain:g} is expected as in {train}.mat")
    text = EMPS_CAMPAIGN.format(order=FILTER_ORDER, cutoff=CUTOFF_HZ, gain=gain, train=train, holdout=holdout)
    return write_campaign(out, text, {f"{name}.csv": columns for name, (_, columns) in measured.items()})


def read_emps(path: Path) -> tuple[float, dict[str, Array]]:
    """Return gain [N/V], and header -> values of a record's CSV file, from one file of the set."""
    if not path.is_file():
        raise DataError(f"{quoted(str(path))} does not exist, the file {path.name} of the EMPS set is expected")
    damaged = (ValueError, TypeError, KeyError, IndexError, EOFError, OverflowError, NotImplementedError, OSError,
               MatReadError, zlib.error, struct.error)  # fmt: skip
    try:
        variables: dict[str, Any] = loadmat(path)
    except damaged as error:
        raise DataError(f"{path.name} is not a readable MATLAB file: {quoted(str(error))}") from error
    for name in EMPS_VARIABLES:
        if name not in variables:
            raise DataError(f"{path.name}: variable '{name}' is missing, {', '.join(EMPS_VARIABLES)} are expected")
    series = []
    for name in EMPS_VARIABLES:
        values = np.asarray(variables[name])
        if values.dtype.kind not in "iuf" or not np.all(np.isfinite(values)):
            raise DataError(f"{path.name}: variable '{name}' holds no plain finite numbers, which are expected")
        series.append(values.astype(np.float64).ravel())
    times, position, drive, gain = series
    if gain.size != 1 or not times.size == position.size == drive.size >= 100:
        raise DataError(f"{path.name}: t, qm, vir, gtau hold {times.size}, {position.size}, {drive.size}, {gain.size} "
                        "numbers, three series of one length from 100 on and one number are expected")  # fmt: skip
    intervals = np.diff(times)
    if not 0 < np.max(intervals) < min(1.01 * float(np.min(intervals)), 0.4 / CUTOFF_HZ):
        raise DataError(f"{path.name}: the intervals of t run from {np.min(intervals):.6g} to {np.max(intervals):.6g} "
                        f"s, even ones below {0.4 / CUTOFF_HZ:g} s are expected")  # fmt: skip
    velocity = velocity_of(position, float(times[-1] - times[0]) / (times.size - 1))
    return float(gain[0]), {"time_s": times, "velocity_m_s": velocity, "drive_V": drive, "position_m": position}


def velocity_of(position: Array, interval: float) -> Array:
    """Return the velocity [m/s] of an encoder position [m], both (n_samples,), sampled every `interval` seconds.

    A Butterworth low-pass of order 4 with its cutoff at 100 Hz runs forward and backward, so that no phase is shifted,
    then differences are central. On EMPS the best fit of a free-running model is within 0.01 mm/s of the one to
    unfiltered differences; at 40 Hz it is not.
    """
    sections = butter(FILTER_ORDER, CUTOFF_HZ, fs=1 / interval, output="sos")
    return np.asarray(np.gradient(sosfiltfilt(sections, position), interval, edge_order=2), dtype=np.float64)


def downloaded_folder() -> Path:
    """Return where the package `nonlinear_benchmarks` keeps the set, downloading it the first time."""
    train = EMPS_FILES[0]
    try:
        package = import_module("nonlinear_benchmarks")
    except ImportError as error:
        raise DataError("the package nonlinear_benchmarks is missing: install armid[measured], or name the folder "
                        f"with {train}.mat") from error  # fmt: skip
    try:
        files = package.EMPS(data_file_locations=True)
    except (OSError, ValueError, RuntimeError, zlib.error, zipfile.BadZipFile) as error:
        raise DataError(f"the EMPS set could not be downloaded: {quoted(str(error))}; name the folder with "
                        f"{train}.mat instead") from error  # fmt: skip
    return Path(files[0]).parent


def import_dfki(folder: str | Path, out: str | Path, holdout: str | None = None) -> Path:
    """Write the pendulum's records `ddp` and `direct_collocation` as a campaign folder and return it.

    Each record gets `time_s,angular_velocity_rad_s,drive_N_m,angle_rad`, numbers unchanged, and is simulated in pieces
    of 1 s, as the pendulum runs through its unstable upright position. The campaign declares gravity and inertia from
    CAD (a rod and a point mass, estimates) and leaves nothing free: m g l = g (m l + m_r l/2), J = m l^2 + m_r l^2/3 +
    gear^2 J_rotor. folder: where ddp_measured.csv and direct_collocation_measured.csv are. holdout: None: both train.
    """
    if holdout is not None and holdout not in DFKI_RECORDS:
        raise DataError(f"holdout '{holdout}' is not a record of the set, {nearest(holdout, DFKI_RECORDS)}")
    tables = {f"{name}.csv": read_dfki(Path(folder), f"{name}_measured.csv") for name in DFKI_RECORDS}
    mass_moment, reflected = (POINT_MASS + ROD_MASS / 2) * LENGTH, ROTOR_INERTIA * GEAR**2
    text = DFKI_CAMPAIGN.format(
        point_mass=POINT_MASS, rod_mass=ROD_MASS, length=LENGTH, gravity=GRAVITY, mass_moment=mass_moment,
        moment=GRAVITY * mass_moment, rotor=ROTOR_INERTIA, gear=GEAR, reflected=reflected,
        inertia=(POINT_MASS + ROD_MASS / 3) * LENGTH**2 + reflected,
    )  # fmt: skip
    for name in DFKI_RECORDS:
        role = "holdout" if name == holdout else "train"
        text += DFKI_ENTRY.format(file=f"{name}.csv", role=role, piece=PIECE_S)
    return write_campaign(out, text, tables)


def read_dfki(folder: Path, file: str) -> dict[str, Array]:
    path = folder / file
    if not path.is_file():
        raise DataError(f"{folder}: {file} does not exist there, the folder results/ of the set, or its files in one "
                        "folder, is expected")  # fmt: skip
    columns = read_columns(path, file, DFKI_COLUMNS)
    return {header: columns[name] for name, header in DFKI_COLUMNS.items()}


def read_columns(path: Path, file: str, names: Collection[str]) -> dict[str, Array]:
    """Return the named columns of a CSV file; refuse a file or column that is missing. file: how messages name it."""
    columns = read_table(path, file).columns
    for name in names:
        if name not in columns:
            raise DataError(f"{file}, line 1: column '{name}' is missing, {', '.join(names)} are expected")
    return {name: columns[name] for name in names}
