"""Models are composed with + and -, and print their equations."""

from pathlib import Path

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Effect, Guard, Model, Parameter, State

ARM = PLANTS["shell_transfer_arm"]
HERE = Path(__file__).parent
COULOMB, VISCOUS = EFFECTS["coulomb"], EFFECTS["viscous"]
LEVEL = (Parameter("level", "effort", 0.0, 1.0, null=0.0),)


def test_plus_adds_in_order_and_leaves_the_model_alone() -> None:
    bare = Model(ARM)
    model = bare + VISCOUS + COULOMB
    assert [e.name for e in model.effects] == ["viscous", "coulomb"]
    assert bare.effects == ()
    assert list(model.parameters) == ["p0", "k", "eta3", "n", "viscous.slope", "coulomb.level", "coulomb.width"]
    with pytest.raises(ArmidError, match="effect 'coulomb' is in the model already: each effect at most once is"):
        model + COULOMB


def test_minus_takes_away_by_name_or_effect() -> None:
    model = Model(ARM) + COULOMB + VISCOUS
    assert [e.name for e in (model - "coulomb").effects] == ["viscous"]
    assert [e.name for e in (model - VISCOUS).effects] == ["coulomb"]
    assert str(model - VISCOUS - COULOMB) == str(Model(ARM))
    with pytest.raises(ArmidError, match="effect 'coulom' is not in the model: did you mean 'coulomb'"):
        model - "coulom"
    with pytest.raises(ArmidError, match="effect 'coulomb' is not in the model: there is none"):
        Model(ARM) - "coulomb"


def test_parameters_come_in_si() -> None:
    parameters = (Model(ARM) + COULOMB + VISCOUS).parameters
    assert (parameters["p0"].unit, parameters["p0"].low, parameters["p0"].high) == ("Pa", 2.6e6, 3.5e6)
    level, slope = parameters["coulomb.level"], parameters["viscous.slope"]
    assert (level.unit, level.low, level.high, level.null) == ("N m", 0.0, 500.0, 0.0)
    assert (slope.unit, slope.high) == ("N m s/rad", 250.0)
    assert parameters["coulomb.width"].fixed == pytest.approx(0.01)


def test_constants_are_known_by_name() -> None:
    model = Model(ARM)
    values = dict(zip(model.constants, model.constant_values({"R": 0.5})))
    assert (values["R"], values["U"]) == (0.5, 28.0)
    with pytest.raises(ArmidError, match="'Rx'"):
        model.constant_values({"Rx": 1.0})


@pytest.mark.parametrize(("model", "file"), [
    (Model(ARM) + COULOMB + VISCOUS, "arm_with_friction.txt"),
    (Model(PLANTS["driven_axis"]) + EFFECTS["torque_offset"], "axis_with_offset.txt"),
])  # fmt: skip
def test_a_model_shows_its_equations(model: Model, file: str) -> None:
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
def test_right_hand_sides(function, text) -> None:
    assert text in [line.strip() for line in str(Model(ARM) + Effect("e", LEVEL, {"torque": function})).splitlines()]


def test_states_and_switches_of_effects_are_qualified_and_shown() -> None:
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
