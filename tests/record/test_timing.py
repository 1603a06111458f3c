"""Even grids out of uneven times."""

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.model import Manoeuvre
from armid.record import IrregularSamplingWarning, read_campaign
from armid.record.resample import moved_onto_grid, onto_grid, share_at_once, timing_of


def motion(times):
    return np.where(times > 0, np.sin(3 * times) ** 2, 0.0)


def read(write, times, **more):
    columns = {"time_s": times, "angular_velocity_rad_s": motion(times), **more}
    return read_campaign(write(lower=columns)).records[0]


@pytest.mark.parametrize(("rate", "digits"), [(1000, 9), (300, 3), (800, 4), (1024, 6)])
def test_rounded_times_are_even(write, rate, digits):
    """Rounded to 1 ms they are up to 15 % of an interval off."""
    times = np.round(np.arange(-100, 1000) / rate, digits)
    record = read(write, times)
    assert record.irregularity is None
    np.testing.assert_array_equal(record.measured, motion(times)[100:])
    np.testing.assert_allclose(record.times, times[100:], atol=0.0005)
    # the slope of the times, and no rounded median
    assert record.manoeuvre.interval == pytest.approx(1 / rate, rel=2e-5)


def test_a_grid_that_misses_zero_slow_drift_and_a_lost_first_sample_are_mended_without_a_word(write):
    times = (np.arange(-100, 1000) + 0.4) / 1000
    record = read(write, times)
    assert record.irregularity is None
    assert record.times[0] == 0.0
    assert record.manoeuvre.interval == pytest.approx(0.001)
    assert record.rest.size == 100
    assert record.pieces[0].window == slice(0, record.measured.size)
    np.testing.assert_allclose(record.measured, motion(record.times), atol=3e-5)
    index = np.arange(2000)
    record = read(write, index / 1000 * (1 + 1e-7 * index))
    assert record.irregularity is None
    np.testing.assert_allclose(record.measured, motion(record.times), atol=2e-6)
    record = read(write, np.arange(1, 1000) / 1000)
    assert record.times[0] == 0.0
    assert record.pieces[0].window == slice(1, 1000)
    np.testing.assert_allclose(record.measured[1:], motion(np.arange(1, 1000) / 1000), atol=1e-12)


def test_irregular_times_are_resampled_with_a_warning(write):
    rng = np.random.default_rng(2)
    times = np.sort(np.arange(1200) / 1000 + rng.uniform(-0.0002, 0.0002, 1200) * (np.arange(1200) > 0))
    times = np.delete(times, slice(600, 609))
    with pytest.warns(IrregularSamplingWarning) as caught:
        record = read(write, times, drive_V=times)
    message = str(caught[0].message)
    assert len(caught) == 1
    for fragment in ("lower.csv", "% of 1190 intervals", "at t = 0.599", "a large gap", "resampled"):
        assert fragment in message
    assert record.irregularity.share > 0.5
    assert 9 < record.irregularity.largest_gap < 11
    np.testing.assert_allclose(np.diff(record.times), record.manoeuvre.interval)
    np.testing.assert_allclose(record.measured, motion(record.times), atol=3e-4)
    assert record.unused == ("drive_V",)
    # the last sample of the grid may lie after the last row
    np.testing.assert_allclose(record.columns["drive_V"][:-1], record.times[:-1], atol=1e-9)


def test_a_held_input_keeps_its_impulse():
    times = np.array([0.0, 0.1, 0.2, 0.32, 0.4] + [0.5 + 0.1 * i for i in range(20)])
    with pytest.warns(IrregularSamplingWarning):
        timing = timing_of(times, False, "x.csv")
    assert timing.finer == 1
    values = np.where(times < 0.32, 0.0, 1.0)
    held = onto_grid(values, times, timing, "zero")
    # the interval from 0.3 to 0.4 s sees the second value for 0.8 of its time, and is 0.02 s off the middle of that
    np.testing.assert_allclose(held[:6], [0.0, 0.0, 0.0, 0.8 - 0.08, 1.0 + 0.08, 1.0], atol=2e-3)
    assert set(held[[0, 1, 2, *range(5, held.size)]]) == {0.0, 1.0}
    rng = np.random.default_rng(4)
    times = np.cumsum(rng.uniform(0.5, 1.5, 300)) * 0.01
    with pytest.warns(IrregularSamplingWarning):
        timing = timing_of(times, False, "x.csv")
    values = rng.normal(size=300)
    assert timing.finer == 4
    held = onto_grid(values, times, timing, "zero")
    ends = timing.start + timing.interval * np.arange(1, timing.n_samples + 1)
    told = np.interp(ends, times, np.append(0.0, np.cumsum(values[:-1] * np.diff(times))))
    sums, within = timing.interval * np.cumsum(held), np.diff(np.searchsorted(times, ends)) == 0
    tolerance = 3e-5 * np.max(np.abs(values))
    # where a value changes, an eighth of the change is a sample late at most
    np.testing.assert_allclose(sums[1:-1][within[:-1]], told[1:-1][within[:-1]], atol=tolerance)
    np.testing.assert_allclose(sums[:-1], told[:-1], atol=tolerance + timing.interval * np.ptp(values) / 8)
    step = timing.interval / 1000
    fine = times[0] + step * (0.5 + np.arange(1000 * (timing.n_samples - 1)))
    true = values[np.searchsorted(times, fine, side="right") - 1]
    off = np.repeat(held[:-1], 1000) - true
    # what it does to a free mass: on average its position is not where it was some time before
    positions = step**2 * np.cumsum(np.cumsum(off))
    late = float(np.sum(positions * true) / np.sum(true**2)) / timing.interval**2
    assert abs(late) < 0.01


