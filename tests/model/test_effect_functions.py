"""The plain functions of the library against closed forms and conservation laws."""

import inspect

import numpy as np
import pytest

from armid.model import EFFECTS
from armid.model.effects import control, drive, friction, sensor
from armid.model.plants import flexible_link

RNG = np.random.default_rng(4)
FORMS = [pytest.param(form, id=f"{form.name}-{form.form}".rstrip("-"))
         for effect in EFFECTS.values() for form in effect.every_form if form.name != "gas_heat_loss"]  # fmt: skip


def drawn(function, **known):
    """Arguments of a function: those that are known, random ones for the others."""
    return {name: known.get(name, RNG.uniform(0.1, 2.0, 6)) for name in inspect.signature(function).parameters}


def not_late(effect, known):
    """Return what is known with random arguments of the delayed signals, each late signal equal to its signal."""
    for delay in effect.delays:
        arguments = drawn(delay.of, **known)
        known = known | arguments | {delay.name: delay.of(**arguments)}
    return known


@pytest.mark.parametrize("effect", FORMS)
def test_nothing_is_added_at_null_and_rates_are_finite(effect):
    """Exactly: whatever the plant does and whatever the states are; a switch that waits for nothing has switched."""
    nulls = {p.name: p.null for p in effect.parameters if p.null is not None}
    closed = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    known = not_late(effect, nulls | {"closed": closed, "acting": 1.0})
    for function in effect.adds.values():
        assert np.all(function(**drawn(function, **known)) == 0.0)
    for state in effect.states:
        assert np.all(np.isfinite(state.rate(**drawn(state.rate, closed=closed))))


def test_without_loss_of_heat_the_pressure_is_the_plant_s():
    known = {"deviation": 0.0, "loss_rate": 0.0}
    assert np.all(drive.deviation_rate(**drawn(drive.deviation_rate, **known)) == 0.0)


def test_worm_loses_at_standstill_and_nothing_at_speed():
    for lost in (drive.worm_speed_loss, drive.agma_loss):
        loss = -lost(np.array([0.0, 0.6, 300.0]), 100.0, 0.2, 0.6, 1e-9) / 100.0
        np.testing.assert_allclose(loss, [0.2, 0.2 / np.e, 0.0], atol=1e-4)


def test_load_is_what_is_held():
    """At rest in balance the drive holds the load: friction is a share of either; without a load, of half the drive."""
    held = friction.load_friction_torque(1.0, 300.0, 0.1, 1e-6, 1e-6, load_effort=-300.0)
    assert held == pytest.approx(-30.0)
    assert friction.load_friction_torque(1.0, 300.0, 0.1, 1e-6, 1e-6) == pytest.approx(-15.0)


@pytest.mark.parametrize("frequency", [1.0, 10.0, 20.0])
@pytest.mark.parametrize("delay", [0.0005, 0.004, 0.01])
def test_delay_is_a_dead_time_at_the_frequencies_of_the_arm(frequency, delay):
    """The response of the linear equations at s = i w: the speed late, and the angle, its integral, late too."""
    s = 2j * np.pi * frequency
    longest = max(delay, 2e-3)
    smooth = 1.0 / (1.0 + 0.5 * longest * s + longest**2 * s**2 / 12)
    assert control.slope_rate(delay, 0.0, 1.0, smooth, s * smooth) == pytest.approx(s**2 * smooth)
    late = np.exp(-s * delay)
    allowed = abs(s * longest) ** 5 / 700 + abs(s) ** 2 * max(2e-3 - delay, 0.0) * delay / 1.9
    assert abs(1.0 + control.late_feedback(delay, 0.0, 1.0, smooth, s * smooth) - late) <= allowed
    angle = 1.0 / s - control.late_command(1, 1, 1.0, 0, 0, 0, 1.0, 0, 1, 1, 0, delay, 0.0, smooth, s * smooth)
    assert abs(s * angle - late) <= allowed


@pytest.mark.parametrize("frequency", [1.0, 10.0, 20.0])
@pytest.mark.parametrize(("delay", "period"), [(0.0, 0.008), (0.0, 0.02), (0.003, 0.004), (0.006, 0.004)])
def test_a_sampled_control_is_a_hold_after_a_dead_time(frequency, delay, period):
    s = 2j * np.pi * frequency
    held = (1.0 - np.exp(-s * period)) / (s * period) * np.exp(-s * delay)
    x = s * control.filter_time(delay, period)
    smooth = 1.0 / (1.0 + 0.5 * x + x**2 / 12)
    found = 1.0 + control.late_feedback(delay, period, 1.0, smooth, s * smooth)
    angle = 1.0 / s - control.late_command(1, 1, 1.0, 0, 0, 0, 1.0, 0, 1, 1, 0, delay, period, smooth, s * smooth)
    assert abs(found - held) <= (abs(x) ** 4 / 500 if delay == 0.0 else abs(x) ** 3 / 200)
    assert s * angle == pytest.approx(found)


@pytest.mark.parametrize(("delay", "period", "switch"), [
    (0.004, 0.0, 0.1083), (0.0, 0.008, 0.112), (0.0, 0.03, 0.12), (0.007, 0.008, 0.112), (0.008, 0.008, 0.12),
])  # fmt: skip
def test_a_sampled_control_switches_at_a_sample(delay, period, switch):
    """The loop closes at 0.1043 s: the first sample after the dead time is waited for."""
    assert control.still_to_wait(1.0, delay, period, 0.0, 0.1043) == pytest.approx(switch - 0.1043)
    assert control.still_to_wait(0.0, delay, period, 0.0, 0.1043) > 0.0


@pytest.mark.parametrize("given", [0.0002, 0.004])
def test_a_lag_is_a_time_behind_a_steady_acceleration(given):
    """A filter that has settled is a tau behind, below and above the shortest time constant of its state."""
    acceleration, at_least = 20.0, max(given, 1e-3)
    assert sensor.lagging_rate(given, -acceleration * at_least, 0.0) == pytest.approx(acceleration)
    assert sensor.lag_error(given, -acceleration * at_least, 0.0) == pytest.approx(-acceleration * given)
    assert sensor.gyro_slope_rate(given, 0.7, -1.4 * at_least * acceleration, acceleration, 0.0) == pytest.approx(0.0)
    behind = sensor.lag_error(given, -1.4 * at_least * acceleration, 0.0)
    assert behind == pytest.approx(-1.4 * given * acceleration)


def test_a_coupling_transmits_nothing_within_its_play():
    def torque(twist, speed=0.0, play=0.1, compliance=0.0):
        return flexible_link.coupling_torque(twist, speed, 50.0, 2.0, compliance, play, 0.0)

    assert [torque(t) for t in (-0.05, 0.0, 0.1, 0.3, -0.3)] == pytest.approx([0.0, 0.0, 0.0, 10.0, -10.0])
    assert torque(0.05, 3.0) == 0.0  # nor does its damper
    assert torque(0.3, 3.0) - torque(0.3) == pytest.approx(6.0, rel=3e-3)
    assert torque(0.3, 3.0, 0.0) == pytest.approx(15.0 + 6.0)
    # two springs in series: 50 N m/rad and 1/0.02
    assert torque(0.3, play=0.0, compliance=0.02) == pytest.approx(25.0 * 0.3)
