"""Slopes of a motion with sharp friction tell apart what no motion does: simulations do not confirm it."""

import numpy as np
import pytest

import armid
from armid.loop import close_loop
from armid.model import EFFECTS
from armid.record import read_campaign, write_campaign

pytestmark = pytest.mark.slow
MASS, LEVEL, OFF, TOLERANCE, NOISE = 2.0, 1.5, 1.04, 0.03, 5e-5
TOML = """\
name = "sharp"
plant = "driven_axis"
effects = ["coulomb"]
hold = "zero"
[constants]
gain = {gain}
[tolerances]
gain = {tolerance}
[parameters."coulomb.width"]
fixed = 0.001
"""


def tables(rng):
    times = 0.005 * np.arange(800)
    for _ in range(3):
        waves = zip(rng.uniform(0.3, 3.0, 5), rng.uniform(0.0, 6.0, 5), strict=True)
        force = 2.5 * sum(np.sin(2.0 * np.pi * f * times + p) for f, p in waves) * (times > 0.4)
        yield {"time_s": times, "velocity_m_s": force, "drive_N": force}


def campaign(folder, records, gain):
    entries = [f'[[records]]\nfile = "{file}"\nrole = "train"\n' for file in records]
    text = TOML.format(gain=gain, tolerance=TOLERANCE) + "".join(entries)
    return read_campaign(write_campaign(folder, text, records))


def test_force_mass_and_friction_that_grow_alike_are_not_told_apart_by_sharp_friction(tmp_path):
    rng = np.random.default_rng(2)
    records = {f"r{i}.csv": table for i, table in enumerate(tables(rng))}
    made = armid.simulate(campaign(tmp_path / "made", records, OFF), parameters={"mass": MASS, "coulomb.level": LEVEL})
    for file, table in records.items():
        speed = made.tables[file]["velocity_m_s"]
        table["velocity_m_s"] = speed + NOISE * rng.standard_normal(len(speed))
    declared = campaign(tmp_path / "declared", records, 1.0)
    found = close_loop(declared.model(), declared, {"torque_offset": EFFECTS["torque_offset"]})
    assert (found.verdict, found.steps) == ("no_discrepancy", ())
    for name, truth in (("mass", MASS), ("coulomb.level", LEVEL)):
        estimate = next(e for e in found.before.estimates if e.name == name)
        assert estimate.value == pytest.approx(truth / OFF, rel=0.01)
        assert estimate.high - estimate.low == pytest.approx(2 * 1.96 * TOLERANCE * estimate.value, rel=0.15)
        assert estimate.low < truth < estimate.high
