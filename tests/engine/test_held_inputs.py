"""Inputs that run straight between samples beside inputs that keep their last value."""

from dataclasses import replace

import numpy as np
import pytest

from armid.contract.reference import simulate_plainly
from armid.engine import Schedule, simulate
from armid.errors import ArmidError
from armid.model import Input, Manoeuvre, Model, Parameter, Plant, Scales, State

INTERVAL, N, OFF = 0.01, 101, 40
TIMES = INTERVAL * np.arange(N)


def speed_rate(push, on, mass):
    return push * on / mass


def at_rest():
    return 0.0


def recorded(v, on):
    return v + 0.5 * on


CART = Plant(
    name="cart", parameters=(Parameter("mass", "kg", 0.5, 2.0),), states=(State("v", "m/s", speed_rate, at_rest),),
    quantities={"recorded": recorded}, inputs=(Input("push", "N"), Input("on", "1", hold="zero")), output="recorded",
    output_unit="m/s", scales=Scales(1.0, 1.0, "N", "m"), from_rest=False,
)  # fmt: skip
INPUTS = {"push": TIMES, "on": np.where(np.arange(N) < OFF, 1.0, 0.0)}


@pytest.mark.parametrize("substeps", [1, 3])
def test_a_switch_jumps_at_its_sample_and_a_force_does_not(substeps):
    """v = t^2/2 up to the switch, then v stays; what is recorded sees the switch at its own sample."""
    found = simulate(Model(CART), Manoeuvre(INTERVAL, N, inputs=INPUTS), [[1.0]], Schedule(substeps)).output[0]
    speed = 0.5 * np.minimum(TIMES, TIMES[OFF]) ** 2
    np.testing.assert_allclose(found, speed + 0.5 * INPUTS["on"], atol=1e-14)


def test_what_the_plant_says_of_an_input_wins():
    straight = replace(CART, inputs=(Input("push", "N", hold="linear"), Input("on", "1", hold="zero")))
    told = [
        simulate(Model(plant), Manoeuvre(INTERVAL, N, inputs=INPUTS, hold=hold), [[1.0]]).output[0]
        for plant, hold in ((CART, "linear"), (straight, "zero"), (CART, "zero"))
    ]
    np.testing.assert_array_equal(told[0], told[1])
    stairs = np.cumsum(np.append(0.0, (TIMES * INPUTS["on"])[:-1])) * INTERVAL
    np.testing.assert_allclose(told[2], stairs + 0.5 * INPUTS["on"], atol=1e-14)


@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_the_plain_reference_holds_alike(hold):
    manoeuvre = Manoeuvre(INTERVAL, 60, inputs={k: v[:60] for k, v in INPUTS.items()}, hold=hold)
    plain = simulate_plainly(Model(CART), manoeuvre, np.array([1.3]))
    np.testing.assert_allclose(simulate(Model(CART), manoeuvre, [[1.3]]).output[0], plain, atol=1e-9)


def test_refused():
    with pytest.raises(ArmidError, match=r"'stairs'.*'linear', 'zero' or ''"):
        Input("u", "N", hold="stairs")
    with pytest.raises(ArmidError, match="a smaller and a larger value"):
        Input("u", "N", typical=(1.0, 1.0))
