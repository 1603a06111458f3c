"""Argument names are the binding; what nobody offers is refused with one sentence."""

import pytest

from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Constant, Effect, Guard, Model, Parameter, Plant, Scales, State

ARM = PLANTS["shell_transfer_arm"]
LEVEL = (Parameter("level", "effort", 0, 1, null=0.0),)


def effect(function, port="torque", **options):
    return Effect("mine", LEVEL, {port: function}, **options)


def arguments(model, key):
    return dict(model.graph.nodes[key].arguments)


def test_own_names_come_before_the_plants():
    own = Effect("mine", (Parameter("k", "1", 0, 1, null=0.0),), {"torque": lambda k, n: k * n})
    assert arguments(Model(ARM) + own, "mine__torque") == {"k": "mine__k", "n": "n"}


def test_aliases_lead_to_the_plants_states():
    axis = Model(PLANTS["driven_axis"]) + effect(lambda omega, level: -level * omega)
    assert arguments(axis, "mine__torque") == {"omega": "v", "level": "mine__level"}


def test_two_effects_may_use_the_same_short_names():
    model = Model(ARM) + EFFECTS["coulomb"] + EFFECTS["torque_offset"]
    assert [n for n in model.parameters if n.endswith(".level")] == ["coulomb.level", "torque_offset.level"]


def test_extra_states_concatenate():
    lag = State("seen", "rad/s", lambda omega, seen, level: omega - seen, lambda omega: omega)
    model = Model(ARM) + Effect("lag", LEVEL, {"output": lambda seen, omega: seen - omega}, (lag,))
    assert list(model.states)[-1] == "lag.seen"
    assert arguments(model, "initial__lag__seen") == {"omega": "initial__omega"}


@pytest.mark.parametrize(("function", "port", "words"), [
    (lambda omega, gX: gX, "torque", ("effect 'mine'", "port 'torque'", "'gX'", "'g'")),
    (lambda omega: omega, "torq", ("effect 'mine'", "'torq'", "did you mean 'torque'")),
    (lambda torque: torque, "torque", ("circle", "torque")),
    (lambda *omega: 0.0, "torque", ("*omega", "plain named arguments")),
])  # fmt: skip
def test_refusals_are_one_sentence(function, port, words):
    with pytest.raises(ArmidError) as refusal:
        Model(ARM) + effect(function, port)
    assert "\n" not in str(refusal.value)
    assert all(word in str(refusal.value) for word in words)


def test_an_argument_with_a_default_may_stay_unbound():
    assert arguments(Model(ARM) + effect(lambda omega, gX=2.0: gX * omega), "mine__torque") == {"omega": "omega"}


def test_an_initial_value_may_not_depend_on_what_moves():
    state = State("x", "1", lambda x: x, lambda demand: demand)
    with pytest.raises(ArmidError, match="initial value"):
        Model(ARM) + effect(lambda x: x, states=(state,))


def test_an_effect_is_added_once_and_removed_by_name():
    model = Model(ARM) + EFFECTS["coulomb"] + EFFECTS["viscous"]
    with pytest.raises(ArmidError, match="already"):
        model + EFFECTS["coulomb"]
    assert list((model - "coulomb").parameters) == list((Model(ARM) + EFFECTS["viscous"]).parameters)
    with pytest.raises(ArmidError, match="did you mean 'viscous'"):
        model - "viscus"


def test_a_plant_names_each_thing_once():
    speed = State("v", "m/s", lambda v: -v, lambda: 1.0)
    with pytest.raises(ArmidError, match="'v' twice"):
        Plant("twice", (), (speed,), "v", "m/s", Scales(1, 1), constants=(Constant("v", 1.0, "m/s"),))
    with pytest.raises(ArmidError, match="did you mean 'v'"):
        Plant("lost", (), (speed,), "vv", "m/s", Scales(1, 1))


def test_an_effect_adds_somewhere():
    with pytest.raises(ArmidError, match="no port"):
        Effect("idle", LEVEL, {})


def test_an_effect_may_bring_a_switch_of_its_own():
    late = Effect("late", LEVEL, {"torque": lambda on, level: on * level},
                  guards=(Guard("on", lambda time: 0.2 - time, latch=True),))  # fmt: skip
    assert (Model(ARM) + late).latches == ["closed", "late.on"]


def test_constants_are_known_by_name():
    model = Model(ARM)
    values = dict(zip(model.constants, model.constant_values({"R": 0.5}), strict=True))
    assert values["R"] == 0.5
    assert values["U"] == 28.0
    with pytest.raises(ArmidError, match="'Rx'"):
        model.constant_values({"Rx": 1.0})
