"""Which samples fitness and errors see."""

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.record import read_campaign


@pytest.mark.parametrize(("window", "expected"), [
    ("[0.0, 0.7]", slice(0, 701)), ("[0, 0.7]", slice(0, 701)), ("[0.25, 0.7]", slice(250, 701)),
    ("[0.1004, 0.2004]", slice(101, 201)), ("[-1.0, 0.5]", slice(0, 501)), ("[0.6, 99.0]", slice(600, 1201)),
    ("[0.0, 1e30]", slice(0, 1201)),
])  # fmt: skip
def test_both_ends_count(write, window, expected):
    folder = write()
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text() + f"window_s = {window}\n")
    record = read_campaign(folder).records[0]
    assert record.pieces[0].window == expected
    assert record.n_samples == expected.stop - expected.start
    assert record.duration == pytest.approx((expected.stop - expected.start - 1) * 0.001)
    assert record.measured.size == record.pieces[0].measured.size == 1201


def test_a_caller_overrides_the_window(write):
    folder = write()
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text() + "window_s = [0.5, 0.6]\n")
    campaign = read_campaign(folder)
    wide = campaign.with_window(0.0, 0.7)
    assert campaign.records[0].pieces[0].window == slice(500, 601)
    assert wide.records[0].pieces[0].window == slice(0, 701)
    assert wide.with_window(0.1, 0.2).records[0].pieces[0].window == slice(100, 201)


def test_what_is_simulated_can_end_with_the_window(write):
    piece = read_campaign(write()).with_window(0.3, 0.7).records[0].pieces[0].until_window_end()
    assert piece.manoeuvre.n_samples == piece.measured.size == 701
    assert piece.window == slice(300, 701)


@pytest.mark.parametrize(("begin", "end", "found"), [
    (0.5, 0.5, r"\[0.5, 0.5\]"), (0.7, 0.0, r"\[0.7, 0\]"), (5.0, 6.0, "0 samples"), (-0.1, -0.01, "0 samples"),
    (0.1, 0.118, "19 samples"),
])  # fmt: skip
def test_refused(write, begin, end, found):
    folder = write()
    with pytest.raises(ArmidError, match=found):
        read_campaign(folder).with_window(begin, end)
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text() + f"window_s = [{begin}, {end}]\n")
    with pytest.raises(ArmidError, match=f"campaign.toml, record 'lower.csv'.*{found}"):
        read_campaign(folder)


def test_a_window_without_motion_is_refused(write, arm_columns):
    speed = np.where(arm_columns["time_s"] > 1.0, 3.0, arm_columns["angular_velocity_deg_s"])
    folder = write(lower={**arm_columns, "angular_velocity_deg_s": speed})
    with pytest.raises(ArmidError, match=r"lower\.csv is constant in the window"):
        read_campaign(folder).with_window(1.1, 1.2)


def test_a_window_that_no_restarted_piece_fills_is_refused(write_axis):
    with pytest.raises(ArmidError, match=r"no piece of move\.csv"):
        read_campaign(write_axis("restart_s = 0.026\nwindow_s = [1.0, 1.025]\n"))
