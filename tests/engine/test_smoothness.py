"""No stair-step: the misfit to a record of other parameters is smooth along a fine line through parameter space."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from arm_cases import Array, drawn
from armid.engine import Schedule, simulate
from armid.model import Manoeuvre, Model
from armid.problem.fitness import mean_square

N_POINTS, STEP, DISAGREEMENT = 2000, 1e-6, 1e-3
TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])
# Directions of the line: all parameters at once, and each alone.
DIRECTIONS = [[1.0, 0.7, -0.9, 0.8], *np.eye(4).tolist()]


def central(values: Array, points: int) -> Array:
    """Central differences over so many points to each side, at the points where the widest fit."""
    middle = slice(100, N_POINTS - 100)
    return np.asarray((np.roll(values, -points) - np.roll(values, points))[middle]) / (2 * points * STEP)


@pytest.mark.parametrize("accuracy", ["standard", "fine"])
@pytest.mark.parametrize("name", ["lower", "raise"])
def test_derivatives_at_two_steps_agree(
    name: str, accuracy: str, arm: Model, manoeuvres: dict[str, Manoeuvre],
    schedule_for: Callable[[str, str], Schedule],
) -> None:  # fmt: skip
    schedule = schedule_for(name, accuracy)
    record = simulate(arm, manoeuvres[name], TRUTH, schedule).output[0]
    for direction, start in product(DIRECTIONS, drawn(arm, 2, 11)):
        along = 1.0 + STEP * np.arange(N_POINTS)[:, np.newaxis] * np.array(direction)
        misfit = np.sqrt(mean_square(record, simulate(arm, manoeuvres[name], start * along, schedule).output))
        wide, narrow = central(misfit, 100), central(misfit, 10)
        counted = np.abs(wide) >= 0.1 * np.median(np.abs(wide))
        assert counted.mean() > 0.5
        assert np.max(np.abs(narrow - wide)[counted] / np.abs(wide)[counted]) <= DISAGREEMENT, direction
