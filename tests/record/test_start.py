"""The state from which a piece starts: smoothed as far as the noise asks for it, and no further."""

import numpy as np
import pytest

from armid.record import read_campaign
from armid.record.pieces import Track, smoothed, state_at

TIMES = np.arange(1500) / 500
MOTION = 3.0 * np.sin(8.0 * TIMES) + 0.5 * np.sin(25.0 * TIMES)


@pytest.mark.parametrize("index", [0, 700, 1499])
def test_a_signal_without_noise_is_not_smoothed(index):
    assert smoothed(MOTION, index, 0.0) == (MOTION[index], 0.0)
    value, deviation = smoothed(MOTION, index, 1e-12)
    assert value == pytest.approx(MOTION[index], abs=5e-12)
    assert deviation <= 1e-12


def test_a_line_is_smoothed_over_the_longest_window():
    line = 2.0 - 5.0 * TIMES
    end, middle = smoothed(line, 0, 0.1), smoothed(line, 700, 0.1)
    assert end[0] == pytest.approx(2.0, abs=1e-12)
    assert middle[0] == pytest.approx(line[700], abs=1e-12)
    # of degree 1 + 2, the lower of the two degrees: 16/n at the end, 9/4n in the middle, n near 400
    assert end[1] == pytest.approx(0.1 * np.sqrt(16 / 370), rel=0.1)
    assert middle[1] == pytest.approx(0.1 * np.sqrt(9 / 4 / 370), rel=0.1)


@pytest.mark.parametrize("noise", [1e-3, 1e-2, 0.1])
@pytest.mark.parametrize("index", [0, 333, 700])
def test_the_deviation_is_honest(noise, index):
    """Over 300 noises on a motion that turns and jerks, errors are as large as they are said to be."""
    rng = np.random.default_rng(2)
    found = [smoothed(MOTION + rng.normal(0.0, noise, TIMES.size), index, noise) for _ in range(300)]
    shares = np.array([(value - MOTION[index]) / deviation for value, deviation in found])
    assert 0.8 < np.sqrt(np.mean(shares**2)) < 1.25
    assert np.mean([deviation for _, deviation in found]) < noise


def test_a_kink_ends_the_window():
    kinked = np.where(TIMES < 1.0, 0.0, 40.0 * (TIMES - 1.0))
    rng = np.random.default_rng(3)
    errors = [smoothed(kinked + rng.normal(0.0, 0.01, TIMES.size), 500, 0.01)[0] for _ in range(100)]
    assert np.sqrt(np.mean(np.square(errors))) < 0.02


def test_steps_of_a_sensor_at_rest_do_not_average_out():
    state, deviation = state_at({"start_position": Track(np.full(300, 0.005), 0.0029, 0.01)}, 100)
    assert state["start_position"] == pytest.approx(0.005)
    assert deviation["start_position"] == pytest.approx(0.01 / np.sqrt(12))


def test_a_clean_record_starts_exactly(write_axis, axis_columns):
    pieces = read_campaign(write_axis("restart_s = 1.0\n")).records[0].pieces
    for piece in pieces:
        assert piece.manoeuvre.constants["start_speed"] == axis_columns["velocity_m_s"][piece.start_index]
        assert set(piece.start_deviation) == {"start_position", "start_speed"}


def test_a_machine_at_rest_has_no_measured_start(write):
    assert read_campaign(write()).records[0].pieces[0].start_deviation == {}
