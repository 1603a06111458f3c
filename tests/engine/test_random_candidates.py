"""Candidates all over the box of Table I against a tight, independent integration."""

from collections.abc import Callable

import numpy as np
import pytest
from arm_cases import Array, box_of, drawn
from arm_stand import stand_speed

from armid.engine import Schedule, Simulation, calibrate, probes, simulate
from armid.model import Manoeuvre, Model

ERROR = {"standard": 1e-5, "fine": 2e-7}
N_CANDIDATES, SEED = 300, 20261121


def check(found: Simulation, stood: list[tuple[Array, float | None]], allowed: float) -> None:
    """Compare speeds at every sample, and switch times."""
    for i, (speed, switch) in enumerate(stood):
        assert np.abs(found.output[i] - speed).max() <= allowed
        switched = found.switch_times["closed"][i]
        assert np.isnan(switched) if switch is None else abs(switched - switch) <= 1e-6


@pytest.mark.slow
def test_random_candidates_agree_with_the_test_stand(
    arm: Model, manoeuvres: dict[str, Manoeuvre], schedule_for: Callable[[str, str], Schedule]
) -> None:
    candidates = drawn(arm, N_CANDIDATES, SEED)
    left = 0
    for k, (name, manoeuvre) in enumerate(manoeuvres.items()):
        mine = candidates[k :: len(manoeuvres)]
        stood = [stand_speed(name, candidate) for candidate in mine]
        inside = [i for i, s in enumerate(stood) if s is not None]
        left += len(mine) - len(inside)
        kept = [s for s in stood if s is not None]
        for accuracy, allowed in ERROR.items():
            check(simulate(arm, manoeuvre, mine[inside], schedule_for(name, accuracy)), kept, allowed)
    # The test stand refuses what leaves the travel; the box holds next to none of it.
    assert left <= N_CANDIDATES // 20


@pytest.mark.slow
def test_many_candidates_agree_with_a_finer_run(
    arm: Model, manoeuvres: dict[str, Manoeuvre], schedule_for: Callable[[str, str], Schedule]
) -> None:
    candidates = drawn(arm, 2000, SEED + 1)
    for name, manoeuvre in manoeuvres.items():
        finest = simulate(arm, manoeuvre, candidates, Schedule(16))
        assert not finest.failed.any()
        for accuracy, allowed in ERROR.items():
            found = simulate(arm, manoeuvre, candidates, schedule_for(name, accuracy))
            assert np.abs(found.output - finest.output).max() <= allowed, (name, accuracy)


@pytest.mark.slow
@pytest.mark.parametrize("width", [0.01, 0.001])
def test_friction_agrees_with_the_test_stand(
    width: float, rubbing_arm: Model, manoeuvres: dict[str, Manoeuvre]
) -> None:
    """However narrow the smoothing of the sign: the schedule follows."""
    low, high = box_of(rubbing_arm)
    low[5] = high[5] = width
    candidates = low + (high - low) * np.random.default_rng(SEED).random((8, 7))
    candidates[:, [4, 6]] *= 0.2
    for name in ("lower", "raise"):
        stood = [stand_speed(name, c[:4], coulomb=c[4], coulomb_width=c[5], viscous=c[6]) for c in candidates]
        for accuracy, allowed in ERROR.items():
            found = calibrate(rubbing_arm, manoeuvres[name], probes(low, high), accuracy)
            assert found.reached
            run = simulate(rubbing_arm, manoeuvres[name], candidates, found.schedule)
            check(run, [s for s in stood if s is not None], allowed)
        assert None not in stood
