"""The library as a whole: what there is, where it fits, what its ranges cover."""

from dataclasses import replace

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Effect, Model, Parameter, applicable, refusal_of
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


def test_a_plant_refuses_with_the_name_that_it_lacks():
    assert "'supply'" in refusal_of(EFFECTS["supply_sag"], driven_axis)
    assert "asks for 'l', which nobody offers here" in refusal_of(EFFECTS["seal_friction"], rotary_axis)
    assert refusal_of(EFFECTS["coulomb"], rotary_axis) == ""


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


def test_an_effect_comes_in_the_form_that_fits():
    shaft, wheel = (Effect("twofold", (Parameter("level", "1", 0, 1, null=0.0),), {port: level}, form=port)
                    for port in ("torque", "wheel"))  # fmt: skip
    first = replace(wheel, forms=(shaft,))
    assert applicable({"twofold": first}, ARM) == {"twofold": shaft}
    assert applicable({"wheel": wheel}, ARM) == {}


def level(level):
    return level


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
