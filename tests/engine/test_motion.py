"""A driven axis against motions that can be written down: inputs, holds, friction, a pendulum."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from armid.contract.trials import simulate_plainly
from armid.engine import Schedule, calibrate, simulate
from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Input, Manoeuvre, Model, Parameter, Plant, Scales, State

INTERVAL, N_SAMPLES = 0.01, 201
TIMES = INTERVAL * np.arange(N_SAMPLES)
MASS = 3.0


@pytest.fixture(scope="module")
def axis():
    """Mass, then level and width of Coulomb friction, slope of viscous friction, constant effort."""
    return Model(PLANTS["driven_axis"]) + EFFECTS["coulomb"] + EFFECTS["viscous"] + EFFECTS["torque_offset"]


def move(axis, drive, level=0.0, slope=0.0, offset=0.0, substeps=4, hold="linear", **constants):
    """Move the mass; constants by name."""
    manoeuvre = Manoeuvre(INTERVAL, len(drive), constants, {"u": drive}, hold)
    return simulate(axis, manoeuvre, [MASS, level, 0.005, slope, offset], Schedule(substeps), states=True)


RANDOM = np.random.default_rng(1).normal(size=N_SAMPLES)
ZERO, LAG = np.zeros(N_SAMPLES), MASS / 6.0
FALLING = 1.5 * np.exp(-TIMES / LAG)
# Drive, options of `move`, the speed in closed form, its relative and absolute tolerance.
CLOSED_FORMS = {
    "constant force": (np.full(N_SAMPLES, 2.0), {"substeps": 1}, 2.0 * TIMES / MASS, 1e-13, 0.0),
    "constant effort": (ZERO, {"offset": -0.7}, -0.7 * TIMES / MASS, 1e-12, 0.0),
    "gain": (np.full(N_SAMPLES, 2.0), {"gain": -35.0}, -70.0 * TIMES / MASS, 1e-12, 0.0),
    "ramp": (5.0 * TIMES, {"substeps": 1}, 2.5 * TIMES**2 / MASS, 1e-12, 1e-15),
    "viscous friction": (ZERO, {"slope": 6.0, "start_speed": 1.5, "start_position": -2.0}, FALLING, 1e-8, 0.0),
    "viscous friction under a ramp": (
        4.0 * TIMES, {"slope": 6.0}, 4.0 / 6.0 * (TIMES - LAG * (1.0 - np.exp(-TIMES / LAG))), 0.0, 1e-9),
    # Between samples the drive runs straight, or keeps its last sample: the trapezoidal sum, or that of stairs.
    **{f"{hold} {n}": (RANDOM, {"substeps": n, "hold": hold}, np.append(0.0, np.cumsum(push)) * INTERVAL / MASS,
                       1e-12, 1e-14)
       for hold, push in (("linear", 0.5 * (RANDOM[1:] + RANDOM[:-1])), ("zero", RANDOM[:-1])) for n in (1, 3)},
}  # fmt: skip


@pytest.mark.parametrize("case", CLOSED_FORMS)
def test_the_speed_is_that_of_the_closed_form(axis, case):
    drive, options, expected, relative, absolute = CLOSED_FORMS[case]
    np.testing.assert_allclose(move(axis, drive, **options).output[0], expected, rtol=relative, atol=absolute)


def test_coulomb_friction_stops_the_mass_for_good_and_a_pendulum_swings_as_its_small_angle_says(axis):
    """From v0 the mass slows down by level / m and stands from m v0 / level on, but for the smoothing."""
    level, start = 4.0, 0.9
    found = move(axis, np.zeros(N_SAMPLES), level=level, substeps=32, start_speed=start)
    stop = MASS * start / level
    expected = np.maximum(start - level * TIMES / MASS, 0.0)
    assert np.abs(found.output[0] - expected).max() <= 0.015
    assert np.abs(found.output[0][stop + 0.1 < TIMES]).max() <= 1e-6
    assert found.output[0].min() >= -1e-9
    found = move(axis, np.zeros(N_SAMPLES), gravity_moment=120.0, start_position=1e-4)
    rate = np.sqrt(120.0 / MASS)
    np.testing.assert_allclose(found.states["q"][0], 1e-4 * np.cos(rate * TIMES), atol=1e-11)
    np.testing.assert_allclose(found.output[0], -1e-4 * rate * np.sin(rate * TIMES), atol=1e-11)


@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_halving_steps_divides_the_error_by_sixteen(axis, hold):
    """Fourth order, whatever the drive does at its samples."""
    drive = np.sign(np.sin(9.0 * TIMES))
    runs = [move(axis, drive, slope=30.0, gravity_moment=200.0, substeps=n, hold=hold) for n in (2, 4, 8)]
    coarse, fine = (np.abs(a.output - b.output).max() for a, b in pairwise(runs))
    assert 12.0 <= coarse / fine <= 20.0


def test_a_mass_too_light_for_the_steps_gets_finer_ones(axis):
    """With coarse steps friction of 2 N s/m throws a mass of 2 g about: such a schedule must not be taken."""
    manoeuvre = Manoeuvre(INTERVAL, N_SAMPLES, {}, {"u": np.sin(9.0 * TIMES)})
    candidates = np.array([[0.002, 0.0, 0.005, 2.0, 0.0], [3.0, 0.0, 0.005, 2.0, 0.0]])
    assert simulate(axis, manoeuvre, candidates, Schedule(1)).failed.tolist() == [True, False]
    found = calibrate(axis, manoeuvre, candidates)
    assert found.reached
    assert not simulate(axis, manoeuvre, candidates, found.schedule).failed.any()


# Inputs that run straight between samples beside inputs that keep their last value.
N_SWITCHED, OFF = 101, 40
SWITCHED = INTERVAL * np.arange(N_SWITCHED)


CART = Plant(
    name="cart", parameters=(Parameter("mass", "kg", 0.5, 2.0),),
    inputs=(Input("push", "N"), Input("on", "1", hold="zero")),
    states=(State("v", "m/s", lambda push, on, mass: push * on / mass, lambda: 0.0),), from_rest=False,
    quantities={"recorded": lambda v, on: v + 0.5 * on}, output="recorded", output_unit="m/s",
    scales=Scales(1.0, 1.0, "N", "m"),
)  # fmt: skip
INPUTS = {"push": SWITCHED, "on": np.where(np.arange(N_SWITCHED) < OFF, 1.0, 0.0)}


@pytest.mark.parametrize("substeps", [1, 3])
def test_a_switch_jumps_at_its_sample_and_a_force_does_not(substeps):
    """v = t^2/2 up to the switch, then v stays; what is recorded sees the switch at its own sample."""
    found = simulate(Model(CART), Manoeuvre(INTERVAL, N_SWITCHED, inputs=INPUTS), [[1.0]], Schedule(substeps)).output[0]
    speed = 0.5 * np.minimum(SWITCHED, SWITCHED[OFF]) ** 2
    np.testing.assert_allclose(found, speed + 0.5 * INPUTS["on"], atol=1e-14)


def test_what_the_plant_says_of_an_input_wins_unless_it_contradicts_itself():
    straight = replace(CART, inputs=(Input("push", "N", hold="linear"), Input("on", "1", hold="zero")))
    told = [
        simulate(Model(plant), Manoeuvre(INTERVAL, N_SWITCHED, inputs=INPUTS, hold=hold), [[1.0]]).output[0]
        for plant, hold in ((CART, "linear"), (straight, "zero"), (CART, "zero"))
    ]
    np.testing.assert_array_equal(told[0], told[1])
    stairs = np.cumsum(np.append(0.0, (SWITCHED * INPUTS["on"])[:-1])) * INTERVAL
    np.testing.assert_allclose(told[2], stairs + 0.5 * INPUTS["on"], atol=1e-14)
    with pytest.raises(ArmidError, match=r"'stairs'.*'linear', 'zero' or ''"):
        Input("u", "N", hold="stairs")
    with pytest.raises(ArmidError, match="a smaller and a larger value"):
        Input("u", "N", typical=(1.0, 1.0))


@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_the_plain_reference_holds_alike(hold):
    manoeuvre = Manoeuvre(INTERVAL, 60, inputs={k: v[:60] for k, v in INPUTS.items()}, hold=hold)
    plain = simulate_plainly(Model(CART), manoeuvre, np.array([1.3]))[0]
    np.testing.assert_allclose(simulate(Model(CART), manoeuvre, [[1.3]]).output[0], plain, atol=1e-9)
