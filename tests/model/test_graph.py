"""Argument names bind equations: own names first, then the plant's; what cannot be bound is refused with a sentence."""

from dataclasses import replace

import pytest

from armid.errors import ArmidError
from armid.model import PLANTS, Constant, Effect, Guard, Model, Parameter, Plant, State

ARM, AXIS = PLANTS["shell_transfer_arm"], PLANTS["driven_axis"]
LEVEL = (Parameter("level", "effort", 0.0, 1.0, null=0.0),)


def bound(model: Model, key: str) -> dict[str, str]:
    """Argument -> key of a node."""
    return dict(model.graph.nodes[key].arguments)


def zero():
    return 0.0


def test_own_names_come_before_the_plants() -> None:
    own = Effect("own", (Parameter("omega", "1", 0, 1), Parameter("R", "1", 0, 1)), {"torque": lambda omega, R, K: K},
                 (State("current", "A", lambda current: current, zero),))  # fmt: skip
    model = Model(ARM) + own
    assert bound(model, "own__torque") == {"omega": "own__omega", "R": "own__R", "K": "K"}
    assert bound(model, "rate__own__current") == {"current": "own__current"}
    assert bound(model, "rate__theta") == {"omega": "omega"}


def test_aliases_stand_for_the_plants_own_names() -> None:
    effect = Effect("e", LEVEL, {"torque": lambda I, speed, angle, T_d, level: level})
    expected = {"I": "current", "speed": "omega", "angle": "theta", "T_d": "motor_torque", "level": "e__level"}
    assert bound(Model(ARM) + effect, "e__torque") == expected
    assert bound(Model(AXIS) + Effect("e", LEVEL, {"torque": lambda omega, level: 0}), "e__torque")["omega"] == "v"


def test_inputs_ports_latches_quantities_and_time_can_be_asked_for() -> None:
    on_arm = Effect("e", LEVEL, {"supply": lambda closed, time, voltage, torque, level: 0})
    assert bound(Model(ARM) + on_arm, "e__supply") == {
        "closed": "closed", "time": "time", "voltage": "voltage", "torque": "torque", "level": "e__level",
    }  # fmt: skip
    assert bound(Model(AXIS) + Effect("e", LEVEL, {"torque": lambda u, level: u}), "e__torque")["u"] == "u"


def test_an_initial_value_takes_the_start_of_other_states() -> None:
    lag = State("lag", "rad/s", lambda lag, omega: omega - lag, lambda omega, theta_C: omega + theta_C)
    model = Model(ARM) + Effect("e", LEVEL, {"feedback": lambda lag, level: level * lag}, (lag,))
    assert bound(model, "initial__e__lag") == {"omega": "initial__omega", "theta_C": "theta_C"}


def test_ports_sum_what_effects_add() -> None:
    one, two = (Effect(n, LEVEL, {"torque": lambda level: level}) for n in ("one", "two"))
    model = Model(ARM) + one + two
    assert model.graph.nodes["torque"].terms == ("one__torque", "two__torque")
    assert model.graph.nodes["drive"].terms == ()


def test_what_depends_on_parameters_alone_is_static() -> None:
    graph = (Model(ARM) + Effect("e", LEVEL, {"gravity": lambda level: level})).graph
    assert graph.is_static("gravity_level")
    assert graph.is_static("e__gravity")
    assert graph.is_static("initial__pressure")
    assert not graph.is_static("gravity_torque")


REFUSED = {
    "unknown name": (Effect("e", LEVEL, {"torque": lambda omga, level: 0}),
                     "effect 'e', port 'torque', asks for 'omga', which nobody offers here: did you mean 'omega'"),
    "unknown port": (Effect("e", LEVEL, {"torqe": lambda level: 0}),
                     "effect 'e' adds to the port 'torqe', which plant 'shell_transfer_arm' does not offer: did you "
                     "mean 'torque'"),
    "star": (Effect("e", LEVEL, {"torque": lambda *level: 0}),
             r"port 'torque', has the argument '\*level': plain named arguments are expected"),
    "keyword": (Effect("e", LEVEL, {"torque": lambda *, level: 0}), "has the argument 'level': plain named arguments"),
    "moving start": (Effect("e", LEVEL, {"torque": lambda x: x}, (State("x", "1", lambda x: x, lambda back_emf: 0),)),
                     "the initial value of 'e.x' depends on what moves: parameters, constants and initial states"),
    "time at the start": (Effect("e", LEVEL, {"torque": lambda x: x}, (State("x", "1", zero, lambda time: 0),)),
                          "effect 'e', initial value of 'x', asks for 'time', which nobody offers here"),
    "guard": (Effect("e", LEVEL, {"torque": lambda level: 0}, guards=(Guard("g", lambda speeed: 0),)),
              "effect 'e', guard 'g', asks for 'speeed', which nobody offers here: did you mean 'speed'"),
    "circle": (Effect("e", LEVEL, {"torque": lambda speed_up, level: 0}), "asks for 'speed_up'"),
    "through a port": (Effect("e", LEVEL, {"supply": lambda supply, level: supply}),
                       "the equations run in a circle: supply -> e.supply -> supply; use a state or an earlier"),
}  # fmt: skip


@pytest.mark.parametrize(("effect", "sentence"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_bound_is_refused(effect: Effect, sentence: str) -> None:
    with pytest.raises(ArmidError, match=sentence):
        Model(ARM) + effect


def test_quantities_in_a_circle_are_refused() -> None:
    quantities = {**AXIS.quantities, "a": lambda b: b, "b": lambda c: c, "c": lambda a, v: a}
    with pytest.raises(ArmidError, match="the equations run in a circle: a -> b -> c -> a; use a state or an earlier"):
        Model(replace(AXIS, quantities=quantities))


def test_initial_values_in_a_circle_are_refused() -> None:
    x, y = State("x", "1", zero, lambda y: y), State("y", "1", zero, lambda x: x)
    with pytest.raises(ArmidError, match=r"circle: initial.e.x -> initial.e.y -> initial.e.x"):
        Model(AXIS) + Effect("e", LEVEL, {"torque": lambda level: level}, (x, y))


PLANT_REFUSED = {
    "twice": ({"constants": (*AXIS.constants, Constant("v", 1.0, "1"))}, "plant 'driven_axis' declares 'v' twice"),
    "output": ({"output": "recorded_sped"}, "plant 'driven_axis' records 'recorded_sped': did you mean"),
    "alias": ({"aliases": {"omega": "w"}}, "plant 'driven_axis' has the alias 'omega' for 'w': "),
    "alias twice": ({"aliases": {"q": "v"}}, "plant 'driven_axis' declares 'q' twice"),
    "name": ({"quantities": {**AXIS.quantities, "a__b": zero}}, "quantity, port or alias 'a__b' is no usable name"),
    "port": ({"ports": {**AXIS.ports, "time": "s"}}, "quantity, port or alias 'time' cannot have this name"),
}


@pytest.mark.parametrize(("change", "sentence"), PLANT_REFUSED.values(), ids=PLANT_REFUSED)
def test_a_plant_that_contradicts_itself_is_refused(change: dict[str, object], sentence: str) -> None:
    with pytest.raises(ArmidError, match=sentence):
        replace(AXIS, **change)  # type: ignore[arg-type]


def test_a_plant_that_asks_for_an_unknown_name_is_refused() -> None:
    broken: Plant = replace(AXIS, quantities={**AXIS.quantities, "drive_effort": lambda gain, voltage: 0})
    with pytest.raises(ArmidError, match="plant 'driven_axis', quantity 'drive_effort', asks for 'voltage', which"):
        Model(broken)
