"""What a candidate does must not depend on who is simulated beside it, nor on how the work is shared."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from arm_cases import Array, drawn

from armid.engine import Schedule, Simulation, simulate
from armid.model import Effect, Manoeuvre, Model, Parameter


def cubic_drive(omega, gain):
    """Torque that grows with the cube of the speed: what it drives runs away."""
    return gain * omega**3


runaway = Effect("runaway", (Parameter("gain", "effort", 0.0, 50.0, null=0.0),), {"torque": cubic_drive})


@pytest.fixture(scope="module")
def runaway_arm(arm: Model) -> Model:
    return arm + runaway


@pytest.fixture(scope="module")
def schedule(schedule_for: Callable[[str, str], Schedule]) -> Schedule:
    return schedule_for("lower", "standard")


def same(found: Simulation, rows: Array | slice, expected: Simulation) -> bool:
    """Compare outputs, failures and switch times bit for bit."""
    pairs = [(found.output, expected.output), (found.failed, expected.failed)]
    pairs += [(found.switch_times[k], v) for k, v in expected.switch_times.items()]
    return all(np.array_equal(a[rows], b, equal_nan=True) for a, b in pairs)


def test_alone_and_in_any_place(arm: Model, manoeuvres: dict[str, Manoeuvre], schedule: Schedule) -> None:
    population = drawn(arm, 37, 21)
    whole = simulate(arm, manoeuvres["lower"], population, schedule)
    for i in (0, 7, 8, 36):
        assert same(whole, slice(i, i + 1), simulate(arm, manoeuvres["lower"], population[i], schedule))
    order = np.random.default_rng(22).permutation(37)
    shuffled = simulate(arm, manoeuvres["lower"], population[order], schedule)
    assert same(whole, order, shuffled)


@pytest.mark.parametrize("threads", [2, 3, 8, 64])
def test_on_any_number_of_threads(
    threads: int, arm: Model, manoeuvres: dict[str, Manoeuvre], schedule: Schedule
) -> None:
    population = drawn(arm, 50, 23)
    one = simulate(arm, manoeuvres["lower"], population, schedule)
    assert same(simulate(arm, manoeuvres["lower"], population, schedule, threads=threads), slice(None), one)


def test_with_or_without_weights(arm: Model, manoeuvres: dict[str, Manoeuvre], schedule: Schedule) -> None:
    population = drawn(arm, 50, 24)
    assert schedule.weights is not None
    for weights in (None, -schedule.weights, np.ones(4)):
        other = simulate(arm, manoeuvres["lower"], population, replace(schedule, weights=weights))
        assert same(simulate(arm, manoeuvres["lower"], population, schedule), slice(None), other)


@pytest.mark.parametrize("name", ["lower", "raise_empty", "inside_E"])
def test_beside_candidates_that_diverge(
    name: str, runaway_arm: Model, manoeuvres: dict[str, Manoeuvre], schedule_for: Callable[[str, str], Schedule]
) -> None:
    calm = np.column_stack([drawn(runaway_arm, 20, 25)[:, :4], np.zeros(20)])
    wild = calm.copy()
    wild[::3, 4] = 5e4
    schedule = replace(schedule_for(name, "standard"), weights=None)
    alone = simulate(runaway_arm, manoeuvres[name], calm, schedule)
    mixed = simulate(runaway_arm, manoeuvres[name], wild, schedule)
    others = np.arange(20)[wild[:, 4] == 0.0]
    assert not alone.failed.any()
    assert mixed.failed[::3].all()
    assert np.array_equal(mixed.output[others], alone.output[others])
    assert np.array_equal(mixed.switch_times["closed"][others], alone.switch_times["closed"][others])


def test_a_diverged_candidate_is_nan_from_then_on(runaway_arm: Model, manoeuvres: dict[str, Manoeuvre]) -> None:
    candidates = np.column_stack([drawn(runaway_arm, 30, 26)[:, :4], np.geomspace(1e3, 1e7, 30)])
    for schedule in (Schedule(), Schedule(plan=np.full(1200, 8)), Schedule(3)):
        found = simulate(runaway_arm, manoeuvres["lower"], candidates, schedule)
        lost = np.isnan(found.output)
        assert np.array_equal(lost.any(axis=1), found.failed)
        assert found.failed[-1]
        # once lost, lost for good
        assert np.array_equal(np.maximum.accumulate(lost, axis=1), lost)
        assert np.nanmax(np.abs(found.output)) <= 1e3 * runaway_arm.plant.scales.speed


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e300, 1e300])
def test_an_impossible_parameter_fails_alone(
    value: float, arm: Model, manoeuvres: dict[str, Manoeuvre], schedule: Schedule
) -> None:
    population = drawn(arm, 12, 27)
    expected = simulate(arm, manoeuvres["lower"], population, schedule)
    spoilt = population.copy()
    spoilt[5, 0] = value
    found = simulate(arm, manoeuvres["lower"], spoilt, schedule)
    assert found.failed[5]
    assert np.isnan(found.output[5, -1])
    others = np.arange(12) != 5
    assert np.array_equal(found.output[others], expected.output[others])
    assert not found.failed[others].any()
