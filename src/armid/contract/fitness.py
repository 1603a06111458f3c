"""The contract of a fitness."""

import numpy as np
from numpy.typing import NDArray

from armid.contract.trials import Finding
from armid.errors import ArmidError
from armid.problem.fitness import Fitness

Array = NDArray[np.float64]
INTERVAL, NOISE = 1e-3, 0.01


def check_fitness(fitness: Fitness) -> list[Finding]:
    """Try a fitness on a bump, the same bump disturbed more and more, and a candidate that failed."""
    measured, simulated = trial_series()
    try:
        values, again = value(fitness, measured, simulated), value(fitness, measured, simulated)
        alone = value(fitness, measured, simulated[2:3])
        failed = value(fitness, measured, np.vstack([simulated, np.full_like(measured, np.nan)]))
    except ArmidError as error:
        return [Finding("one value per candidate", False, str(error))]
    apart = np.array_equal(failed[:-1], values) and np.array_equal(alone, values[2:3])
    return [
        Finding("one value per candidate", values.shape == (4,), f"shape {values.shape} for 4 candidates"),
        Finding("finite", bool(np.isfinite(values).all()), f"values {np.array2string(values, precision=3)}"),
        Finding("least at a perfect match", int(np.argmin(values)) == 0, f"{values[0]:.3g} at the measured series"),
        Finding("a failed candidate is worst", bool(failed[-1] > values.max()), f"{failed[-1]:.3g} for a NaN row"),
        Finding("others untouched", bool(apart), "alone, and beside a failed one, a candidate is compared with itself"),
        leaves_arguments(fitness),
        Finding("deterministic", bool(np.array_equal(values, again)), "a second call is compared with the first"),
    ]


def trial_series() -> tuple[Array, Array]:
    """Return a measured bump, (n_samples,), and that bump disturbed more and more, (4, n_samples)."""
    times = INTERVAL * np.arange(300)
    measured = np.sin(12.0 * times) * np.exp(-2.0 * times)
    disturbances = np.array([0.0, 0.05, 0.2, 0.6])
    return measured, measured + disturbances[:, np.newaxis] * np.cos(23.0 * times)


def value(fitness: Fitness, measured: Array, simulated: Array) -> Array:
    """Return the value of each candidate, the function working on copies."""
    return fitness(measured.copy(), simulated.copy(), INTERVAL, NOISE)


def leaves_arguments(fitness: Fitness) -> Finding:
    """Tell whether the function leaves the arrays that it is given as they are."""
    measured, simulated = trial_series()
    fitness(measured, simulated, INTERVAL, NOISE)
    same = all(np.array_equal(a, b) for a, b in zip((measured, simulated), trial_series(), strict=True))
    text = "the arrays are as they were" if same else "the arrays that it was given have changed"
    return Finding("leaves its arguments alone", same, text)
