"""Of the values of a column alone: step and hold of its sensor, samples that are no data, noise with a known answer."""

import numpy as np
import pytest
from scipy.signal import lfilter

from armid.record.sensor import (
    Sensor,
    after_sudden,
    difference_rms,
    noise_of,
    renewed,
    repeated_samples,
    rest_between,
    sensor_of,
    wild_samples,
)

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


def test_a_sensor_that_froze_and_one_at_its_limit_are_found_and_a_sound_one_has_no_fault():
    stuck = signal()
    stuck[300:340] = stuck[300]
    assert {k: v.tolist() for k, v in found(stuck).items()} == {"stuck": list(range(300, 340))}
    for limit, known in ((1.2, False), (1.5, False), (1.8, True)):
        clipped = np.minimum(signal(), limit)
        assert {k: v.tolist() for k, v in found(clipped, known=known).items()} == {
            "clipped": np.flatnonzero(signal() > limit).tolist()
        }
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


INTERVAL = 0.001
MOTION = np.sin(3 * np.arange(2000) * INTERVAL) * 2.5


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def test_white_rest_of_any_length(rng):
    noise = noise_of(0.02 + rng.normal(0, 0.005, 20_000), MOTION)
    assert noise.source == "rest"
    assert noise.n_samples == 20_000
    assert noise.mean == pytest.approx(0.02, abs=2e-4)
    assert noise.rms == pytest.approx(0.005, rel=0.03)
    assert noise.effective_fraction > 0.95
    fractions = [noise_of(rng.normal(0, 1, 100), MOTION).effective_fraction for _ in range(200)]
    assert np.median(fractions) == 1.0
    alternating = np.diff(rng.normal(0, 1, 20_001))
    assert noise_of(alternating, MOTION).effective_fraction == 1.0


def test_a_sensor_that_is_stuck_tells_nothing_of_its_noise_and_a_silent_rest_that_of_its_steps(rng):
    signal = np.round((MOTION + rng.normal(0, 0.01, MOTION.size)) / 0.002) * 0.002
    stuck = signal.copy()
    stuck[500:1300] = stuck[500]
    assert difference_rms(stuck) == pytest.approx(difference_rms(signal), rel=0.1)
    assert difference_rms(MOTION) < 1e-12
    # a quiet sensor of coarse steps repeats itself, and is not stuck: its noise is that of its steps
    coarse = np.round(MOTION / 0.05) * 0.05
    assert difference_rms(coarse) < 0.01
    assert noise_of(np.zeros(0), coarse).rms >= 0.05 / np.sqrt(12) * (1 - 1e-9)
    for level in (0.0, 0.1):
        noise = noise_of(np.full(100, level), MOTION)
        assert noise.effective_fraction == 1.0
        # the rounding of the largest value is left
        assert 0.0 < noise.rms < 1e-15
        assert noise.mean == pytest.approx(level)
    noise = noise_of(np.zeros(100), np.round(MOTION, 2))
    assert noise.rms == pytest.approx(0.01 / np.sqrt(12))


@pytest.mark.parametrize("time_constant", [0.002, 0.01])
def test_coloured_rest(rng, time_constant):
    phi = np.exp(-INTERVAL / time_constant)
    rest = lfilter([0.005 * np.sqrt(1 - phi**2)], [1, -phi], rng.normal(size=100_000))
    noise = noise_of(rest, MOTION)
    assert noise.rms == pytest.approx(0.005, rel=0.05)
    assert noise.effective_fraction == pytest.approx((1 - phi) / (1 + phi), rel=0.1)


@pytest.mark.parametrize("n_rest", [0, 49, 100])
def test_few_rest_samples_or_such_as_read_one_value_leave_the_differences(rng, n_rest):
    noise = noise_of(np.zeros(n_rest), MOTION + rng.normal(0, 0.005, MOTION.size))
    assert (noise.source, noise.n_samples) == ("differences", MOTION.size)
    assert n_rest == 100 or noise.mean is None
    assert noise.rms == pytest.approx(0.005, rel=0.1)
    jerky = MOTION + np.where(np.arange(2000) % 400 < 60, np.sin(np.arange(2000)), 0.0)
    assert difference_rms(jerky + rng.normal(0, 0.005, 2000)) == pytest.approx(0.005, rel=0.3)


