"""Truths spread over a box."""

import numpy as np

from armid.problem import Space


def spread(space: Space, n: int, seed: int, margin: float) -> list[dict[str, float]]:
    """Return n truths, parameter -> value in SI: a Latin hypercube over the box of the free parameters.

    Each range is cut into n equal parts and each part is hit once. margin: share of the range kept free at each side.
    Written out, as the points that a library draws from a seed change between its versions, and with them the cases.
    Source: McKay, Beckman, Conover 1979, doi:10.2307/1268522.
    """
    rng = np.random.default_rng(seed)
    low, high = space.low[space.free], space.high[space.free]
    parts = np.array([rng.permutation(n) for _ in low]).T
    points = (parts + rng.random(parts.shape)) / n
    whole = space.complete(low + (high - low) * (margin + (1.0 - 2.0 * margin) * points))
    return [dict(zip(space.names, row.tolist(), strict=True)) for row in whole]
