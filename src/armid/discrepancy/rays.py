"""Ways to switch an effect on: a grid over its strengths and shapes."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.evidence import WhiteRecords

Array = NDArray[np.float64]
# Strengths that are tried, as shares of the way from the null to a bound; shapes: points along each of 1, 2, 3 ranges.
LEVELS, LEVELS_OF_SHAPES = (0.03, 0.1, 0.3, 1.0), (0.05, 0.4)
SHAPES = {0: (), 1: (8,), 2: (7, 3), 3: (5, 3, 2)}
WIDE = 5.0


@dataclass(frozen=True, eq=False)
class Ray:
    """Hold one way to switch an effect on: values at full strength, those of the null, and the share that is tried."""

    full: dict[str, float]
    null: dict[str, float]
    level: float

    def at(self, share: float) -> dict[str, float]:
        """Return the parameters of the effect at a share of its full strength."""
        return {n: self.null[n] + share * (v - self.null[n]) if n in self.null else v for n, v in self.full.items()}


def rays(records: WhiteRecords, model_name: str) -> tuple[list[Ray], int]:
    """Return the grid over strengths and shapes of one effect, and the number of its shapes.

    Strengths are the free parameters with a null value: each alone, and all together where there are several.
    """
    space, declared = records.space, records.replays[0].model.parameters
    mine = [n for n in space.free_names if n.startswith(f"{model_name}.")]
    null = {n: float(v) for n in mine if (v := declared[n].null) is not None}
    bound = {n: (space.low[space.index(n)], space.high[space.index(n)]) for n in mine}
    shapes = [n for n in mine if n not in null]
    counts = SHAPES.get(len(shapes), (2,) * len(shapes))
    grids = [grid(*bound[n], count) for n, count in zip(shapes, counts, strict=True)]
    points = [dict(zip(shapes, map(float, p), strict=True)) for p in product(*grids)]
    chosen = [(n,) for n in null] + ([tuple(null)] if len(null) > 1 else [])
    found = []
    for names, side, shape in product(chosen, (1, 0), points):
        full = {n: float(bound[n][side]) if n in names else null[n] for n in null}
        if all(full[n] != null[n] for n in names):
            found += [Ray(shape | full, null, level) for level in (LEVELS_OF_SHAPES if shapes else LEVELS)]
    return found, len(points)


def grid(low: float, high: float, count: int) -> Array:
    """Return points inside a range, even in the logarithm where the range is wide."""
    shares = (np.arange(count) + 0.5) / count
    if low > 0.0 and high > WIDE * low:
        return np.asarray(low * (high / low) ** shares)
    return np.asarray(low + (high - low) * shares)
