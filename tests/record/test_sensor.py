"""Of the values of a column alone: step and hold of its sensor, and samples that are no data."""

import numpy as np
import pytest

from armid.record.sensor import Sensor, after_sudden, renewed, repeated_samples, sensor_of, wild_samples

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


FEW, NOISE = 1200, 0.005
EARLY = TIMES[:FEW]
NEVER = np.zeros(FEW, dtype=bool)
FINE = Sensor(1e-6)


def signal(seed=3):
    return 2.0 * np.sin(4.0 * EARLY) + NOISE * np.random.default_rng(seed).standard_normal(FEW)


def found(values, noise=NOISE, sensor=FINE, sudden=NEVER, known=False):
    kinds = {**repeated_samples(values, noise, known, sensor, sudden), "spikes": wild_samples(values, noise) & ~sudden}
    return {kind: np.flatnonzero(mask) for kind, mask in kinds.items() if mask.any()}


def test_a_sensor_that_froze_and_one_at_its_limit_are_found_where_they_are():
    stuck = signal()
    stuck[300:340] = stuck[300]
    assert {k: v.tolist() for k, v in found(stuck).items()} == {"stuck": list(range(300, 340))}
    for limit, known in ((1.2, False), (1.5, False), (1.8, True)):
        clipped = np.minimum(signal(), limit)
        assert {k: v.tolist() for k, v in found(clipped, known=known).items()} == {
            "clipped": np.flatnonzero(signal() > limit).tolist()
        }


def test_a_sound_sensor_has_none():
    assert found(signal()) == {}
    assert found(0.05 * np.round(signal() / 0.05), sensor=Sensor(0.05)) == {}
    # a motor that starts at once, reaches an even speed, and stands again; its noise as taken from the motion is large
    even = np.where(EARLY < 0.2, 0.0, 30.0 * (1.0 - np.exp(-(EARLY - 0.2) / 0.03)))
    even = np.where(EARLY > 0.9, 30.0 * np.exp(-(EARLY - 0.9) / 0.03), even)
    assert found(np.round(even / 0.1) * 0.1, noise=0.3, sensor=Sensor(0.1)) == {}
    # a position that friction holds between motions
    slips = np.cumsum(np.maximum(np.sin(12.0 * EARLY) - 0.4, 0.0)) * 1e-2
    assert found(np.round(slips / 1e-3) * 1e-3, noise=1e-3, sensor=Sensor(1e-3)) == {}


def test_motion_at_the_ends_and_what_a_jump_of_an_input_does_are_no_wild_samples():
    noise = 1e-4 * np.random.default_rng(4).standard_normal(FEW)
    assert found(np.sin(40.0 * EARLY + 0.3) + noise, 1e-4) == {}
    target = np.where(np.arange(FEW) < 600, 0.0, 1.0)
    since = np.maximum(np.arange(FEW) - 600.0, 0.0)
    assert found(noise + 12.0 * target * np.exp(-since / 3.0), 1e-4) == {}
    alone = noise + 12.0 * target * np.exp(-since / 0.05)
    assert found(alone, 1e-4, sudden=after_sudden(target)) == {}
    assert {k: v.tolist() for k, v in found(alone, 1e-4).items()} == {"spikes": [600]}


@pytest.mark.parametrize("noise", [0.45, 0.6, 0.9])
def test_equal_values_of_a_coarse_encoder_are_no_fault_and_a_frozen_one_is(noise):
    """In steps; the noise of the rest counts with its rounding. 20 records of 3,000 samples of a slow motion."""
    rng, times = np.random.default_rng(5), np.arange(3000) / 200.0
    rms, sudden = float(np.hypot(noise, 12.0**-0.5)), np.zeros(3000, dtype=np.bool_)
    motion = 40.0 * np.sin(0.4 * times)
    for _ in range(20):
        values = np.rint(motion + noise * rng.standard_normal(3000))
        assert not repeated_samples(values, rms, True, Sensor(step=1.0), sudden)["stuck"].any()
    values[1000:1100] = values[1000]
    assert repeated_samples(values, rms, True, Sensor(step=1.0), sudden)["stuck"].sum() >= 100
