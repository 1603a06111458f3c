"""The library as a whole: what there is, where it fits, what its ranges cover."""

from dataclasses import replace

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Effect, Model, Output, Parameter, applicable, refusal_of
from armid.model.effects import control, drive, friction, sensor
from armid.model.plants import flexible_link
from armid.model.plants.driven_axis import driven_axis, rotary_axis

ARM = PLANTS["shell_transfer_arm"]
ARM_ONLY = {
    "seal_friction", "shell_rocking", "tilt", "added_inertia", "flux_saturation", "brush_drop", "winding_heating",
    "supply_sag", "supply_error", "gas_heat_loss", "line_loss", "tachometer_lag", "tachometer_offset",
    "tachometer_ripple", "position_gain",
}  # fmt: skip
TWO_INERTIAS = {"backlash", "elastic_drive", "coupling_damping"}
EVERY_FORM = [pytest.param(form, id=f"{form.name}-{form.form}".rstrip("-"))
              for effect in EFFECTS.values() for form in effect.every_form]  # fmt: skip
DEGREE = np.pi / 180.0
# Weak and strong magnitudes of physics.md, section 6, SI. A stroke of REF has an integral of I^2 of 2,700 to 3,700 A2 s
# and a peak speed of 1.8 to 2.5 rad/s.
MAGNITUDES = {
    "coulomb.level": (20.0, 80.0), "stribeck.level": (20.0, 80.0), "stribeck.fade": (0.1, 0.2),
    "viscous.slope": (5.0, 30.0), "quadratic_drag.c": (5.0, 30.0), "seal_friction.force": (100.0, 400.0),
    "shell_rocking.inertia_share": (45.5 * 0.85**2, 45.5 * 0.85**2), "shell_rocking.frequency": (5.0, 22.0),
    "shell_rocking.damping_ratio": (0.02, 0.08), "tilt.angle": (1 * DEGREE, 5 * DEGREE),
    "worm_direction.loss": (0.1, 0.8), "worm_speed.loss": (0.05, 0.15),
    "flux_saturation.sharpness": (1 / 300, 1 / 80), "flux_saturation.sharpness_squared": (1 / 300**2, 1 / 80**2),
    "brush_drop.drop": (0.5, 2.0), "winding_heating.rise": (0.05 / 3700, 0.15 / 2700),
    "supply_sag.resistance": (0.003, 0.015), "gas_heat_loss.loss_rate": (0.1, 1.0),
    "line_loss.c": (0.05e6 / 2.5**2, 0.2e6 / 1.8**2), "tachometer_lag.time_constant": (0.002, 0.01),
    "tachometer_offset.offset": (0.5 * DEGREE, 3 * DEGREE), "controller_delay.delay": (0.002, 0.01),
    "gyro_lag.time_constant": (1 / (2 * np.pi * 60), 1 / (2 * np.pi * 30)), "gyro_bias.bias": (0.3 * DEGREE,) * 2,
    "gyro_scale.error": (0.005, 0.005), "drive_gain.error": (-0.2, -0.2),
}  # fmt: skip


def test_ranges_cover_what_a_real_arm_has_with_room():
    forms = [f for effect in applicable(EFFECTS, ARM).values() for f in effect.every_form if not refusal_of(f, ARM)]
    resolved = {name: p for form in reversed(forms) for name, p in (Model(ARM) + form).parameters.items()}
    for name, (weak, strong) in MAGNITUDES.items():
        p = resolved[name]
        null = p.low if p.null is None else p.null
        far = p.high if strong > null else p.low
        assert abs(strong - null) <= 0.81 * abs(far - null), name
        assert p.low <= weak <= p.high, name


@pytest.mark.parametrize("axis", [driven_axis, rotary_axis], ids=["linear", "rotary"])
def test_what_is_not_of_the_arm_alone_fits_an_axis(axis):
    assert set(applicable(EFFECTS, axis)) == set(EFFECTS) - ARM_ONLY - TWO_INERTIAS
    assert set(applicable(EFFECTS, ARM)) == set(EFFECTS) - TWO_INERTIAS
    assert set(applicable(EFFECTS, PLANTS["shell_transfer_arm_elastic"])) == set(EFFECTS)
    assert set(applicable(EFFECTS, PLANTS["flexible_link"])) == set(EFFECTS) - ARM_ONLY - {"gravity_gain"}


