"""Faults of one record: late, clock, offset, drift, gain, start, another load."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from armid.inference.decisions import MOVES, calibration
from armid.inference.evidence import Expansion, Forecast
from armid.inference.hypothesis import Hypothesis, Proposal
from armid.inference.kinds.faults import Fault, column_of, faults_of, moved_by, with_record
from armid.inference.library import Library
from armid.inference.model import Fit, fit_from
from armid.inference.refit import unless_diverged
from armid.inference.unknowns import Unknown, freed
from armid.inference.whitening import WhiteRecords
from armid.model import Array

# Prior deviations of a size, as shares of the largest plausible one.
SCALES = np.array([0.01, 0.03, 0.1, 0.3, 1.0])


@dataclass(frozen=True)
class OfRecord:
    """Name a fault and its record."""

    index: int
    fault: Fault
    largest: float

    def moved(self, records: WhiteRecords, value: float) -> WhiteRecords:
        """Return the records without the fault; value: in the largest plausible size, of a label 1 for the other."""
        if self.fault.kind == "label":
            given = records.data.each[self.index].constants[self.fault.constant]
            return with_record(records, self.index, self.fault, 1.0 - given) if value > 0.5 else records
        return with_record(records, self.index, self.fault, value * self.largest)

    def unknown(self, name: str, records: WhiteRecords) -> Unknown:
        """Return the size as an unknown; samples that were not measured at their new times must not speak for it."""
        record = records.data.each[self.index]
        return Unknown(name, self.moved, lambda value: self.fault.spent(record, value * self.largest),
                       self.column)  # fmt: skip

    def column(self, records: WhiteRecords, z: Array, value: float) -> Array:
        """Return what the largest plausible size takes away of the residual, about a value."""
        return self.largest * column_of(records, self.index, z, self.fault, value * self.largest)


def hypotheses(records: WhiteRecords) -> list[Hypothesis]:
    """Return what may be wrong in one of several records; a single record has nothing to compare it with."""
    if len(records.data.records) < 2:
        return []
    faults = []
    for index, record in enumerate(records.data.each):
        for fault in faults_of(records, index):
            largest = 1.0 if fault.kind == "label" else fault.largest(record)
            place = f"{record.file}:{record.output}" if fault.kind in ("offset", "drift", "gain") else record.file
            name = f"{fault.kind}{'_' if fault.constant else ''}{fault.constant}@{place}"
            faults.append((name, OfRecord(index, fault, largest)))
    return [
        Hypothesis("record", name, "", calibration().log_odds("record", len(faults)), what) for name, what in faults
    ]


def propose(fit: Fit, known: list[Hypothesis], library: Library) -> list[Proposal]:
    """Return the faults of records that a fit does not hold, with what the largest plausible size does."""
    held = {f.unknown.name for f in fit.others}
    return [p for p in library.each(lambda h: proposal(fit, h), [h for h in known if h.name not in held])
            if p is not None]  # fmt: skip


def proposal(fit: Fit, hypothesis: Hypothesis) -> Proposal | None:
    what: OfRecord = hypothesis.means
    if what.fault.kind == "label":
        before, after = (r.plain.residuals(fit.z)[0] for r in (fit.records, what.moved(fit.records, 1.0)))
        column, scales = before - after, np.array([1.0])
    else:
        column = what.largest * column_of(fit.records, what.index, fit.z, what.fault, 0.0)
        scales = SCALES
    if not np.isfinite(column).all() or not column.any():
        return None
    return Proposal(hypothesis, column[np.newaxis], scales, np.zeros(1), partial(refit, hypothesis))


def refit(hypothesis: Hypothesis, fit: Fit, about: Expansion, ahead: Forecast, limit: float) -> Fit | None:
    """Return the model with a fault undone, its size fitted with all other unknowns."""
    what: OfRecord = hypothesis.means
    base = fit.base or fit.records
    unknown = what.unknown(hypothesis.name, base)
    if what.fault.kind == "label":
        return unless_diverged(lambda: relabelled(fit, what, limit))
    unknowns = [*(f.unknown for f in fit.others), unknown]
    again = unless_diverged(lambda: freed(fit, base, unknowns, about.scale.weight, limit, rough=True))
    if again is None:
        return None
    size = again.others[-1].value * what.largest
    moves = moved_by(base, what.index, again.z, what.fault, size)
    return again if moves >= MOVES else None


def relabelled(fit: Fit, what: OfRecord, limit: float) -> Fit:
    """Return the model with another load, or key, of a record than its file says."""
    problem = what.moved(fit.records, 1.0)
    return fit_from(problem, fit.active, [fit.z, np.full(fit.n_free, 0.5)], limit=limit)
