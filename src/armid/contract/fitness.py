"""The contract of a fitness."""

import numpy as np

from armid.contract.finding import Finding
from armid.fitness import Fitness


def check_fitness(fitness: Fitness) -> list[Finding]:
    """Try a fitness on a bump, the same bump disturbed more and more, and a candidate that failed."""
    times = 1e-3 * np.arange(300)
    measured = np.sin(12.0 * times) * np.exp(-2.0 * times)
    disturbances = np.array([0.0, 0.05, 0.2, 0.6])
    simulated = measured + disturbances[:, np.newaxis] * np.cos(23.0 * times)
    before = simulated.copy()
    values = fitness(measured, simulated, 1e-3, 0.01)
    failed = fitness(measured, np.vstack([simulated, np.full_like(measured, np.nan)]), 1e-3, 0.01)
    again = fitness(measured, simulated, 1e-3, 0.01)
    return [
        Finding("one value per candidate", values.shape == (4,), f"shape {values.shape} for 4 candidates"),
        Finding("finite", bool(np.isfinite(values).all()), f"values {np.array2string(values, precision=3)}"),
        Finding("least at a perfect match", int(np.argmin(values)) == 0, f"{values[0]:.3g} at the measured series"),
        Finding("a failed candidate is worst", bool(failed[-1] > values.max()), f"{failed[-1]:.3g} for a NaN row"),
        Finding("others untouched", bool(np.array_equal(failed[:-1], values)), "a failed neighbour changes nothing"),
        Finding("leaves its arguments alone", bool(np.array_equal(before, simulated)), "the arrays are as they were"),
        Finding("deterministic", bool(np.array_equal(values, again)), "a second call gives the same values"),
    ]
