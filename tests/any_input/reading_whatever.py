"""Small campaigns to be spoilt, and how a reader has to take it: a campaign or one ArmidError."""

import os
import tempfile
import warnings
from pathlib import Path

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from armid.errors import ArmidError
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


def outcome(work):
    """Return what some work gives, None where it is refused with one sentence; any other exception comes out."""
    try:
        return work()
    except ArmidError as error:
        sentence = str(error)
    assert sentence
    assert "\n" not in sentence
    return None


def read_whatever(toml, csv):
    """Read a campaign of these bytes; every warning but that of irregular sampling is an error."""
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", IrregularSamplingWarning)
        (Path(name) / "campaign.toml").write_bytes(toml)
        (Path(name) / "lower.csv").write_bytes(csv)
        campaign = outcome(lambda: read_campaign(name))
    if campaign is not None:
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


def many(number):
    """Return settings with so many inputs, always the same; ARMID_EXAMPLES=n makes n times as many, and new ones."""
    times = os.environ.get("ARMID_EXAMPLES", "")
    return settings(max_examples=number * int(times or 1), derandomize=not times)