def test_a_rest_between_motions_tells_the_noise_where_the_input_is_still_too(rng):
    still = np.zeros(3000, dtype=bool)
    still[1000:1800] = True
    speed = np.where(still, 0.0, 3.0 * np.sin(np.arange(3000) / 40.0))
    # the machine runs down first
    speed[1000:1200] = 2.0 * np.exp(-np.arange(200) / 20.0)
    measured = speed + rng.normal(0.02, 0.005, 3000)
    rest = rest_between(measured, still, True)
    assert rest.size >= 200
    assert np.std(rest) == pytest.approx(0.005, rel=0.2)
    noise = noise_of(rest, measured)
    assert (noise.source, noise.mean) == ("rest", pytest.approx(0.02, abs=2e-3))
    # under drive a stick is not a rest, an even speed is not a standstill, and a still input does not hold a machine
    assert rest_between(measured, np.zeros(3000, dtype=bool), True).size == 0
    assert rest_between(measured + 1.0, still, True).size == 0
    assert rest_between(3.0 * np.sin(np.arange(3000) / 40.0), still, True).size == 0
    assert rest_between(measured + 1.0, still, False).size >= 200


def test_a_machine_that_swings_freely_is_not_at_rest(rng):
    time = np.arange(1600) / 200.0
    still, noise = np.ones(time.size, dtype=bool), rng.normal(0, 0.001, time.size)
    for period, memory in ((1.2, 20.0), (1.2, 1e9), (0.1, 0.5), (0.05, 5.0), (7.0, 30.0)):
        swing = np.exp(-time / memory) * np.sin(2 * np.pi * time / period) + noise
        assert rest_between(swing, still, is_speed=False).size < time.size
        assert rest_between(swing[:100], still[:100], is_speed=False).size == 0
    # one that has come to rest tells the noise then
    tail = rest_between(np.exp(-time / 0.1) * np.sin(2 * np.pi * time / 0.5) + noise, still, is_speed=False)
    assert tail.size in (400, 800)
    assert np.std(tail) == pytest.approx(0.001, rel=0.1)
    # one that still runs down, seen by a coarse encoder, is not
    down = np.round(-2.0 * np.exp(-np.arange(137) / 40.0) + rng.normal(0, 0.25, (100, 137)))
    assert max(rest_between(one, still[:137], is_speed=False).size for one in down) < 137
    # noise of a filtered sensor is a rest, in nearly all of 200
    coloured = lfilter([1.0], [1.0, -0.8], rng.normal(0, 1, (200, 1000)))
    kept = [rest_between(one, still[:1000], is_speed=False).size == 1000 for one in coloured]
    assert np.mean(kept) > 0.97


def test_a_coarse_sensor_tells_its_noise_by_the_motion_where_its_step_hides_it_at_rest(rng):
    motion = 30.0 * MOTION + 8.0 * np.sin(9 * np.arange(MOTION.size) / 200.0)
    for own in (0.3, 0.4, 0.5):
        rests = np.round(rng.uniform(-0.5, 0.5, (20, 1)) + rng.normal(0, own, (20, 150)))
        moved = np.round(motion + rng.normal(0, own, (20, motion.size)))
        sized = [noise_of(rest, one).rms for rest, one in zip(rests, moved, strict=True)]
        assert np.array(sized) == pytest.approx(np.sqrt(own**2 + 1 / 12), rel=0.13)


def test_an_even_speed_between_two_steps_and_one_that_a_record_begins_with_are_at_no_limit(rng):
    """As a counting sensor reads a motor: the motion seems noisy, as neighbouring values take turns."""
    speed = 15.5 * (1.0 - np.exp(-np.maximum(EARLY - 0.2, 0.0) / 0.03))
    turns = np.where(EARLY > 0.25, 0.4 * (-1.0) ** np.arange(FEW), 0.0)
    turns[300::50] = 0.4
    # as one sample of a few goes astray, a value stands for longer than noise leaves it by chance
    turns[620:630] = 0.4
    counted = np.rint(speed + turns)
    for known in (True, False):
        assert found(counted, noise=0.6, sensor=Sensor(1.0), known=known) == {}
    begun = np.concatenate([np.full(60, 4.0), 4.0 + 20.0 * (1.0 - np.exp(-np.arange(200) / 20.0))])
    even = np.round(begun / 0.1) * 0.1
    assert found(even, noise=0.2, sensor=Sensor(0.1), sudden=np.zeros(260, dtype=np.bool_)) == {}
