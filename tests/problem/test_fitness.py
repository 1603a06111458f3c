"""Fitnesses: what they are bound to, how records join, and that no NaN leaves."""

import sys
from functools import partial

import numpy as np
import pytest
from numba import njit

from armid.problem.fitness import FITNESS, Fitness, as_fitness, chi_square, relative_mean_square
from commands import refusing

OF_RECORD = {"interval": 0.001, "noise": 0.2}


def records():
    """Return two records of different length: measured (n_samples,) and simulated (5, n_samples)."""
    rng = np.random.default_rng(1)
    series = [np.sin(np.linspace(0.0, turns, n)) * size for n, turns, size in ((401, 7.0, 1.0), (150, 4.0, 9.0))]
    return [(x, x + 0.1 * np.abs(x).max() * rng.standard_normal((5, x.size))) for x in series]


def test_a_plain_function_becomes_a_fitness_and_what_it_returns_is_checked():
    x, rows = records()[0]
    mine = as_fitness("mine", lambda measured, simulated: np.abs(simulated - measured).max(axis=1))
    assert (mine.name, mine.join, mine.finish) == ("mine", "duration", None)
    np.testing.assert_array_equal(mine(x, rows), np.abs(rows - x).max(axis=1))
    assert as_fitness("other", mine) is mine
    compiled = as_fitness("compiled", njit(lambda measured, simulated: simulated[:, 0] - measured[0] + 1.0))
    np.testing.assert_array_equal(compiled(x, rows), rows[:, 0] - x[0] + 1.0)
    rows = np.vstack([rows, np.full((1, x.size), np.nan)])
    values = as_fitness("mine", lambda measured, simulated: [1.0, np.nan, np.inf, -np.inf, 2, 3])(x, rows)
    np.testing.assert_array_equal(values, [1.0, np.inf, np.inf, np.inf, 2.0, np.inf])
    for bad in (np.zeros(5), np.zeros((6, 1)), 1.0, "a", None, [1.0, "b"]):
        with pytest.raises(ValueError, match=r"fitness 'mine' returned .*, expected"):
            as_fitness("mine", lambda measured, simulated, bad=bad: bad)(x, rows)


def test_arguments_bind_by_name_and_order_does_not_matter():
    def mine(simulated, noise, *, measured, interval, power=2.0):
        return np.full(len(simulated), interval * noise * power * measured.size)

    x, rows = records()[0]
    fitness = as_fitness("mine", mine)
    assert fitness.asks == ("simulated", "noise", "measured", "interval")
    np.testing.assert_allclose(fitness(x, rows, **OF_RECORD), 0.001 * 0.2 * 2.0 * 401)
    with pytest.raises(ValueError, match="'mine' asks for the noise of the record"):
        fitness(x, rows, interval=0.001)


@pytest.mark.parametrize(("function", "sentence"), [
    (lambda measured, simulatd: 0, "asks for 'simulatd', did you mean 'simulated'?"),
    (lambda measured, simulated, intervall: 0, "asks for 'intervall', did you mean 'interval'?"),
    (lambda measured, simulated, intervl=0.001: 0, "asks for 'intervl', did you mean 'interval'?"),
    (lambda measured, simulated, zzz: 0, "known: measured, simulated, interval, noise"),
    (lambda simulated: 0, "has no argument 'measured'"),
    (lambda measured, simulated, /: 0, "asks for 'measured'"),
    (lambda *series: 0, "asks for 'series'"),
    (lambda measured, simulated, **rest: 0, "asks for 'rest'"),
    (3.0, "is 3.0, expected a function"),
])  # fmt: skip
def test_refuses_a_function_that_a_record_cannot_feed(function, sentence):
    with refusing(sentence):
        as_fitness("mine", function)


def test_refuses_noise_that_is_none_a_measurement_of_zero_and_an_unknown_join():
    x, rows = records()[0]
    for noise in (None, 0.0):
        with pytest.raises(ValueError, match="noise"):
            FITNESS["likelihood"](x, rows, noise=noise)
    for noise in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="expected an rms above 0"):
            chi_square(*records()[0], noise)
    with pytest.raises(ValueError, match="zero throughout"):
        relative_mean_square(np.zeros(3), np.ones((1, 3)))
    with pytest.raises(ValueError, match="joins records by 'durations', did you mean 'duration'"):
        Fitness("mine", lambda measured, simulated: 0, join="durations")


def noisy():
    """Return a sine with noise, and the sine itself, 1.1 times it, and 10 ms later, 1 kHz."""
    times = 0.001 * np.arange(500)
    sine = np.sin(2.0 * np.pi * 8.0 * times)
    later = np.sin(2.0 * np.pi * 8.0 * (times - 0.01))
    return sine + 0.01 * np.random.default_rng(3).standard_normal(500), np.array([sine, 1.1 * sine, later])


def test_the_mean_absolute_error_and_hubers_loss_as_they_are_defined():
    x, rows = noisy()
    np.testing.assert_allclose(FITNESS["mae"](x, rows), np.abs(x - rows).mean(axis=1))
    ratios = (x - rows) / 0.01
    losses = np.where(np.abs(ratios) <= 1.345, 0.5 * ratios**2, 1.345 * (np.abs(ratios) - 0.5 * 1.345))
    np.testing.assert_allclose(FITNESS["huber"](x, rows, noise=0.01), losses.mean(axis=1))
    # one spike moves the square a hundred times as far
    spiked = x + 1e3 * (np.arange(x.size) == 77)
    grown = [FITNESS[name](spiked, rows, noise=0.01)[0] / FITNESS[name](x, rows, noise=0.01)[0]
             for name in ("huber", "likelihood")]  # fmt: skip
    assert grown[1] > 100.0 * grown[0]


def test_a_spectrum_knows_amplitudes_and_no_phase():
    x, rows = noisy()
    at, larger, later = np.sqrt(FITNESS["spectrum"](x, rows))
    assert larger > 5.0 * at
    assert later < 2.0 * at
    # a sine in the middle of a bin has its amplitude in it and half of it in each neighbour
    sine, none = rows[0], np.zeros((1, 500))
    assert FITNESS["spectrum"](sine, none)[0] * 251 == pytest.approx(1.0 + 2.0 * 0.5**2, rel=0.02)


def test_warped_time_forgives_what_is_late_and_names_the_package_that_it_needs(monkeypatch):
    x, rows = noisy()
    values = np.sqrt(FITNESS["dtw"](x, rows, interval=0.001))
    squares = np.sqrt(FITNESS["rmse"](x, rows))
    assert values[2] < 0.2 * squares[2]
    assert (values <= squares).all()
    # nothing may be moved: what is left is the rmse
    alone = Fitness("stiff", partial(FITNESS["dtw"].function, reach=0.0))
    np.testing.assert_allclose(alone(x, rows, interval=0.001), squares**2)
    monkeypatch.setitem(sys.modules, "dtaidistance.dtw", None)
    with pytest.raises(ValueError, match="needs the package dtaidistance, which is not installed"):
        FITNESS["dtw"](*noisy(), interval=0.001)
