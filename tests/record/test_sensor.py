"""Step and hold of a sensor are found from the values as they were read, and nothing is held that is not."""

import numpy as np
import pytest

from armid.record.sensor import Sensor, renewed, sensor_of

N = 4000
TIMES = 1e-3 * np.arange(N)
WHEEL = 10.0 * np.sin(3.0 * TIMES) + 5.0 * np.sin(7.3 * TIMES)


def noisy(size=0.2, seed=0):
    return WHEEL + size * np.random.default_rng(seed).standard_normal(N)


@pytest.mark.parametrize("step", [0.0, 0.25])
@pytest.mark.parametrize("hold", [2, 3, 5, 8, 18, 50])
def test_a_held_value(hold, step):
    held = np.repeat(noisy()[::hold], hold)[:N]
    held = np.round(held / step) * step if step else held
    sensor = sensor_of(held)
    assert (sensor.step, sensor.hold) == (pytest.approx(step), hold)
    new = renewed(held, hold)
    assert new.sum() == pytest.approx(N / hold, rel=0.01)
    assert new[np.flatnonzero(np.diff(held)) + 1].all()


@pytest.mark.parametrize("period", [4.5, 10.4, 18.05])
def test_a_hold_of_another_clock(period):
    held = noisy()[(np.floor(np.arange(N) / period) * period).astype(int)]
    sensor = sensor_of(held)
    assert abs(sensor.hold - period) <= 1.0
    assert renewed(held, sensor.hold).sum() == pytest.approx(N / period, rel=0.03)


@pytest.mark.parametrize("values", [
    np.round(WHEEL / 0.5) * 0.5, np.round(noisy() / 0.5) * 0.5, noisy(), np.round(50.0 * TIMES / 0.1) * 0.1,
    np.round(np.cumsum(WHEEL) * 1e-3 / 0.01) * 0.01, np.zeros(N), np.repeat(np.arange(20.0), 200),
], ids=["coarse", "coarse and noisy", "fine", "even ramp", "encoder", "still", "stairs"])  # fmt: skip
def test_what_is_not_held(values):
    assert sensor_of(values).hold == 1
    assert renewed(values, 1).all()


def test_steps():
    assert sensor_of(np.round(WHEEL, 2)).step == pytest.approx(0.01)
    assert sensor_of(WHEEL) == sensor_of(noisy()) == sensor_of(np.ones(10)) == Sensor()
    # printed with few digits, and with levels that were not all seen
    printed = np.round(np.round(WHEEL / 0.0238) * 0.0238, 4)
    assert sensor_of(printed).step == pytest.approx(0.0238, rel=1e-4)
    assert sensor_of(np.random.default_rng(1).integers(0, 40_000, 600) * 0.01).step == pytest.approx(0.01)
