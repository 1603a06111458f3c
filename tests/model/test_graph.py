"""Argument names bind equations: own names first, then the plant's; what cannot be bound is refused with a sentence."""

import math
from dataclasses import replace

import numpy as np
import pytest

from armid.contract.trials import PlainModel
from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Constant, Effect, Manoeuvre, Model, Output, Parameter, State
from armid.model.plants.shell_transfer_arm import gravity_level, gravity_moment

ARM, AXIS = PLANTS["shell_transfer_arm"], PLANTS["driven_axis"]
LEVEL = (Parameter("level", "effort", 0.0, 1.0, null=0.0),)


def bound(model, key):
    return dict(model.graph.nodes[key].arguments)


def zero():
    return 0.0


def test_own_names_come_before_the_plants_and_an_argument_may_be_bound_to_another_name():
    own = Effect("own", (Parameter("omega", "1", 0, 1), Parameter("R", "1", 0, 1)), {"torque": lambda omega, R, K: K},
                 (State("current", "A", lambda current: current, zero),))  # fmt: skip
    model = Model(ARM) + own
    assert bound(model, "own__torque") == {"omega": "own__omega", "R": "own__R", "K": "K"}
    assert bound(model, "rate__own__current") == {"current": "own__current"}
    assert bound(model, "rate__theta") == {"omega": "omega"}
    follower = Effect("e", LEVEL, {"torque": lambda x, level: level * x}, binds={"x": "current"})
    assert bound(Model(ARM) + follower, "e__torque") == {"x": "current", "level": "e__level"}
    with pytest.raises(ArmidError, match="effect 'e' binds 'x' to 'curent', which nobody offers here: did you mean"):
        Model(ARM) + replace(follower, binds={"x": "curent"})


BOUND = {
    "alias": (ARM, "torque", lambda I, speed, angle, T_d: 0,
              {"I": "current", "speed": "omega", "angle": "theta", "T_d": "motor_torque"}),
    "alias of an axis": (AXIS, "torque", lambda omega, level: 0, {"omega": "v", "level": "e__level"}),
    "latch, time, port": (ARM, "supply", lambda closed, time, voltage, torque: 0,
                          {"closed": "closed", "time": "time", "voltage": "voltage", "torque": "torque"}),
    "a default may stay unbound": (ARM, "torque", lambda omega, gX=2.0: gX * omega, {"omega": "omega"}),
}  # fmt: skip


@pytest.mark.parametrize("case", BOUND)
def test_what_can_be_asked_for(case):
    plant, port, function, expected = BOUND[case]
    assert bound(Model(plant) + Effect("e", LEVEL, {port: function}), f"e__{port}") == expected


def test_an_initial_value_takes_what_moves_at_the_start_and_that_of_other_states():
    """Through ports, effects and switches; a quantity that does not move stands for itself."""
    lag = State("lag", "V", lambda lag, omega: omega - lag, lambda voltage, gravity_level: voltage + gravity_level)
    model = Model(ARM) + Effect("e", LEVEL, {"torque": lambda lag, level: level * lag}, (lag,))
    model += EFFECTS["tachometer_offset"]
    assert bound(model, "initial__e__lag") == {"voltage": "initial__voltage", "gravity_level": "gravity_level"}
    assert bound(model, "initial__demand")["closed"] == "initial__closed"
    assert bound(model, "initial__demand")["feedback"] == "feedback"  # the sum of constant offsets does not move
    short = {"theta_C": 0.3, "theta_D": 0.4}
    start = PlainModel(model, Manoeuvre(1e-3, 2, short), np.array([3e6, 1.0, 0.55, 1.4, 0.0, 0.0])).start()
    # K_p (theta_D - theta_C) less the threshold: this short stroke begins in closed loop
    level = gravity_level(gravity_moment(72.5, 118.0, 0.4106, 0.58, 1.0, 9.81), math.radians(5.0), 0.0)
    assert start[-1] == pytest.approx(280.0 * 0.1 - 0.5 + level)
    lag = State("lag", "rad/s", lambda lag, omega: omega - lag, lambda omega, theta_C: omega + theta_C)
    model = Model(ARM) + Effect("e", LEVEL, {"feedback": lambda lag, level: level * lag}, (lag,))
    assert bound(model, "initial__e__lag") == {"omega": "initial__omega", "theta_C": "theta_C"}


def test_ports_sum_what_effects_add_and_the_graph_knows_what_depends_on_the_motion():
    one, two = (Effect(n, LEVEL, {"torque": lambda level: level}) for n in ("one", "two"))
    graph = (Model(ARM) + one + two).graph
    assert graph.nodes["torque"].terms == ("one__torque", "two__torque")
    assert graph.nodes["drive"].terms == ()
    graph = (Model(ARM) + Effect("e", LEVEL, {"gravity": lambda level: level})).graph
    static = [graph.is_static(k) for k in ("gravity_level", "e__gravity", "initial__pressure", "gravity_torque")]
    assert static == [True, True, True, False]
    # A motor current does, by the back-EMF; the state of an actuator that takes an input alone does not.
    fed = with_state(lambda x, U: U - x, lambda: 0.0)
    graph = (Model(ARM) + fed).graph
    assert [graph.depends_on(k, ("omega", "theta")) for k in ("e__x", "current", "omega")] == [False, True, True]

    def torque(omega, level):
        # it is not part of the indentation
        return -level * omega

    assert "e__torque" in (Model(ARM) + Effect("e", LEVEL, {"torque": torque})).graph.nodes


