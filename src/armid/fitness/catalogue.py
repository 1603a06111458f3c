"""The fitnesses by name."""

from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from armid.fitness.fitness import Fitness
from armid.fitness.measures import chi_square, inverse_noise, mean_square, relative_mean_square, unity
from armid.fitness.series import Array
from armid.fitness.similarity import numerical_similarity, scored


def one_less(
    degree: int,
    measured: ArrayLike,
    simulated: ArrayLike,
    interval: float,
    epsilon: float = 0.03,
    xi: float = 0.030,
    slope_threshold: float = 0.2,
) -> Array:
    """Return 1 minus a similarity degree per candidate, +inf for one that is not finite.

    degree: its place in what `similarity` returns; other arguments and errors as there.
    """
    scores = scored(measured, simulated, interval, epsilon, xi, slope_threshold, failed=-np.inf)
    values: Array = 1.0 - scores[degree]
    return values


def numerical_dissimilarity(measured: ArrayLike, simulated: ArrayLike) -> Array:
    """Return 1 - S1 of Eq 13 per candidate, +inf for one that is not finite; errors as `numerical_similarity`."""
    return 1.0 - numerical_similarity(measured, simulated, failed=-np.inf)


# 1 - S of Eq 10, and 1 - S2 of Eq 14, a step function
dissimilarity, shape_dissimilarity = partial(one_less, 0), partial(one_less, 2)

# Those whose value is 1 minus a degree that people know.
SIMILARITIES = ("similarity", "numerical_similarity", "shape_similarity")

_FITNESSES = (
    Fitness("similarity", dissimilarity, "duration", note="1 - S, the paper's similarity degree (Eq 10)"),
    Fitness("numerical_similarity", numerical_dissimilarity, "duration", note="1 - S1, its numerical part (Eq 13)"),
    Fitness("shape_similarity", shape_dissimilarity, "duration", note="1 - S2, its shape part (Eq 14), in steps"),
    Fitness("rmse", mean_square, "samples", np.sqrt, "signal", "root of the mean square over all samples", unity),
    Fitness("nrmse", relative_mean_square, "samples", np.sqrt, "1", "rmse with each record divided by its own rms"),
    Fitness("likelihood", chi_square, "sum", None, "1", "sum of (x - x')^2 / noise^2: -2 log likelihood, white noise",
            inverse_noise),
)

FITNESS: dict[str, Fitness] = {fitness.name: fitness for fitness in _FITNESSES}
