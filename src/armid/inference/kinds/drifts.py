"""A parameter or a constant that changes: with the order of the records (a drift), or in one record alone."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armid.estimation.constants import NAMED, Product, moved_record
from armid.inference.decisions import calibration
from armid.inference.evidence import Expansion, Forecast
from armid.inference.kinds.hypothesis import Hypothesis, Proposal
from armid.inference.library import Library
from armid.inference.model import Fit, unless_diverged
from armid.inference.unknowns import Unknown, freed
from armid.inference.whitening import WhiteRecords
from armid.model import Array
from armid.problem.problem import ReadyRecord, by_record, with_each

# Fewest record files for a drift to be considered: with fewer a drift is a change in one record. Of two records
# either may be the other one.
FEWEST_RECORDS, FEWEST_OTHERS = 4, 2
# Its largest plausible size, as a share of the constant, of a parameter that keeps its sign, or of the range of one
# that does not; prior deviations as shares of that.
LARGEST_DRIFT, SCALES_OF_DRIFT = 0.5, np.array([0.01, 0.03, 0.1, 0.3, 1.0])


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

    def change(self, fit: Fit) -> "Change":
        """Return what moves records by the change, as it is about a fit."""
        reach = self.reach(fit)
        if self.product is not None:
            return Change(self.product.names[0], True, reach, self.weights(fit.records))
        span = float(fit.records.span[list(fit.values).index(self.name)])
        return Change(self.name, False, reach * span, self.weights(fit.records))


@dataclass(frozen=True, eq=False)
class Change:
    """Return records in which a parameter or constant is another.

    reach: its largest plausible change, SI; of a constant as a share of its value. weights: how much of it each file
    has, (n_files,).
    """

    name: str
    is_constant: bool
    reach: float
    weights: Array

    def __call__(self, records: WhiteRecords, value: float) -> WhiteRecords:
        new = {old: self.changed(old, value * self.reach * weight)
               for old, weight in zip(by_record(records.replays), self.weights, strict=True)}  # fmt: skip
        return replace(records, replays=with_each(records.replays, lambda old: new[old]))

    def changed(self, ready: ReadyRecord, size: float) -> ReadyRecord:
        if size == 0.0:
            return ready
        if self.is_constant:
            return replace(ready, record=moved_record(ready.record, ready.model.plant, {self.name: size}))
        return replace(ready, changes={**ready.changes, self.name: ready.changes.get(self.name, 0.0) + size})


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


def refit(hypothesis: Hypothesis, fit: Fit, about: Expansion, ahead: Forecast, limit: float) -> Fit | None:
    """Return the model with a change, fitted roughly."""
    name = hypothesis.size_name
    others = [f.unknown for f in fit.others if f.unknown.name != name]
    unknown = Unknown(name, hypothesis.means.change(fit))
    base, weight = fit.base or fit.records, about.scale.weight
    return unless_diverged(lambda: freed(fit, base, [*others, unknown], weight, limit, rough=True))