def with_state(rate, start):
    return Effect("e", LEVEL, {"torque": lambda x: x}, (State("x", "1", rate, start),))


REFUSED = {
    "unknown name": (Effect("e", LEVEL, {"torque": lambda omga, level: 0}),
                     "effect 'e', port 'torque', asks for 'omga', which nobody offers here: did you mean 'omega'"),
    "unknown port": (Effect("e", LEVEL, {"torqe": lambda level: 0}),
                     "effect 'e' adds to the port 'torqe', which plant 'shell_transfer_arm' does not offer: did you "
                     "mean 'torque'"),
    "star": (Effect("e", LEVEL, {"torque": lambda *level: 0}),
             r"port 'torque', has the argument '\*level': plain named arguments are expected"),
    "time at the start": (with_state(zero, lambda time: 0),
                          "effect 'e', initial value of 'x', asks for 'time', which nobody offers here"),
    "through a port": (Effect("e", LEVEL, {"supply": lambda supply, level: supply}),
                       "the equations run in a circle: supply -> e.supply -> supply; use a state or an earlier"),
    "starts in a circle": (Effect("e", LEVEL, {"torque": lambda level: level},
                                  (State("x", "1", zero, lambda y: y), State("y", "1", zero, lambda x: x))),
                           "circle: initial.e.x -> initial.e.y -> initial.e.x"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_bound_is_refused(case):
    effect, sentence = REFUSED[case]
    with pytest.raises(ArmidError, match=sentence) as refusal:
        Model(ARM) + effect
    assert "\n" not in str(refusal.value)


def circle():
    return Model(replace(AXIS, quantities={**AXIS.quantities, "a": lambda b: b, "b": lambda c: c, "c": lambda a, v: a}))


def unknown():
    return Model(replace(AXIS, quantities={**AXIS.quantities, "drive_effort": lambda gain, voltage: 0}))


DECLARED = {
    "adds nothing": (lambda: Effect("e", LEVEL, {}), "effect 'e' adds to no port: at least one is expected"),
    "state twice": (lambda: Effect("e", LEVEL, {"torque": zero}, (State("level", "1", zero, zero),)),
                    "effect 'e' declares 'level' twice: each name once is expected"),
    "reserved": (lambda: Effect("rate", LEVEL, {"torque": zero}), "effect 'rate' cannot have this name: rate"),
    "effect's name": (lambda: Effect("my effect", LEVEL, {"torque": zero}), "effect 'my effect' is not a usable name"),
    "constant twice": (lambda: replace(AXIS, constants=(*AXIS.constants, Constant("v", 1.0, "1"))),
                       "plant 'driven_axis' declares 'v' twice"),
    "output": (lambda: replace(AXIS, output="recorded_sped"), "plant 'driven_axis' records 'recorded_sped': did you"),
    "signal is an alias": (lambda: replace(AXIS, outputs=(Output("s", "omega", "m/s"),), output="", output_unit=""),
                           "plant 'driven_axis' records 'omega', another name for 'v': 'v' is expected"),
    "port of a sensor is a state": (
        lambda: replace(AXIS, outputs=(Output("s", "v", "m/s", port="q"),), output="", output_unit=""),
        "records 's' through the port 'q': "),
    "parameter is a port": (lambda: Effect("e", (Parameter("torque", "1", 0.0, 1.0, null=0.0),), {"torque": zero}),
                            "effect 'e' calls something else 'torque', as a port to which it adds"),
    "unit of scales with a space": (
        lambda: (Model(AXIS) + Effect("e", (Parameter("c", "effort / speed", 0.0, 1.0),), {"torque": zero})).parameters,
        "unit 'effort / speed' is not a product of scales: words joined by"),
    "name": (lambda: replace(AXIS, quantities={"a__b": zero}), "quantity, port or alias 'a__b' is not a usable name"),
    "number for a function": (lambda: State("q", "m", zero, 0.0), "state 'q', initial value is 0.0: a function of"),
    "number for a quantity": (lambda: replace(AXIS, quantities={"a": 1.0}), "quantity 'a' is 1.0: a function of"),
    "circle": (circle, "the equations run in a circle: a -> b -> c -> a; use a state or an earlier"),
    "unknown": (unknown, "plant 'driven_axis', quantity 'drive_effort', asks for 'voltage', which"),
}  # fmt: skip


@pytest.mark.parametrize("case", DECLARED)
def test_a_declaration_that_contradicts_itself_is_refused(case):
    make, sentence = DECLARED[case]
    with pytest.raises(ArmidError, match=sentence):
        make()
