"""EMPS, a measured linear axis (Janot, Gautier, Brunot 2019), as a campaign of `driven_axis`."""

import struct
import zipfile
import zlib
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.model import ArmidError
from armid.record.shown import shown
from armid.record.writer import write_campaign

Array = NDArray[np.float64]
TRAIN, HOLDOUT = "DATA_EMPS", "DATA_EMPS_PULSES"
CUTOFF_HZ = 100.0
FILTER_ORDER = 4
VARIABLES = ("t", "qm", "vir", "gtau")

CAMPAIGN = """\
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
    text = CAMPAIGN.format(order=FILTER_ORDER, cutoff=CUTOFF_HZ, gain=gains[0], train=TRAIN, holdout=HOLDOUT)
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
    from scipy.signal import butter, sosfiltfilt  # noqa: PLC0415

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
    from scipy.io import loadmat  # noqa: PLC0415
    from scipy.io.matlab import MatReadError  # noqa: PLC0415

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
