"""The simulated arm: the references, the undeclared effects and their limits, the late controller, the gyro."""

import math
from dataclasses import fields
from functools import cache

import numpy as np
import pytest

from stand import RefusalError
from stand.arm import KNOWN, Arm
from stand.effects import Effects
from stand.gyro import Gyro, measure, noise, record_times
from stand.motion import Motion, simulate

SIZES = {
    "coulomb": 40.0, "stribeck": 40.0, "viscous": 15.0, "drag": 15.0, "tilt_deg": 2.0, "worm_loss": 0.3,
    "flux_saturation": 150.0, "brush_drop": 1.0, "winding_heating": 2e-5, "supply_sag": 0.01, "gas_heat_loss": 2.0,
    "tachometer_lag": 0.005, "tachometer_offset_deg_s": 2.0, "gyro_bandwidth_hz": 40.0, "gyro_bias_deg_s": 0.3,
    "gyro_scale": 0.005, "rocking_hz": 10.0, "seal_friction": 250.0, "asymmetric_friction": 40.0, "torque_offset": 15.0,
    "worm_braking": 1.0, "worm_speed": 0.1, "drive_gain": 0.05, "flux_atan": 150.0, "flux_root": 150.0,
    "line_loss": 2e4, "tachometer_ripple": 0.05, "controller_delay": 0.005, "controller_period": 0.01, "cam_bump": 60.0,
    "motor_fade": 0.005, "piston_stiction": 800.0, "cable_spring": 150.0, "pressure_friction": 0.08,
    "base_compliance": 1e-4, "slipping_ripple": 50.0, "sway": 30.0, "dahl": 40.0, "lugre": 40.0, "bouc_wen": 40.0,
    "cogging": 30.0, "torque_droop": 200.0, "drive_dead_zone": 40.0, "actuator_lag": 0.02, "drive_compliance": 2e-6,
}  # fmt: skip
# What the package has not; tests/engine/test_oracles.py holds the others to it.
NAMELESS = ("asymmetric_friction", "worm_braking", "flux_root", "cam_bump",
            "motor_fade", "piston_stiction", "cable_spring", "pressure_friction", "base_compliance", "slipping_ripple",
            "sway")  # fmt: skip


@cache
def moved(effects=None, name="lower", duration_s=1.2):
    return simulate(Motion(Arm(), KNOWN[name], effects or Effects()), duration_s)


def test_a_record_that_ends_before_the_switch_has_none_and_no_shell_does_not_rock():
    short = moved(duration_s=0.3)
    assert short.switch_s is None
    assert np.abs(short.gyro - moved().gyro[:301]).max() < 1e-9
    assert np.array_equal(moved(Effects(rocking_hz=10.0), "empty").gyro, moved(name="empty").gyro)
    assert {each.name for each in fields(Effects) if "of" not in each.metadata} == set(SIZES)


@pytest.mark.parametrize("name", NAMELESS)
@pytest.mark.slow
def test_an_effect_of_the_stand_alone_moves_the_arm_and_vanishes_near_its_null(name):
    near = 1e7 if name.startswith("flux") else 1e-6 * SIZES[name]
    changed, vanished = (moved(Effects(**{name: size})).gyro - moved().gyro for size in (SIZES[name], near))
    assert np.abs(changed).max() > math.radians(0.25)
    assert np.abs(vanished).max() < 1e-5


def test_refuses_an_effect_too_stiff_to_integrate_and_to_leave_the_travel(monkeypatch):
    monkeypatch.setattr("stand.motion.MOST_RATES", 20_000)
    with pytest.raises(RefusalError, match="too stiff"):
        moved(Effects(tachometer_lag=1e-9), "inside_E", 0.1)
    with pytest.raises(RefusalError, match="leave the travel"):
        simulate(Motion(Arm(p0=9e6), KNOWN["lower"]), 1.2)


FINE = 1e-4
"""Step of the plain integrator [s], a whole part of every delay here."""


@cache
def moved_late(name, told=()):
    return simulate(Motion(Arm(), KNOWN[name], Effects(**dict(told))), 1.0, 1e-9)


def plainly_late(name, delay):
    """Integrate by the midpoint rule, with a plain list of the states gone by; speeds at 1 kHz [rad/s]."""
    motion = Motion(Arm(), KNOWN[name])
    back, target = round(delay / FINE), motion.manoeuvre.target
    gone = [np.array(list(motion.start.values()))] * (back + 1)
    closed = False
    for _ in range(round(1.0 / FINE)):
        now, late, next_late = gone[-1], gone[-1 - back], gone[-back]
        closed = closed or abs(target - late[0]) <= motion.arm.switch_distance
        half = now + 0.5 * FINE * np.array(motion.rates(now, closed, late))
        gone.append(now + FINE * np.array(motion.rates(half, closed, 0.5 * (late + next_late))))
    return np.array(gone)[back :: round(1e-3 / FINE), 1]


@pytest.mark.parametrize("delay", [0.002, 0.010])
@pytest.mark.parametrize(("name", "near"), [("lower", 4e-3), ("inside_E", 4e-4)])
@pytest.mark.slow
def test_a_delay_agrees_with_a_plain_integrator_that_remembers(name, near, delay):
    """Allow for the switch of the plain one, which comes up to a step late."""
    found = moved_late(name, (("controller_delay", delay),)).gyro
    assert np.abs(found - plainly_late(name, delay)).max() < near
    assert np.abs(found - moved_late(name).gyro).max() > 10.0 * near


def test_a_sampled_controller_closes_its_loop_at_the_next_sample():
    plain, held = moved_late("lower").switch_s, moved_late("lower", (("controller_period", 0.012),)).switch_s
    assert plain <= held < plain + 0.012
    assert held / 0.012 == pytest.approx(round(held / 0.012))


MANY = 100_000


def drawn(gyro):
    return np.asarray(noise(MANY, gyro, np.random.default_rng(7)))


def test_the_noise_has_the_asked_rms_and_its_colour():
    for bandwidth in (0.0, 20.0, 50.0):
        found = drawn(Gyro(noise_deg_s=0.25, noise_bandwidth_hz=bandwidth))
        assert found.size == MANY
        assert found.std() == pytest.approx(0.25, rel=0.03)
        assert abs(found.mean()) < 0.02
    share = []
    for bandwidth in (0.0, 50.0):
        power = np.abs(np.fft.rfft(drawn(Gyro(noise_bandwidth_hz=bandwidth)))) ** 2
        hertz = np.fft.rfftfreq(MANY, 1e-3)
        share.append(power[hertz > 100.0].sum() / power.sum())
    assert share[0] == pytest.approx(0.8, abs=0.02)
    assert share[1] < 0.05


def test_a_record_rests_for_100_ms_follows_the_arm_and_is_in_whole_steps_and_in_range():
    lowering = moved(duration_s=0.7)
    time = record_times(lowering)
    speed = measure(lowering, Gyro(0.0, 0.0), 0.0, np.random.default_rng(1))
    assert time[0] == -0.1
    assert time[100] == 0.0
    assert time.size == speed.size == 801
    assert not speed[:101].any()
    assert measure(lowering, Gyro(0.0, 0.0), 0.3, np.random.default_rng(1))[0] == 0.3
    assert np.allclose(speed[100:], np.degrees(lowering.states["speed"]), rtol=0, atol=1e-12)
    speed = measure(lowering, Gyro(0.25, 0.5, range_deg_s=100.25), 0.0, np.random.default_rng(1))
    assert np.allclose(speed / 0.5, np.round(speed / 0.5), rtol=0, atol=1e-9)
    assert speed.max() == 100.0
