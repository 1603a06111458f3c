"""Samples that are no data are found in the values of a column alone; those of a sound sensor are kept."""

import numpy as np
import pytest

from armid.record.sensor import Sensor, after_sudden, repeated_samples, wild_samples

N, NOISE = 1200, 0.005
TIMES = 1e-3 * np.arange(N)
NEVER = np.zeros(N, dtype=bool)
FINE = Sensor(1e-6)


def signal(seed=3):
    return 2.0 * np.sin(4.0 * TIMES) + NOISE * np.random.default_rng(seed).standard_normal(N)


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


@pytest.mark.parametrize("at", [0, 1, 2, 500, N - 2, N - 1])
def test_one_wild_sample_is_found_wherever_it_is(at):
    values = signal()
    values[at] += 1e4
    assert {k: v.tolist() for k, v in found(values).items()} == {"spikes": [at]}


def test_a_sound_sensor_has_none():
    assert found(signal()) == {}
    assert found(0.05 * np.round(signal() / 0.05), sensor=Sensor(0.05)) == {}
    # a motor that starts at once, reaches an even speed, and stands again; its noise as taken from the motion is large
    even = np.where(TIMES < 0.2, 0.0, 30.0 * (1.0 - np.exp(-(TIMES - 0.2) / 0.03)))
    even = np.where(TIMES > 0.9, 30.0 * np.exp(-(TIMES - 0.9) / 0.03), even)
    assert found(np.round(even / 0.1) * 0.1, noise=0.3, sensor=Sensor(0.1)) == {}
    # a position that friction holds between motions
    slips = np.cumsum(np.maximum(np.sin(12.0 * TIMES) - 0.4, 0.0)) * 1e-2
    assert found(np.round(slips / 1e-3) * 1e-3, noise=1e-3, sensor=Sensor(1e-3)) == {}


def test_motion_at_the_ends_and_what_a_jump_of_an_input_does_are_no_wild_samples():
    noise = 1e-4 * np.random.default_rng(4).standard_normal(N)
    assert found(np.sin(40.0 * TIMES + 0.3) + noise, 1e-4) == {}
    target = np.where(np.arange(N) < 600, 0.0, 1.0)
    since = np.maximum(np.arange(N) - 600.0, 0.0)
    assert found(noise + 12.0 * target * np.exp(-since / 3.0), 1e-4) == {}
    alone = noise + 12.0 * target * np.exp(-since / 0.05)
    assert found(alone, 1e-4, sudden=after_sudden(target)) == {}
    assert {k: v.tolist() for k, v in found(alone, 1e-4).items()} == {"spikes": [600]}
