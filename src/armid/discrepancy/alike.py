"""Candidates that could take the place of an effect in a model: they move the records as it does.

A score at the model without the effect is a linear guess from parameters that the lack of it has bent; dry friction can
rank fourteenth there and still fit as well as the first (seen on one stroke). About the model with the effect the guess
is good: put in its place, a rival does nearly what it does, the parameters making up for what they can.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.fit import Fit, span
from armid.discrepancy.group import change_by, owned_by
from armid.discrepancy.library import Library
from armid.discrepancy.rays import rays
from armid.discrepancy.trace import responses

Array = NDArray[np.float64]
# A rival whose trace correlates below this is none (a group asks for 0.95); so many are worth a fit.
LIKELY, MOST = 0.9, 8


@dataclass(frozen=True)
class Rival:
    """Hold what could stand in the place of an effect, how alike the two are, and values from which to fit it."""

    place: str
    name: str
    correlation: float
    values: dict[str, float]


def alike(fit: Fit, library: Library) -> list[Rival]:
    """Return the candidates that move the records like an effect of a fit, the likest first."""
    changes = {name: change_by(fit, name) for name in fit.active}
    spans = {name: span(fit.jacobian[:, ~owned_by(fit, name)]) for name in fit.active}
    candidates = [c for c in library.candidates if library.can_join(c, fit.active)]
    each = library.each(lambda c: list(rivals(fit, library, c, changes, spans)), candidates)
    found = sorted(chain.from_iterable(each), key=lambda r: -r.correlation)
    return [r for place in fit.active for r in [r for r in found if r.place == place][:MOST]]


def rivals(
    fit: Fit, library: Library, candidate: str, changes: Mapping[str, Array], spans: Mapping[str, Array]
) -> Iterator[Rival]:
    """Yield the effects of a fit that a candidate moves the records like.

    changes: by each effect, (n_samples,); spans: bases of what the other parameters can absorb, (n_samples, rank).
    """
    records = library.problem((*fit.active, candidate), fit.values)
    found, _ = rays(records, candidate)
    for name in fit.active:
        best = likest(changes[name], responses(fit, records, found, without=name), spans[name])
        if best is not None:
            ray, correlation, amplitude = found[best[0]], best[1], float(np.clip(best[2], 0.01, 1.0))
            yield Rival(name, candidate, correlation, fit.values | ray.at(amplitude))


def likest(change: Array, moved: Array, basis: Array) -> tuple[int, float, float] | None:
    """Return the ray that moves the signal most like a change, their correlation, and the amplitude that does.

    None where none is near.

    change: (n_samples,), moved: per full strength, (n_rays, n_samples), both projected off a basis.
    """
    wanted = change - basis @ (basis.T @ change)
    within, slope = moved @ basis, moved @ wanted
    square = np.einsum("ij,ij->i", moved, moved) - np.einsum("ij,ij->i", within, within)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = slope / np.sqrt(square * (wanted @ wanted))
    correlation[~np.isfinite(correlation)] = 0.0
    best = int(np.argmax(correlation))
    if correlation[best] <= LIKELY:
        return None
    return best, float(correlation[best]), float(slope[best] / square[best])
