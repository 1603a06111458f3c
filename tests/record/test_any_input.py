"""Whatever the files hold, reading ends in a campaign or in an ArmidError, never in another exception."""

import tempfile
import warnings
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armid.model import ArmidError
from armid.record import Campaign, IrregularSamplingWarning, read_campaign

ARM_TOML = """name = "c00"
plant = "shell_transfer_arm"
effects = ["coulomb"]
gyro_range_deg_s = 200
[parameters.p0]
low = 2.9e6
[constants]
K_p = 250.0
[[records]]
file = "lower.csv"
role = "train"
start_angle_deg = -48.0
target_angle_deg = 22.0
shell = true
supply_V = 28.0
window_s = [0.0, 0.7]
[records.constants]
R = 0.5
"""
AXIS_TOML = """name = "axis"
plant = "driven_axis"
hold = "zero"
[constants]
gravity_moment = 0.5
[[records]]
file = "lower.csv"
role = "train"
restart_s = 0.03
[records.inputs]
u = "drive_V"
"""
TIMES = np.arange(-10, 90) / 1000
SPEEDS = 0.1 * np.sin(40 * TIMES)
ARM_CSV = "time_s,angular_velocity_deg_s\n" + "".join(
    f"{t:.3f},{v:.4f}\n" for t, v in zip(TIMES, SPEEDS, strict=True))  # fmt: skip
AXIS_CSV = "time_s,angular_velocity_rad_s,drive_V,angle_deg\n" + "".join(
    f"{t:.3f},{v:.4f},{v:.2f},{v:.5f}\n" for t, v in zip(TIMES, SPEEDS, strict=True))  # fmt: skip
PIECES = ("nan", "inf", "-inf", "1e308", "-1e308", "5e-324", "1e29", "-0", "0", "", ",", "\n", "\n\n", "\r", "\0", '"',
          "true", "[", "]", "[[records]]", "=", ".", "'", "#", "é", "\u2028", "9" * 400, "0x" + "f" * 400, "time_s",
          "../", "1e-320", "[records.constants]", "-1", "1979-05-27", "{}", "[0, 1]", "\x1a", "\ud7ff")  # fmt: skip

pieces = st.one_of(st.sampled_from(PIECES), st.text(max_size=6), st.floats().map(repr), st.integers().map(str))
edits = st.lists(st.tuples(st.floats(0, 1), st.integers(0, 12), pieces), max_size=5)


def edited(text, changes):
    """Return the text with pieces cut out and others put in their place."""
    for place, cut, piece in changes:
        at = int(place * len(text))
        text = text[:at] + piece + text[at + cut :]
    return text.encode("utf-8", "surrogatepass")


def read_whatever(toml, csv):
    """Read a campaign of these bytes; every warning but that of irregular sampling is an error."""
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", IrregularSamplingWarning)
        (Path(name) / "campaign.toml").write_bytes(toml)
        (Path(name) / "lower.csv").write_bytes(csv)
        try:
            campaign = read_campaign(name)
        except ArmidError as error:
            refusal = str(error)
            campaign = None
    if campaign is None:
        assert "\n" not in refusal
        return None
    assert_sound(campaign)
    return campaign


def assert_sound(campaign):
    """Check what every later stage takes for granted."""
    assert isinstance(campaign, Campaign)
    assert np.isfinite([campaign.plant.scales.effort, campaign.plant.scales.speed]).all()
    for record in campaign.records:
        assert np.isfinite(record.measured).all()
        assert record.n_samples >= 20
        assert 0 < record.noise.effective_fraction <= 1
        assert np.isfinite(record.noise.rms)
        for piece in record.pieces:
            assert np.isfinite(list(piece.manoeuvre.constants.values())).all()
            assert piece.measured.shape == (piece.manoeuvre.n_samples,)
            assert 0 <= piece.window.start < piece.window.stop <= piece.measured.size
            for values in piece.manoeuvre.inputs.values():
                assert values.shape == piece.measured.shape
                assert np.isfinite(values).all()


MANY = settings(max_examples=300, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])


def test_the_originals_read():
    assert read_whatever(ARM_TOML.encode(), ARM_CSV.encode()) is not None
    assert read_whatever(AXIS_TOML.encode(), AXIS_CSV.encode()) is not None


@MANY
@given(edits, edits)
def test_edited_arm(toml, csv):
    read_whatever(edited(ARM_TOML, toml), edited(ARM_CSV, csv))


@MANY
@given(edits, edits)
def test_edited_axis(toml, csv):
    read_whatever(edited(AXIS_TOML, toml), edited(AXIS_CSV, csv))


@MANY
@given(edits)
def test_edited_numbers(csv):
    read_whatever(AXIS_TOML.encode(), edited(AXIS_CSV, csv))


@MANY
@given(edits)
def test_edited_declarations(toml):
    read_whatever(edited(ARM_TOML, toml), ARM_CSV.encode())


@MANY
@given(st.lists(st.tuples(st.floats(), st.floats(), st.floats(), st.floats()), min_size=15, max_size=40), st.booleans())
def test_any_numbers(rows, sort):
    ordered = sorted(rows) if sort else rows
    text = "time_s,angular_velocity_rad_s,drive_V,angle_deg\n" + "".join(",".join(map(repr, r)) + "\n" for r in ordered)
    read_whatever(AXIS_TOML.replace("restart_s = 0.03", "").encode(), text.encode())


@MANY
@given(st.lists(st.integers(1, 10**12), min_size=19, max_size=60), st.sampled_from([1e-12, 1e-3, 1e17]),
       st.sampled_from([1e30, 1.0, 1e-20, 5e-324]))  # fmt: skip
def test_any_increasing_times(steps, unit, size):
    times = np.unique(np.cumsum(np.array(steps, dtype=float)) * unit)
    times -= times[len(times) // 4]
    rows = [f"{t!r},{size * np.cos(i)!r},{size!r},0\n" for i, t in enumerate(times.tolist())]
    header = "time_s,angular_velocity_rad_s,drive_V,angle_deg\n"
    read_whatever(AXIS_TOML.replace("restart_s = 0.03", "").encode(), (header + "".join(rows)).encode())
    arm = ARM_TOML.replace("window_s = [0.0, 0.7]", "").replace("gyro_range_deg_s = 200", "")
    read_whatever(arm.encode(), ("time_s,angular_velocity_deg_s,a,b\n" + "".join(rows)).encode())


@MANY
@given(st.binary(max_size=300), st.binary(max_size=300))
def test_any_bytes(toml, csv):
    read_whatever(toml, ARM_CSV.encode())
    read_whatever(ARM_TOML.encode(), csv)
    read_whatever(ARM_TOML.encode(), b"time_s,angular_velocity_deg_s\n" + csv)
