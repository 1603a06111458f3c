"""In a model of many effects those at their null are not evaluated, which no candidate can notice."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from arm_cases import Array, drawn
from armid.engine import Schedule, simulate
from armid.engine.generate import FEWEST_IDLE, strengths_of
from armid.model import EFFECTS, Manoeuvre, Model

pytestmark = pytest.mark.slow
# Those that are tried, of all that one compiled model holds.
NAMES = ("coulomb", "viscous", "tilt", "gas_heat_loss", "gyro_lag", "shell_rocking", "controller_delay", "gyro_bias")


@pytest.fixture(scope="module")
def schedule(schedule_for: Callable[[str, str], Schedule]) -> Schedule:
    return replace(schedule_for("lower", "standard"), weights=None)


def using(wide: Model, plain: Array, name: str, share: float = 0.3) -> Array:
    """Return a candidate that uses one effect, every other at its null."""
    values = dict(zip(list(wide.parameters)[: len(plain)], plain, strict=True))
    for key, p in list(wide.parameters.items())[len(plain) :]:
        rest = next(v for v in (p.null, p.fixed, p.nominal, 0.5 * (p.low + p.high)) if v is not None)
        in_use = key.startswith(f"{name}.") and p.null is not None
        values[key] = p.null + share * (p.high - p.null) if in_use else rest
    return np.array(list(values.values()))


def test_a_small_model_evaluates_every_effect(arm: Model, wide: Model) -> None:
    assert len(NAMES) == FEWEST_IDLE
    least = Model(arm.plant, tuple(EFFECTS[n] for n in NAMES))
    assert not strengths_of(Model(arm.plant, least.effects[1:]))
    assert set(strengths_of(least)) == set(NAMES) < set(strengths_of(wide))


def test_neighbours_that_use_other_effects_change_nothing(
    arm: Model, wide: Model, manoeuvres: dict[str, Manoeuvre], schedule: Schedule
) -> None:
    plain = drawn(arm, 1, 7)[0]
    population = np.array([using(wide, plain, n) for n in (*NAMES, "", *NAMES[::-1])])
    together = simulate(wide, manoeuvres["lower"], population, schedule).output
    for candidate, output in zip(population, together, strict=True):
        np.testing.assert_array_equal(simulate(wide, manoeuvres["lower"], candidate, schedule).output[0], output)
    assert len(np.unique(together.round(9), axis=0)) == len(NAMES) + 1
    # a strength that is no number is not taken for the null
    candidate = using(wide, plain, "")
    candidate[list(wide.parameters).index("viscous.slope")] = np.nan
    assert simulate(wide, manoeuvres["lower"], candidate, schedule).failed.all()


def test_the_motion_is_that_of_the_model_without_what_is_inactive(
    arm: Model, rubbing_arm: Model, wide: Model, manoeuvres: dict[str, Manoeuvre], schedule: Schedule
) -> None:
    """The plant alone, and with two effects, few enough that both are evaluated."""
    # A delay of 0 switches at once, and behind a switch no step is long: only even steps are the same.
    even = replace(schedule, plan=None)
    for name, small in (("", arm), ("coulomb", rubbing_arm), ("viscous", rubbing_arm)):
        candidate = using(wide, drawn(arm, 1, 8)[0], name)
        values = dict(zip(wide.parameters, candidate))
        expected = simulate(small, manoeuvres["lower"], [values[n] for n in small.parameters], even).output
        found = simulate(wide, manoeuvres["lower"], candidate, even).output
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12)
