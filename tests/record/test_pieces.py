"""Pieces: the state from which one starts, smoothed as far as the noise asks for it, and which samples count."""

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.record import read_campaign
from armid.record.record import RecordWarning
from armid.record.start import Track, n_still, smoothed, state_at
from input_texts import LOWERING

TIMES = np.arange(1500) / 500
MOTION = 3.0 * np.sin(8.0 * TIMES) + 0.5 * np.sin(25.0 * TIMES)


def test_without_noise_nothing_is_smoothed_a_line_over_the_longest_window_and_a_kink_ends_it():
    for index in (0, 700, 1499):
        assert smoothed(MOTION, index, 0.0) == (MOTION[index], 0.0)
        value, deviation = smoothed(MOTION, index, 1e-12)
        assert (value, deviation <= 1e-12) == (pytest.approx(MOTION[index], abs=5e-12), True)
    line = 2.0 - 5.0 * TIMES
    end, middle = smoothed(line, 0, 0.1), smoothed(line, 700, 0.1)
    assert end[0] == pytest.approx(2.0, abs=1e-12)
    assert middle[0] == pytest.approx(line[700], abs=1e-12)
    # of degree 1 + 2, the lower of the two degrees: 16/n at the end, 9/4n in the middle, n near 400
    assert end[1] == pytest.approx(0.1 * np.sqrt(16 / 370), rel=0.1)
    assert middle[1] == pytest.approx(0.1 * np.sqrt(9 / 4 / 370), rel=0.1)
    kinked = np.where(TIMES < 1.0, 0.0, 40.0 * (TIMES - 1.0))
    rng = np.random.default_rng(3)
    errors = [smoothed(kinked + rng.normal(0.0, 0.01, TIMES.size), 500, 0.01)[0] for _ in range(100)]
    assert np.sqrt(np.mean(np.square(errors))) < 0.02


def test_a_machine_at_rest_starts_at_rest_and_the_deviation_is_honest():
    """While no input changes and the signal stands still its slope is 0; a motion under a still input keeps its own."""
    rng, rest = np.random.default_rng(6), 60
    begun = np.concatenate([np.zeros(rest), MOTION[:400]]) + rng.normal(0.0, 0.1, rest + 400)
    held = [np.append(np.zeros(rest), np.ones(400))]
    assert n_still(held) == rest
    assert n_still([]) == 0
    slope, deviation = smoothed(begun, 0, 0.1, slope=True, still=rest)
    assert (slope, deviation) == (0.0, pytest.approx(0.1 * np.sqrt(12.0 / rest**3)))
    assert abs(smoothed(begun, 0, 0.1, still=rest)[0]) < 3.0 * 0.1 / np.sqrt(rest)
    moving = 3.0 * TIMES[:rest] + rng.normal(0.0, 0.01, rest)
    assert smoothed(moving, 0, 0.01, slope=True, still=rest)[0] == pytest.approx(3.0 / 500, rel=0.1)
    # Over 300 noises on a motion that turns and jerks, errors are as large as they are said to be.
    for noise, index in ((1e-3, 0), (1e-3, 700), (1e-2, 333), (0.1, 0), (0.1, 333)):
        rng = np.random.default_rng(2)
        found = [smoothed(MOTION + rng.normal(0.0, noise, TIMES.size), index, noise) for _ in range(300)]
        shares = np.array([(value - MOTION[index]) / deviation for value, deviation in found])
        assert 0.8 < np.sqrt(np.mean(shares**2)) < 1.25
        assert np.mean([deviation for _, deviation in found]) < noise


def test_a_coarse_rest_tells_a_speed_and_its_steps_do_not_average_out():
    for seed in range(100):
        values = np.round(np.random.default_rng(seed).normal(0.0, 0.4, 140))
        slope, deviation = smoothed(values, 0, 0.49, slope=True)
        assert deviation < 0.05
        assert abs(slope) < 5.0 * deviation
    state, deviation = state_at({"start_position": Track(np.full(300, 0.005), 0.0029, 0.01)}, 100)
    assert state["start_position"] == pytest.approx(0.005)
    assert deviation["start_position"] == pytest.approx(0.01 / np.sqrt(12))


@pytest.mark.parametrize(("window", "expected"), [
    ("[0, 0.7]", slice(0, 701)), ("[0.1004, 0.2004]", slice(101, 201)), ("[-1.0, 0.5]", slice(0, 501)),
    ("[0.6, 1e30]", slice(600, 1201)),
])  # fmt: skip
def test_both_ends_count(write, window, expected):
    folder = write()
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text() + f"window_s = {window}\n")
    record = read_campaign(folder).records[0]
    assert record.pieces[0].window == expected
    assert record.n_samples == expected.stop - expected.start
    assert record.duration == pytest.approx((expected.stop - expected.start - 1) * 0.001)
    assert record.measured.size == record.pieces[0].manoeuvre.n_samples == 1201


def test_a_caller_overrides_the_window_with_which_the_simulation_can_end(write):
    folder = write()
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text() + "window_s = [0.5, 0.6]\n")
    campaign = read_campaign(folder)
    wide = campaign.with_window(0.0, 0.7)
    assert campaign.records[0].pieces[0].window == slice(500, 601)
    assert wide.records[0].pieces[0].window == slice(0, 701)
    assert wide.with_window(0.1, 0.2).records[0].pieces[0].window == slice(100, 201)
    with pytest.warns(RecordWarning, match=r"window 0:700: the longest record ends at 1.201 s, a window in seconds"):
        assert campaign.with_window(0.0, 700.0).records[0].pieces[0].window == slice(0, 1201)
    piece = wide.with_window(0.3, 0.7).records[0].pieces[0].until_window_end()
    assert piece.manoeuvre.n_samples == 701
    assert piece.window == slice(300, 701)


@pytest.mark.parametrize(("begin", "end", "found"), [
    (0.5, 0.5, r"\[0.5, 0.5\]"), (0.7, 0.0, r"\[0.7, 0\]"), (5.0, 6.0, "0 samples"), (-0.1, -0.01, "0 samples"),
    (0.1, 0.118, "19 samples"),
])  # fmt: skip
def test_refused_windows(write, begin, end, found):
    folder = write()
    with pytest.raises(ArmidError, match=found):
        read_campaign(folder).with_window(begin, end)
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text() + f"window_s = [{begin}, {end}]\n")
    with pytest.raises(ArmidError, match=f"campaign.toml, record 'lower.csv'.*{found}"):
        read_campaign(folder)


def test_a_window_without_motion_or_without_a_piece_is_refused(write, write_axis, arm_columns):
    speed = np.where(arm_columns["time_s"] > 1.0, 3.0, arm_columns["angular_velocity_deg_s"])
    toml = f'name = "c00"\nplant = "shell_transfer_arm"\nmost_lost = 0.5\n\n{LOWERING}'
    folder = write(toml, lower={**arm_columns, "angular_velocity_deg_s": speed})
    with pytest.raises(ArmidError, match=r"lower\.csv is constant in the window"):
        read_campaign(folder).with_window(1.1, 1.2)
    with pytest.raises(ArmidError, match=r"no piece of move\.csv"):
        read_campaign(write_axis("restart_s = 0.026\nwindow_s = [1.0, 1.025]\n"))
