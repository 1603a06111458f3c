"""Small campaigns to be spoilt, tables of TOML with things taken out, and how a reader has to take it."""

import json
import os
import tempfile
import warnings
from pathlib import Path

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from armid.errors import LONGEST_SENTENCE, ArmidError
from armid.record import Campaign, RecordWarning, read_campaign
from input_texts import LOWERING

ARM_TOML = f"""name = "c00"
plant = "shell_transfer_arm"
effects = ["coulomb"]
gyro_range_deg_s = 200
[parameters.p0]
low = 2.9e6
[constants]
K_p = 250.0
{LOWERING}window_s = [0.0, 0.7]
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
ARM_CSV = "time_s,angular_velocity_deg_s\n" + "".join(f"{t:.3f},{v:.4f}\n" for t, v in zip(TIMES, SPEEDS, strict=True))
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
    assert 0 < len(sentence) <= LONGEST_SENTENCE
    assert "\n" not in sentence
    return None


def read_whatever(toml, csv):
    """Read a campaign of these bytes; every warning but of records and of values far outside is an error."""
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", RecordWarning)
        warnings.filterwarnings("ignore", ".*outside the declared range")
        (Path(name) / "campaign.toml").write_bytes(toml)
        (Path(name) / "lower.csv").write_bytes(csv)
        campaign = outcome(lambda: read_campaign(name))
    if campaign is not None:
        assert_sound(campaign)
    return campaign


def assert_sound(campaign):
    assert isinstance(campaign, Campaign)
    assert np.isfinite([campaign.plant.scales.effort, campaign.plant.scales.speed]).all()
    for record in campaign.records:
        assert np.isfinite(record.measured).all()
        assert record.n_samples >= 20
        assert 0 < record.noise.effective_fraction <= 1
        assert np.isfinite(record.noise.rms)
        for piece in record.pieces:
            assert np.isfinite(list(piece.manoeuvre.constants.values())).all()
            assert piece.of(record.measured).shape == (piece.manoeuvre.n_samples,)
            assert 0 <= piece.window.start < piece.window.stop <= piece.manoeuvre.n_samples
            for values in piece.manoeuvre.inputs.values():
                assert values.shape == (piece.manoeuvre.n_samples,)
                assert np.isfinite(values).all()


def many(number):
    """Return settings with so many inputs, always the same; ARMID_EXAMPLES=n makes n times as many, and new ones."""
    times = os.environ.get("ARMID_EXAMPLES", "")
    return settings(max_examples=number * int(times or 1), derandomize=not times)


# Larger numbers of seeds or cases are allowed, and take memory.
NUMBERS = st.one_of(
    st.integers(-3, 100), st.floats(), st.sampled_from([0, 1, -1, 10**12, 10**400, 1e308, 5e-324, 1e30, float("nan")])
)
WORDS = st.one_of(
    st.sampled_from([
        "", "train", "holdout", "linear", "zero", "lower.csv", "../lower.csv", "/etc/passwd", "a\\b.csv", "\0", "pso",
        "pso+bobyqa", "multistart:lbfgs", "+", "rmse", "coulomb", "whole", "name", "p0", "coulomb.level", "drive_V",
        "u", "driven_axis", "shell_transfer_arm", "table1", "identify", "x" * 300, "[", "é\u2028",
    ]), st.text(max_size=8),
)  # fmt: skip
SCALARS = st.one_of(NUMBERS, WORDS, st.booleans())
VALUES = st.recursive(
    SCALARS, lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(WORDS, inner, max_size=3)),
    max_leaves=6,
)  # fmt: skip


def places(value, path=()):
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else []
    return [p for key in keys for p in ((*path, key), *places(value[key], (*path, key)))]


@st.composite
def mutated(draw, table):
    """Return a table with up to three parts replaced, taken out, put in under another key, or there twice."""
    changed = json.loads(json.dumps(table))
    for _ in range(draw(st.integers(1, 3))):
        there = places(changed)
        if not there:
            break
        *way, last = draw(st.sampled_from(there))
        holder = changed
        for key in way:
            holder = holder[key]
        change(draw, holder, last)
    return changed


def change(draw, holder, key):
    what = draw(st.sampled_from(["replace", "replace", "out", "in", "twice"]))
    if what == "replace":
        holder[key] = draw(VALUES)
    elif what == "out":
        del holder[key]
    elif isinstance(holder, list):
        holder.append(holder[key] if what == "twice" else draw(VALUES))
    else:
        holder[draw(WORDS)] = holder[key] if what == "twice" else draw(VALUES)
