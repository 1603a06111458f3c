"""The sensitivity behind a candidate's score: what of it the parameters cannot absorb, and how it fits the residual."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.fit import Fit
from armid.discrepancy.library import Library
from armid.discrepancy.rays import rays
from armid.discrepancy.trace import predicted, responses

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Projected:
    """Hold the best ray of one candidate at a fit, all whitened.

    share: length of its sensitivity after projection off the parameters' as a share of that before. alignment: cosine
    between what is left of it and what is left of the residual; its square is the share of the residual that an
    unbounded amplitude would remove. change: the part of the residual that it predicts, (n_samples,).
    """

    name: str
    share: float
    alignment: float
    change: Array


def rest_of(current: Fit) -> Array:
    """Return the whitened residual of a fit, projected off the sensitivities to its parameters, (n_samples,)."""
    return np.asarray(current.residual - current.basis @ (current.basis.T @ current.residual))


def projected(current: Fit, name: str, library: Library) -> Projected:
    """Return what stands behind the score of a candidate: the ray with the largest predicted drop of chi2 (`score`)."""
    records = library.problem((*current.active, name), current.values)
    found, _ = rays(records, name)
    moved = responses(current, records, found)
    drops, amplitudes = predicted(current, moved)
    best = int(np.argsort(-drops, kind="stable")[0])
    free = moved[best] - current.basis @ (current.basis.T @ moved[best])
    rest = rest_of(current)
    length, whole = float(np.linalg.norm(free)), float(np.linalg.norm(moved[best]))
    product = length * float(np.linalg.norm(rest))
    alignment = float(free @ rest) / product if product > 0.0 else 0.0
    return Projected(name, length / whole if whole > 0.0 else 0.0, alignment, amplitudes[best] * free)