def test_a_plant_refuses_with_the_name_that_it_lacks_and_an_effect_comes_in_the_form_that_fits():
    assert "'supply'" in refusal_of(EFFECTS["supply_sag"], driven_axis)
    assert "asks for 'l', which nobody offers here" in refusal_of(EFFECTS["seal_friction"], rotary_axis)
    assert refusal_of(EFFECTS["coulomb"], rotary_axis) == ""
    level = (Parameter("level", "1", 0, 1, null=0.0),)
    shaft, wheel = (Effect("twofold", level, {port: lambda level: level}, form=port) for port in ("torque", "wheel"))
    first = replace(wheel, forms=(shaft,))
    assert applicable({"twofold": first}, ARM) == {"twofold": shaft}
    assert applicable({"wheel": wheel}, ARM) == {}


def test_where_another_quantity_than_omega_is_recorded_its_sensor_alone_has_effects():
    belt = replace(rotary_axis, ports={**rotary_axis.ports, "output": "m/s"}, output="", output_unit="",
                   quantities={**rotary_axis.quantities, "belt": lambda omega, output: 0.1 * omega + output},
                   outputs=(Output("belt_speed", "belt", "m/s", port="output"),))  # fmt: skip
    known = applicable({**sensor.sensor_effects(belt), **EFFECTS}, belt)
    assert {name for name, effect in known.items() if "output" in effect.adds} == {
        "belt_speed_bias", "belt_speed_scale", "belt_speed_delay", "belt_speed_lag",
    }  # fmt: skip


@pytest.mark.parametrize("effect", EVERY_FORM)
def test_each_is_documented_and_can_be_simulated_at_its_defaults(effect):
    assert effect.source
    assert effect.note
    assert all(f.__doc__ for f in effect.adds.values())
    for p in effect.parameters:
        assert p.note
        assert p.null is not None or p.fixed is not None or p.nominal is not None
        assert p.null in (None, 0.0)
    assert any(p.null == 0.0 and p.fixed is None for p in effect.parameters)
    # Only widths of smoothed kinks and departures from the usual form are fixed.
    rest = {p.name: p.fixed for p in effect.parameters if p.fixed is not None and p.name not in ("width", "least")}
    assert rest.items() <= {"exponent": 2.0, "knee": 2.0}.items() | dict.fromkeys(
        ("hardening", "cooling", "period", "damping", "second"), 0.0).items()  # fmt: skip


def test_forms_stand_under_one_name():
    forms = {name: [e.form for e in EFFECTS[name].every_form] for name in EFFECTS if EFFECTS[name].forms}
    assert forms.items() >= {"presliding": ["dahl", "lugre", "bouc_wen"],
                             "drive_lag": ["current_loop", "actuator", "voltage"],
                             "drive_delay": ["effort", "voltage"],
                             "controller_delay": ["feedback", "command", "voltage", "feedback_filter", "command_filter",
                                                  "voltage_filter"]}.items()  # fmt: skip
    late, lagging = (EFFECTS[name].in_form("voltage") for name in ("controller_delay", "drive_lag"))
    assert "is for plants without the port 'command'" in refusal_of(late, ARM)
    assert "'winding'" in refusal_of(lagging, PLANTS["driven_axis"])
    flux = EFFECTS["flux_saturation"]
    assert [e.form for e in flux.every_form] == ["rational", "arctangent"]
    assert flux.in_form("arctangent").name == "flux_saturation"
    assert flux.in_form("rational") is flux
    with pytest.raises(ArmidError, match="no form 'arctan': did you mean 'arctangent'"):
        flux.in_form("arctan")
    with pytest.raises(ArmidError, match="a form of another name"):
        replace(EFFECTS["viscous"], form="one", forms=(EFFECTS["coulomb"],))
    with pytest.raises(ArmidError, match="a word of its own"):
        replace(EFFECTS["viscous"], forms=(EFFECTS["viscous"],))


def test_what_a_worm_loses_and_a_load_holds():
    for lost in (drive.worm_speed_loss, drive.agma_loss):
        loss = -lost(np.array([0.0, 0.6, 300.0]), 100.0, 0.2, 0.6, 1e-9) / 100.0
        np.testing.assert_allclose(loss, [0.2, 0.2 / np.e, 0.0], atol=1e-4)
    # At rest in balance the drive holds the load: friction is a share of either; without a load, of half the drive.
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
