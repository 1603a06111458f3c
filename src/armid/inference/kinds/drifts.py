"""A parameter or a constant that changes: with the order of the records (a drift), or in one record alone."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armid.estimation.constants import NAMED, Product
from armid.inference.decisions import calibration
from armid.inference.evidence import Expansion, Forecast
from armid.inference.hypothesis import Hypotheses, Hypothesis, Proposal
from armid.inference.kinds.faults import simulated_file, with_measured
from armid.inference.library import Library
from armid.inference.model import ROUGHLY, UNTOLD, Fit, free_values, unless_diverged
from armid.inference.unknowns import Unknown, freed, polished
from armid.inference.whitening import WhiteRecords
from armid.model import Array
from armid.problem.starts import fits_starts

# Fewest record files for a drift to be considered: with fewer a drift is a change in one record. Of two records
# either may be the other one.
FEWEST_RECORDS, FEWEST_OTHERS = 4, 2
# Its largest plausible size, as a share of the constant, of a parameter that keeps its sign, or of the range of one
# that does not; prior deviations as shares of that.
LARGEST_DRIFT, SCALES_OF_DRIFT = 0.5, np.array([0.01, 0.03, 0.1, 0.3, 1.0])
# How often its effect is taken anew, about the estimate of the fit before.
MOST_TURNS = 8
# Smallest size about which its effect is taken: of smaller ones rounding would speak.
LEAST_SIZE = 0.01


@dataclass(frozen=True)
class OfParameter:
    """Say which parameter of the declared model, or which constant, changes; file: of the one record, "" of a drift."""

    name: str
    product: Product | None = None
    file: str = ""

    def reach(self, fit: Fit) -> float:
        """Return the largest plausible change of a parameter, as a share of its range; of a constant, of its value."""
        if self.product is not None:
            return LARGEST_DRIFT
        space, place = fit.records.space, list(fit.values).index(self.name)
        low, high = float(space.low[space.free][place]), float(space.high[space.free][place])
        keeps_sign = low >= 0.0 or high <= 0.0
        return LARGEST_DRIFT * (abs(fit.values[self.name]) / (high - low) if keeps_sign else 1.0)

    def weights(self, records: WhiteRecords) -> Array:
        """Return how much of the change each record file has, (n_files,)."""
        files = [record.file for record in records.data.records]
        if self.file:
            return np.array([float(file == self.file) for file in files])
        return np.arange(len(files)) / (len(files) - 1.0) - 0.5

    def undone(self, fit: Fit, size: float) -> "Undone":
        """Return what takes the change out of records, taken about a fit and a size of it."""
        records = fit.base or fit.records
        firsts, changes = [i for i, replay in enumerate(records.replays) if replay.index == 0], []
        at, names, reach = records.shares(free_values(records, fit.values)), records.space.free_names, self.reach(fit)
        for weight, index in zip(self.weights(records), firsts, strict=True):
            if weight == 0.0:
                continue
            share = size * reach * weight * np.array([0.0, 0.5, 1.0])
            Z, shares = np.tile(at, (3, 1)), {name: np.full(3, off) for name, off in fit.constants.items()}
            if self.product is not None:
                name = self.product.names[0]
                shares[name] = (1.0 + fit.constants.get(name, 0.0)) * (1.0 + share) - 1.0
            else:
                Z += np.outer(share, [name == self.name for name in names])
            changes.append((index, tuple(x[0] - x[1:] for x in simulated_file(records, index, Z, shares))))
        return Undone(size, reach, tuple(changes))


@dataclass(frozen=True, eq=False)
class Undone:
    """Return records as they would be without a change: a parabola through none, a half and a whole.

    size: of the whole. reach: largest plausible size, see `OfParameter.reach`. changes: of each file its index, and of
    each of its signals what a half and the whole change, (2, n_samples).
    """

    size: float
    reach: float
    changes: tuple[tuple[int, tuple[Array, ...]], ...]

    def __call__(self, records: WhiteRecords, value: float) -> WhiteRecords:
        share, undone = value / self.size, records
        weights = np.array([4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)])
        for index, changes in self.changes:
            undone = with_measured(undone, index, [weights @ change for change in changes])
        return undone


def hypotheses(fit: Fit, library: Library) -> list[Hypothesis]:
    """Return the changes of parameters and constants, those that there are records enough to tell."""
    files = [record.file for record in fit.records.data.records]
    own = [OfParameter(name) for name in fit.values if library.owner(name) is None]
    own += [OfParameter(p.public, p) for p in fit.products(library.tolerances)]
    drifts = own if len(files) >= FEWEST_RECORDS else []
    others = [replace(one, file=file) for one in own for file in files] if len(files) > FEWEST_OTHERS else []
    return [
        *(Hypothesis("drift", d.name, "", calibration().log_odds("drift", len(drifts)), d) for d in drifts),
        *(Hypothesis("record", f"{one.name.removeprefix(NAMED)}@{one.file}", "",
                     calibration().log_odds("drift", len(others)), one, (one.file, "")) for one in others),
    ]  # fmt: skip


def propose(fit: Fit, known: list[Hypothesis]) -> list[Proposal]:
    """Return the changes that a fit does not hold, with what the largest plausible one does."""
    held, names, proposals = {f.unknown.name for f in fit.others}, list(fit.values), []
    n_samples = [sum(one.n_samples for one in r.each) for r in fit.records.data.records]
    for hypothesis in known:
        what: OfParameter = hypothesis.means
        if hypothesis.size_name in held or (what.product is None and what.name not in names):
            continue
        slope = what.product.slope if what.product is not None else fit.jacobian[:, names.index(what.name)]
        column = what.reach(fit) * slope * np.repeat(what.weights(fit.records), n_samples)
        if column.any():
            proposals.append(
                Proposal(hypothesis, column[np.newaxis], SCALES_OF_DRIFT, np.zeros(1), partial(refit, hypothesis))
            )
    return proposals


def taken_anew(model: Hypotheses, fit: Fit, weight: float) -> Fit:
    """Return a polished fit with what its changes do taken about its estimate, until that stays.

    Fits whose starts follow them stay as they are, as in `polished`.
    """
    changes = {h.size_name: h.means for h in model if isinstance(h.means, OfParameter)}
    if fit.base is None or fits_starts(fit.base.replays):
        return fit
    for _ in range(MOST_TURNS if changes else 0):
        others = (replace(f, unknown=Unknown(f.unknown.name, changes[f.unknown.name].undone(fit, within(f.value))))
                  if f.unknown.name in changes else f for f in fit.others)  # fmt: skip
        before, fit = fit, polished(replace(fit, others=tuple(others)), weight)
        if abs(before.chi2 - fit.chi2) < UNTOLD:
            break
    return fit


def within(size: float) -> float:
    """Return a size about which the effect of a change is taken."""
    return float(np.copysign(np.clip(abs(size), LEAST_SIZE, 1.0), size))


def refit(hypothesis: Hypothesis, fit: Fit, about: Expansion, ahead: Forecast, limit: float) -> Fit | None:
    """Return the model with a change, fitted about its own estimate until that stays: what it does is taken there."""
    base, again, weight, size = fit.base or fit.records, fit, about.scale.weight, ahead.best(1)[0][1]
    others = [f.unknown for f in fit.others if f.unknown.name != hypothesis.size_name]
    for turn in range(MOST_TURNS):
        unknown = Unknown(hypothesis.size_name, hypothesis.means.undone(again, within(size)))
        tried = unless_diverged(lambda: freed(again, base, [*others, unknown], weight, limit, turn == 0))  # noqa: B023
        if tried is None:
            return None
        stays = turn > 1 and abs(tried.chi2 - again.chi2) < max(UNTOLD, ROUGHLY * again.chi2)
        again, size = tried, tried.others[-1].value
        if stays:
            break
    return again
