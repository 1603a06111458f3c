"""The simulated gyro: level, colour and steps of what it writes."""

import numpy as np
import pytest

from stand.arm import Arm
from stand.gyro import Gyro, measure, noise, record_times
from stand.manoeuvre import KNOWN
from stand.motion import Motion
from stand.refusal import RefusalError
from stand.trajectory import Trajectory, simulate

MANY = 100_000


@pytest.fixture(scope="module")
def lowering() -> Trajectory:
    return simulate(Motion(Arm(), KNOWN["lower"]), 0.7)


def drawn(gyro: Gyro) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    return np.asarray(noise(MANY, gyro, np.random.default_rng(7)))


def test_the_noise_has_the_asked_rms_whatever_its_colour() -> None:
    for bandwidth in (0.0, 20.0, 50.0):
        found = drawn(Gyro(noise_deg_s=0.25, noise_bandwidth_hz=bandwidth))
        assert found.size == MANY
        assert found.std() == pytest.approx(0.25, rel=0.03)
        assert abs(found.mean()) < 0.02


def test_white_noise_is_white_and_coloured_noise_stays_in_the_band() -> None:
    share = []
    for bandwidth in (0.0, 50.0):
        power = np.abs(np.fft.rfft(drawn(Gyro(noise_bandwidth_hz=bandwidth)))) ** 2
        hertz = np.fft.rfftfreq(MANY, 1e-3)
        share.append(power[hertz > 100.0].sum() / power.sum())
    assert share[0] == pytest.approx(0.8, abs=0.02)
    assert share[1] < 0.05


def test_a_record_rests_for_100_ms_and_then_follows_the_arm(lowering: Trajectory) -> None:
    time = record_times(lowering)
    speed = measure(lowering, Gyro(0.0, 0.0), 0.0, np.random.default_rng(1))
    assert time[0] == -0.1
    assert time[100] == 0.0
    assert time.size == speed.size == 801
    assert not speed[:101].any()
    assert np.allclose(speed[100:], np.degrees(lowering.states["speed"]), rtol=0, atol=1e-12)


def test_the_bias_shows_at_rest_as_well(lowering: Trajectory) -> None:
    assert measure(lowering, Gyro(0.0, 0.0), 0.3, np.random.default_rng(1))[0] == 0.3


def test_the_record_is_in_whole_steps_and_in_range(lowering: Trajectory) -> None:
    speed = measure(lowering, Gyro(0.25, 0.5, range_deg_s=100.25), 0.0, np.random.default_rng(1))
    assert np.allclose(speed / 0.5, np.round(speed / 0.5), rtol=0, atol=1e-9)
    assert speed.max() == 100.0


def test_the_noise_of_a_record_is_what_was_asked(lowering: Trajectory) -> None:
    shown = measure(lowering, Gyro(0.25, 0.1), 0.0, np.random.default_rng(1))[100:]
    expected = np.hypot(0.25, 0.1 / np.sqrt(12.0))
    assert (shown - np.degrees(lowering.gyro)).std() == pytest.approx(expected, rel=0.1)


def test_the_decimals_write_a_step_exactly() -> None:
    for step, decimals in ((0.1, 1), (0.05, 2), (0.25, 2), (1.0, 0), (0.0, 6), (400 / 4096, 6)):
        assert Gyro(quantisation_deg_s=step).decimals == decimals


def test_refuses_a_gyro_that_cannot_be() -> None:
    wrong = ("noise_deg_s", -1.0), ("quantisation_deg_s", float("nan")), ("noise_bandwidth_hz", 500.0)
    for name, value in (*wrong, ("range_deg_s", 0.0)):
        with pytest.raises(RefusalError):
            Gyro(**{name: value})
