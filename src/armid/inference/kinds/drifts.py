"""Drifts: a parameter or a constant that changes in proportion to the order of the records."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from armid.estimation.constants import Product
from armid.inference.decisions import calibration
from armid.inference.evidence import Expansion, Forecast
from armid.inference.hypothesis import Hypothesis, Proposal
from armid.inference.kinds.faults import simulated_file, with_measured
from armid.inference.library import Library
from armid.inference.model import Fit, free_values, unless_diverged
from armid.inference.unknowns import Unknown, freed
from armid.inference.whitening import WhiteRecords
from armid.model import Array

# Fewest record files for a drift to be considered: with fewer a drift is a fault of one record.
FEWEST_RECORDS = 4
# Its largest plausible size, as a share of the range or of the constant; prior deviations as shares of that.
LARGEST_DRIFT, SCALES_OF_DRIFT = 0.5, np.array([0.01, 0.03, 0.1, 0.3, 1.0])
# Smallest size about which its effect is taken: of smaller ones rounding would speak.
LEAST_SIZE = 0.01


@dataclass(frozen=True)
class OfParameter:
    """Say which parameter of the declared model, or which constant, drifts."""

    name: str
    product: Product | None = None

    def undone(self, fit: Fit, size: float) -> "Undone":
        """Return what takes the drift out of records, taken about a fit and a size of it."""
        records = fit.base or fit.records
        firsts, changes = [i for i, replay in enumerate(records.replays) if replay.index == 0], []
        at, names = records.shares(free_values(records, fit.values)), records.space.free_names
        for place, index in enumerate(firsts):
            share = size * LARGEST_DRIFT * (place / (len(firsts) - 1.0) - 0.5) * np.array([0.0, 0.5, 1.0])
            Z, shares = np.tile(at, (3, 1)), {name: np.full(3, off) for name, off in fit.constants.items()}
            if self.product is not None:
                name = self.product.names[0]
                shares[name] = (1.0 + fit.constants.get(name, 0.0)) * (1.0 + share) - 1.0
            else:
                Z += np.outer(share, [name == self.name for name in names])
            changes.append((index, tuple(x[0] - x[1:] for x in simulated_file(records, index, Z, shares))))
        return Undone(size, tuple(changes))


@dataclass(frozen=True, eq=False)
class Undone:
    """Return records as they would be in the middle of the campaign: a parabola through no drift, a half and a whole.

    size: of the whole. changes: of each file its index, and of each of its signals what a half and the whole change,
    (2, n_samples).
    """

    size: float
    changes: tuple[tuple[int, tuple[Array, ...]], ...]

    def __call__(self, records: WhiteRecords, value: float) -> WhiteRecords:
        share, undone = value / self.size, records
        weights = np.array([4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)])
        for index, changes in self.changes:
            undone = with_measured(undone, index, [weights @ change for change in changes])
        return undone


def hypotheses(fit: Fit, library: Library) -> list[Hypothesis]:
    """Return the drifts of parameters and constants, none where there are few records."""
    if len(fit.records.data.records) < FEWEST_RECORDS:
        return []
    own = [OfParameter(name) for name in fit.values if library.owner(name) is None]
    own += [OfParameter(p.public, p) for p in fit.products(library.tolerances)]
    return [Hypothesis("drift", one.name, "", calibration().log_odds("drift", len(own)), one) for one in own]


def propose(fit: Fit, known: list[Hypothesis]) -> list[Proposal]:
    """Return the drifts that a fit does not hold, with what the largest plausible one does."""
    if not known:
        return []
    held = {f.unknown.name for f in fit.others}
    order, names, proposals = order_of(fit.records), list(fit.values), []
    for hypothesis in known:
        what: OfParameter = hypothesis.means
        if name_of(hypothesis) in held or (what.product is None and what.name not in names):
            continue
        slope = what.product.slope if what.product is not None else fit.jacobian[:, names.index(what.name)]
        column = LARGEST_DRIFT * slope * order
        if column.any():
            proposals.append(
                Proposal(hypothesis, column[np.newaxis], SCALES_OF_DRIFT, np.zeros(1), partial(refit, hypothesis))
            )
    return proposals


def refit(hypothesis: Hypothesis, fit: Fit, about: Expansion, ahead: Forecast, limit: float) -> Fit | None:
    """Return the model with a drift, fitted about its own estimate twice: what a drift does is taken there."""
    base, again, weight, size = fit.base or fit.records, fit, about.scale.weight, ahead.best(1)[0][1]
    others = [f.unknown for f in fit.others if f.unknown.name != name_of(hypothesis)]
    for is_first in (True, False, False):
        size = float(np.copysign(np.clip(abs(size), LEAST_SIZE, 1.0), size))
        unknown = Unknown(name_of(hypothesis), hypothesis.means.undone(again, size))
        tried = unless_diverged(lambda: freed(again, base, [*others, unknown], weight, limit, is_first))  # noqa: B023
        if tried is None:
            return None
        again, size = tried, tried.others[-1].value
    return again


def name_of(hypothesis: Hypothesis) -> str:
    """Return the name of the unknown that is the size of a drift."""
    return f"drift of {hypothesis.name}"


def order_of(records: WhiteRecords) -> Array:
    """Return the place of the file of each sample in the order of the campaign, from -1/2 to 1/2, (n_samples,)."""
    n_samples = [sum(one.n_samples for one in r.each) for r in records.data.records]
    return np.repeat(np.arange(len(n_samples)) / (len(n_samples) - 1.0) - 0.5, n_samples)