@pytest.mark.parametrize("part", [0.2, 0.5, 0.9])
def test_a_held_input_comes_later_by_a_part_of_a_sample(part):
    """A free mass has the right speed at the samples; whole samples are exact, and begin as was last known."""
    values = np.repeat([0.0, 2.0, -1.0, 3.0], 5)
    grid, fine = Manoeuvre(0.1, 20, {}, {"u": values}, "zero"), 1000
    there = np.repeat(values, fine)[np.maximum(np.arange(20 * fine) - round(part * fine), 0)]
    speed = np.append(0.0, np.cumsum(there))[::fine][:20] / fine
    later = grid.later(part).inputs["u"]
    np.testing.assert_allclose(np.append(0.0, np.cumsum(later))[:20], speed, atol=1e-9)
    np.testing.assert_allclose(grid.later(1.0).inputs["u"][1:], values[:-1])
    part_of_it = grid.part(6, 8, {})
    assert np.array_equal(part_of_it.later(3.0).inputs["u"], values[3:11])
    assert np.array_equal(part_of_it.later(-2.0).inputs["u"], [*values[8:14], values[13], values[13]])


def test_noise_stays_white_on_the_grid():
    """A line between two rows would take a third off its variance and correlate neighbours by a fifth and more."""
    rng = np.random.default_rng(7)
    times = 0.005 * np.arange(20_000) + np.append(0.0, rng.uniform(-1e-3, 1e-3, 19_999))
    with pytest.warns(IrregularSamplingWarning):
        timing = timing_of(times, False, "x.csv")
    assert timing.finer == 4
    every = np.ones(times.size, dtype=bool)
    noise, data = moved_onto_grid(rng.normal(size=times.size), times, timing, every)
    assert np.sum(data) == times.size
    noise = noise[data]
    assert np.std(noise) == pytest.approx(1.0, abs=0.02)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 0.03
    moved, _ = moved_onto_grid(np.sin(9.0 * times), times, timing, every)
    grid = timing.start + timing.interval * np.arange(timing.n_samples)
    # a line between two rows is off by 9^2 0.005^2 / 8
    np.testing.assert_allclose(moved[data], np.sin(9.0 * grid)[data], atol=1.3e-4)


def test_what_jumps_with_a_held_input_jumps_where_the_input_does_on_the_grid():
    """A current follows its voltage at once, a speed later."""
    rng, step, n = np.random.default_rng(8), 0.01, 900
    times = step * np.arange(n) + np.append(0.0, rng.uniform(-3e-3, 3e-3, n - 1))
    voltage = np.repeat(rng.normal(0.0, 6.0, n // 30), 30)
    with pytest.warns(IrregularSamplingWarning):
        timing = timing_of(times, False, "x.csv")

    def speed_at(places):
        """Speed of a motor with a time constant of 0.1 s, its voltage held from each row on."""
        speed = np.append(0.0, np.zeros(n - 1))
        for k in range(n - 1):
            speed[k + 1] = voltage[k] + (speed[k] - voltage[k]) * np.exp(-(times[k + 1] - times[k]) / 0.1)
        last = np.maximum(np.searchsorted(times, places, side="right") - 1, 0)
        return voltage[last] + (speed[last] - voltage[last]) * np.exp(-(places - times[last]) / 0.1)

    every, grid = np.ones(n, dtype=bool), timing.grid()
    held = onto_grid(voltage, times, timing, "zero")
    noise = 0.01 * rng.standard_normal(n)
    current, data = moved_onto_grid(2.0 * (voltage - speed_at(times)) + noise, times, timing, every, [(voltage, held)])
    assert np.std((current - 2.0 * (held - speed_at(grid)))[data]) < 0.02
    assert share_at_once([2.0 * (voltage - speed_at(times)) + noise], [voltage[np.newaxis]]) == pytest.approx(
        2.0, abs=0.01
    )
    speed, data = moved_onto_grid(speed_at(times) + noise, times, timing, every, [(voltage, held)])
    alone, _ = moved_onto_grid(speed_at(times) + noise, times, timing, every)
    assert np.std((speed - alone)[data]) < 0.005
    assert abs(share_at_once([speed_at(times) + noise], [voltage[np.newaxis]])) < 0.01


@pytest.mark.parametrize(("times", "found"), [
    (np.arange(1000, 2000) / 1000, "first sample is at 1 s"),
    (np.arange(-1000, 0) / 1000, "0 samples after t = 0"),
    (np.arange(25) * 1e-10, "apart"),
    (np.concatenate([np.arange(100) / 1000, [1e9]]), "unmeasured"),
    (np.arange(19) / 1000, "19 samples"),
])  # fmt: skip
def test_refused(write, times, found):
    columns = {"time_s": times, "angular_velocity_rad_s": np.cos(np.arange(times.size))}
    folder = write(lower=columns)
    with pytest.raises(ArmidError, match=found):
        read_campaign(folder)
