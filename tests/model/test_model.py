"""Parameters, their bounds and units; models are composed with + and -, and print their equations."""

from pathlib import Path

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Effect, Guard, Model, Parameter, Scales, State
from armid.model.parameter import check_name, resolve

ARM = PLANTS["shell_transfer_arm"]
HERE = Path(__file__).parent
COULOMB, VISCOUS = EFFECTS["coulomb"], EFFECTS["viscous"]
LEVEL = (Parameter("level", "effort", 0.0, 1.0, null=0.0),)


def test_plus_adds_in_order_and_minus_takes_away_and_the_model_is_left_alone():
    bare = Model(ARM)
    model = bare + VISCOUS + COULOMB
    assert [e.name for e in model.effects] == ["viscous", "coulomb"]
    assert bare.effects == ()
    assert list(model.parameters) == ["p0", "k", "eta3", "n", "viscous.slope", "coulomb.level", "coulomb.width"]
    with pytest.raises(ArmidError, match="effect 'coulomb' is in the model already: each effect at most once is"):
        model + COULOMB
    model = Model(ARM) + COULOMB + VISCOUS
    assert [e.name for e in (model - "coulomb").effects] == ["viscous"]
    assert [e.name for e in (model - VISCOUS).effects] == ["coulomb"]
    assert str(model - VISCOUS - COULOMB) == str(Model(ARM))
    with pytest.raises(ArmidError, match="effect 'coulom' is not in the model: did you mean 'coulomb'"):
        model - "coulom"
    with pytest.raises(ArmidError, match="effect 'coulomb' is not in the model: there is none"):
        Model(ARM) - "coulomb"


@pytest.mark.parametrize(("model", "file"), [
    (Model(ARM) + COULOMB + VISCOUS, "arm_with_friction.txt"),
    (Model(PLANTS["driven_axis"]) + EFFECTS["torque_offset"], "axis_with_offset.txt"),
])  # fmt: skip
def test_a_model_shows_its_equations(model, file):
    assert str(model) == (HERE / file).read_text(encoding="utf-8").rstrip("\n")


def choice(omega, level):
    """Force against the motion."""
    return -level if omega > 0 else level if omega < 0 else 0.0


def several_lines(omega, level):
    """Names on the way are put in."""
    pushed = np.tanh(omega / 0.1)
    pushed = pushed * level
    return -pushed


def branches(omega, level):
    """Statements cannot be put into one line."""
    if omega > 0:
        return -level
    return level


@pytest.mark.parametrize(("function", "text"), [
    (choice, "e.torque = -e.level if omega > 0 else e.level if omega < 0 else 0.0"),
    (several_lines, "e.torque = -(tanh(omega / 0.1) * e.level)"),
    (branches, "e.torque = branches(omega, e.level)"),
    (lambda omega, level: -level * omega**3, "e.torque = -e.level * omega ** 3"),
    (lambda level: level * np.pi, "e.torque = e.level * pi"),
])  # fmt: skip
def test_right_hand_sides(function, text):
    assert text in [line.strip() for line in str(Model(ARM) + Effect("e", LEVEL, {"torque": function})).splitlines()]


def test_states_and_switches_of_effects_are_qualified_and_shown():
    def rate(omega, x):
        return omega - x

    def start(theta_C):
        return 2 * theta_C

    def far(x):
        return x - 0.5

    effect = Effect("e", LEVEL, {"torque": lambda on, x, level: level * on * x}, (State("x", "1", rate, start),),
                    (Guard("on", far, latch=True), Guard("edge", far)))  # fmt: skip
    model = Model(ARM) + effect
    assert list(model.states)[-1] == "e.x"
    assert model.latches == ["closed", "e.on"]
    lines = [line.strip() for line in str(model).splitlines()]
    for expected in (
        "d e.x/dt = omega - e.x", "e.x = 2 * theta_C", "e.on: switches once to 1 when e.x - 0.5 <= 0",
        "e.edge: kink where e.x - 0.5 = 0", "torque = e.torque  [N m]", "e.torque = e.level * e.on * e.x",
    ):  # fmt: skip
        assert expected in lines


ROTARY = Scales(effort=1000.0, speed=2.0)
AXIS = Scales(effort=150.0, speed=0.3, effort_unit="N", length_unit="m")


def test_names_and_units_that_stay_and_those_that_are_refused():
    for name in ("p0", "eta3", "h", "np", "abs", "I6_loaded", "match"):
        check_name(name, "parameter")
    for name in ("a b", "2a", "lambda", "a__b", "_a", "a_", "", "a.b"):
        with pytest.raises(ArmidError, match=f"^parameter '{name}' is not a usable name"):
            Parameter(name, "1", 0.0, 1.0)
    with pytest.raises(ArmidError, match="state 'time' cannot have this name: in the equations, time is"):
        check_name("time", "state")
    for low, high in ((1.0, 1.0), (2.0, 1.0), (float("nan"), 1.0), (0.0, float("nan"))):
        with pytest.raises(ArmidError, match=r"parameter 'a' has low .* and high .*: low < high is expected"):
            Parameter("a", "1", low, high)
    for unit in ("Pa", "1", "kg m2", "s", "N m s/rad"):
        parameter = Parameter("c", unit, 1.0, 2.0)
        assert resolve(parameter, ROTARY) is parameter
    with pytest.raises(ArmidError, match=r"'sped'.*'speed'"):
        resolve(Parameter("c", "effort/sped", 0.0, 1.0), ROTARY)


@pytest.mark.parametrize(("unit", "scales", "si", "size"), [
    ("effort", ROTARY, "N m", 1000.0), ("speed", ROTARY, "rad/s", 2.0), ("effort/speed", ROTARY, "N m s/rad", 500.0),
    ("effort/speed^2", ROTARY, "N m s2/rad2", 250.0), ("inertia", ROTARY, "kg m2", 500.0), ("effort", AXIS, "N", 150.0),
    ("effort/speed", AXIS, "N s/m", 500.0), ("inertia", AXIS, "kg", 500.0), ("speed*s", AXIS, "m", 0.3),
])  # fmt: skip
def test_products_of_scales_become_si(unit, scales, si, size):
    found = resolve(Parameter("c", unit, -1.0, 2.0, null=0.0, fixed=0.5, nominal=0.25), scales)
    assert found.unit == si
    assert (found.low, found.high) == pytest.approx((-size, 2 * size))
    assert (found.null, found.fixed, found.nominal) == pytest.approx((0.0, 0.5 * size, 0.25 * size))
