"""DFKI's torque-limited simple pendulum, measured, as a campaign of `driven_axis`."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armid.model import ArmidError, nearest
from armid.record.table import read_table
from armid.record.writer import write_campaign

Array = NDArray[np.float64]
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
