"""Effect size of Vargha and Delaney."""

import numpy as np
from numpy.typing import ArrayLike


def a12(first: ArrayLike, second: ArrayLike) -> float:
    """Return the probability that a number of the first sample is smaller than one of the second, ties by half.

    A12 = (#{(x, y) : x < y} + #{x = y}/2) / (n m): 0.5 is no difference, 1 means that the first is always smaller,
    which for errors is better. first: (n,); second: (m,); infinite ones allowed. NaN for an empty sample.
    Source: Vargha and Delaney, J. Educ. Behav. Stat. 25 (2000) 101.
    """
    x, y = np.asarray(first, np.float64), np.sort(np.asarray(second, np.float64))
    if not x.size or not y.size:
        return np.nan
    above = y.size - np.searchsorted(y, x, side="right")
    not_below = y.size - np.searchsorted(y, x, side="left")
    return float((above + not_below).sum() / (2.0 * x.size * y.size))


def size_in_words(value: float) -> str:
    """Return how large the effect is: negligible, small, medium, large (Vargha and Delaney's 0.56, 0.64, 0.71)."""
    distance = abs(value - 0.5)
    for limit, word in ((0.06, "negligible"), (0.14, "small"), (0.21, "medium")):
        if distance < limit:
            return word
    return "large"
