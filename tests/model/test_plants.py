"""The declared plants: their equations as plain functions, against the paper's."""

import math
from dataclasses import replace

import numpy as np
import pytest

from armid.contract.trials import away, middle, simulate_plainly
from armid.engine import Schedule, simulate
from armid.errors import ArmidError
from armid.inference.candidates import EffectKey, constant_effects
from armid.model import PLANTS, Manoeuvre, Model, Scales
from armid.model.parameter import warn_if_far
from armid.model.plants.driven_axis import driven_axis
from smallest_plants import tried_on

PLANT = PLANTS["shell_transfer_arm"]


def test_the_arm_is_declared_as_the_reference_arm_and_a_negative_bound_warns():
    """Its constants are those of the reference trajectories of tests/engine."""
    model = Model(PLANT)
    known = {"g", "theta_C", "theta_D", "shell", "U"}
    assert all("estimate" in c.note for c in PLANT.constants if c.name not in known)
    bounds = {n: (p.low, p.high) for n, p in model.parameters.items()}
    assert bounds == {"p0": (2.6e6, 3.5e6), "k": (0.6, 1.1), "eta3": (0.45, 0.70), "n": (0.9, 1.5)}
    with pytest.warns(UserWarning, match=r"bounds inertia = -1 to 0.02 is negative, outside the declared range"):
        warn_if_far(PLANTS["rotary_arm"].parameters[0], [-1.0, 0.02], "bounds inertia = -1 to 0.02")


def test_an_axis_comes_in_metres_or_radians_with_scales_of_its_own_and_a_plant_may_record_one_angle():
    axis = PLANTS["driven_axis"]
    assert (axis.output_unit, axis.for_unit("rad/s").output_unit) == ("m/s", "rad/s")
    assert list(Model(axis).parameters) == ["mass"]
    turning = Model(axis.for_unit("rad/s"))
    assert (list(turning.parameters), turning.parameters["inertia"].unit) == (["inertia"], "kg m2")
    with pytest.raises(ArmidError, match=r"plant 'shell_transfer_arm' records rad/s, not m/s"):
        PLANT.for_unit("m/s")
    axis = PLANTS["driven_axis"]
    assert replace(axis, scales=Scales(3.0, 0.5)).scales == Scales(3.0, 0.5, "N", "m")
    assert replace(PLANT, scales=Scales(3.0, 0.5)).scales == Scales(3.0, 0.5, "N m", "rad")
    plant = replace(PLANTS["rotary_arm"], outputs=(), output="recorded_angle", output_unit="rad")
    assert not plant.records_one_speed
    (output,) = plant.outputs
    assert (output.name, output.signal, output.unit) == ("recorded_angle", "recorded_angle", "rad")


@pytest.mark.nightly
@pytest.mark.parametrize("told", [{}, {"theta_C": math.radians(22.0), "theta_D": math.radians(-48.0)}, {"shell": 0.0}])
def test_a_stiff_coupling_without_play_moves_as_the_rigid_arm(told):
    candidate = np.array([[3.05e6, 1.0, 0.55, 1.4]])
    rigid = simulate(Model(PLANT), Manoeuvre(1e-3, 901, told), candidate, Schedule(24)).output
    stiff = told | {"stiffness": 1e10, "link_damping": 3e5, "half_play": 0.0}
    elastic = Model(PLANTS["shell_transfer_arm_elastic"])
    assert np.abs(simulate(elastic, Manoeuvre(1e-3, 901, stiff), candidate, Schedule(24)).output - rigid).max() < 1e-5
    # 1e6 N m/rad swing at 1/(2 pi) sqrt(K (1/J1 + 1/J2)), some 30 Hz
    swing = simulate(elastic, Manoeuvre(1e-3, 901, told | {"half_play": 0.0}), candidate, Schedule(4)).output - rigid
    assert 1e-3 < np.abs(swing).max() < 0.3


def test_a_hub_and_a_tip_exchange_momentum_and_swing_at_their_frequency():
    hub, tip, stiffness = 0.06, 0.17, 40.0
    swing = Manoeuvre(2e-3, 101, {"start_deflection": 0.02}, {"u": np.zeros(101)})
    candidate = np.array([hub, tip, stiffness, 0.0, 0.0])
    _, twist, speed, twist_speed = simulate_plainly(Model(PLANTS["flexible_link"]), swing, candidate)
    np.testing.assert_allclose(hub * speed + tip * (speed + twist_speed), 0.0, atol=1e-9)
    rate = np.sqrt(stiffness * (1 / hub + 1 / tip))
    np.testing.assert_allclose(twist, 0.02 * np.cos(rate * swing.times()), atol=1e-8)


def test_what_is_known_roughly_is_corrected_wherever_it_stands():
    """A parameter and a constant, by an effect at the port of each: as if another value had been declared."""
    axis = PLANTS["driven_axis"].for_unit("rad/s").known_roughly(("inertia", "gravity_moment"))
    model = Model(axis, tuple(constant_effects({"inertia": 0.5, "gravity_moment": 0.5}).values()))
    assert EffectKey("error_of_inertia").public == "constant:inertia"
    assert "gravity_effort = -gravity_moment.corrected * sin(q)" in str(model)
    times = np.arange(101) * 5e-3
    told = {"gravity_moment": 0.4, "start_position": 0.3}
    motion = Manoeuvre(5e-3, 101, told, {"u": 0.2 * np.sin(9 * times)})
    found = simulate(model, motion, [[0.1, 0.0, 0.0], [0.1, 0.25, -0.5]], Schedule(8)).output
    plain = Model(PLANTS["driven_axis"].for_unit("rad/s"))
    other = Manoeuvre(5e-3, 101, told | {"gravity_moment": 0.2}, motion.inputs)
    expected = [simulate(plain, m, [[j]], Schedule(8)).output[0] for m, j in ((motion, 0.1), (other, 0.125))]
    np.testing.assert_allclose(found, expected, atol=1e-12)


TIMES = 5e-3 * np.arange(121)
# A short lowering with the shell, beyond its switch at 0.14 s; a light hanging axis under a sine that turns it over.
MOTIONS = {
    "arm": (PLANTS["shell_transfer_arm"], Manoeuvre(5e-3, 41, {"theta_D": math.radians(-20.0)}), {}),
    "axis": (driven_axis, Manoeuvre(5e-3, 121, {"gravity_moment": 0.4, "start_speed": 0.1},
                                    {"u": 0.1 + 0.5 * np.sin(9 * TIMES)}), {"mass": 0.06}),
}  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize("where", MOTIONS)
def test_all_at_once_move_as_their_plain_functions(where):
    """In steps so fine that the engine is within 1e-7 rad/s of the truth, but for the brushes' width."""
    plant, manoeuvre, own = MOTIONS[where]
    model = Model(plant, tuple(tried_on(plant)))
    values = {n: middle(p) if p.null is None else p.null for n, p in model.parameters.items()} | own
    still = np.array(list(values.values()))
    for effect in model.effects:
        alone = Model(plant, (effect,))
        moved = dict(zip(alone.parameters, away(alone, effect, 0.03), strict=True))
        values |= {n: v for n, v in moved.items() if n.startswith(f"{effect.name}.")}
    candidate = np.array(list(values.values()))
    plain = simulate_plainly(model, manoeuvre, candidate)[0]
    run = simulate(model, manoeuvre, np.array([candidate, still]), Schedule(24))
    assert not run.failed.any()
    assert np.abs(run.output[0] - plain).max() <= 5e-6
    assert np.abs(run.output[1] - plain).max() > 1e-3
