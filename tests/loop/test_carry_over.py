"""What does not carry over is reported: how far records are missed, what is new in them, what may have changed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import armid
from armid.inference.carry_over import Missed, late
from armid.loop.document import conclusion
from armid.model import PLANTS
from synthetic import wheel, write_records

pytestmark = pytest.mark.slow
STEP, N, INERTIA, FRICTION = 0.01, 600, 0.02, 0.05
HEAD = """\
name = "axis"
plant = "driven_axis"
effects = ["viscous"]
hold = "zero"
[parameters.inertia]
low = 0.002
high = 0.2
"""


def table(amplitude, seed, inertia=INERTIA, most=np.inf):
    """Return a record of a motor whose drive gives no more than some effort; exact between samples."""
    rng = np.random.default_rng(seed)
    drive = np.repeat(amplitude * rng.choice([-1.0, -0.4, 0.4, 1.0], N // 20), 20)
    speed, _ = wheel(np.clip(drive, -most, most), STEP, 1.0 / inertia, FRICTION / inertia)
    measured = speed + 0.02 * rng.standard_normal(N)
    return {"time_s": STEP * np.arange(N), "angular_velocity_rad_s": measured, "drive_V": drive}


def closed(folder, n_held=1, **held):
    tables = {"a.csv": table(1.0, 1), "b.csv": table(1.0, 2), "held.csv": table(seed=3, **held)}
    tables |= {f"held_{i}.csv": table(seed=3 + i, **held) for i in range(1, n_held)}
    campaign = write_records(folder / "axis", HEAD, tables, n_held)
    return armid.close_loop(campaign, candidates=["torque_offset"], curve=False)


@pytest.mark.nightly
def test_a_record_of_more_drive_than_any_train_record(tmp_path):
    found = closed(tmp_path, amplitude=4.0, most=2.0)
    assert found.verdict == "does_not_carry_over"
    (said,) = [s for s in found.next_steps if "does not carry over" in s]
    assert said.startswith("held.csv")
    assert "drive_effort reaches" in said
    assert found.after.missed[0].factor > 10.0
    assert conclusion(found).endswith("may itself be faulty, for example late or scaled.")
    assert "faulty" not in conclusion(closed(tmp_path / "two", 2, amplitude=4.0, most=2.0))
    assert found.effects == ()


def test_a_new_range_is_told_in_its_unit_where_that_is_known():
    ranges = {"voltage": (7.39, 5.0, "V"), "duty": (0.616, 0.5, "1"), "something": (3.0, 1.0, "")}
    said = Missed("held.csv", 9.0, (2.0, 1.0), "m/s", ranges, {}).sentence
    assert ": voltage reaches 7.39 V (train: 5), duty reaches 0.616 (train: 0.5), something reaches 3 (train" in said
    plant = replace(PLANTS["driven_axis"], ports={**PLANTS["driven_axis"].ports, "winding": "V"})
    units = {"v": "m/s", "u": "", "voltage": "V", "drive_effort": "N", "time": "s"}
    assert {name: plant.unit_of(name) for name in units} == units


def test_a_parameter_that_changed_between_the_records_and_records_that_are_alike(tmp_path):
    found = closed(tmp_path, amplitude=1.0, inertia=1.1 * INERTIA)
    missed = found.after.missed[0]
    assert next(iter(missed.changes)) == "inertia"
    assert missed.changes["inertia"] == pytest.approx(0.1, abs=0.03)
    assert "A change of inertia by" in missed.sentence
    found = closed(tmp_path / "alike", amplitude=1.0)
    assert found.verdict == "no_discrepancy"
    assert found.after.missed == []


@pytest.mark.parametrize(("lateness", "gain", "found"), [(0.02, 1.0, 0.02), (-0.0315, 1.0, -0.0315), (0.0, 1.2, 0.0)])
def test_a_held_out_record_that_starts_late_is_told(lateness, gain, found):
    times = 0.01 * np.arange(400)
    signal, measured = np.sin(3.0 * times) + times, np.sin(3.0 * (times - lateness)) + times - lateness
    replay = SimpleNamespace(measured=gain * measured, pieces=[None], record=SimpleNamespace(spacing=0.01))
    assert late(replay, gain * measured - signal) == pytest.approx(found, abs=1e-3)
    sentence = Missed("held.csv", 9.0, (2.0, 1.0), "m/s", {}, {}, found).sentence
    assert ("does it start late?" in sentence, "does it start early?" in sentence) == (found > 0.0, found < 0.0)


def test_a_record_that_only_the_doubt_lets_be_missed_confirms_nothing(tmp_path):
    """The friction shows in the long record alone: it is missed by far more than noise, as it may be."""
    short = {name: values[:60] for name, values in table(0.1, 1).items()}
    campaign = write_records(tmp_path / "axis", HEAD, {"a.csv": short, "held.csv": table(1.0, 3)}, 1)
    found = armid.close_loop(campaign, candidates=["torque_offset"], curve=False)
    assert found.verdict != "does_not_carry_over"
    (said,) = [s for s in found.next_steps if "neither confirms nor denies" in s]
    assert "held.csv by" in said
