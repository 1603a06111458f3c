"""Does one record disagree with the others? Before any effect: late, clock, offset, drift, gain, start, another load.

Each is undone in one record, by the size that fits best together with the free parameters; what then leaves noise is a
suspect. One effect explains all records with one strength, a fault one record: where both do, the record is suspected.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.special import chdtri

from armid.errors import ArmidError
from armid.estimation.information import NORMAL_95, start_changes
from armid.inference.checks import holdout_residuals, is_significant, train_residuals
from armid.inference.kinds.faults import (
    OF_SENSOR,
    Fault,
    column_of,
    faults_of,
    moved_by,
    of_file,
    residual_of,
    with_record,
    without_record,
)
from armid.inference.library import Library
from armid.inference.model import Fit, beyond, decomposed, fit_from, with_own_starts
from armid.inference.refit import start_of, unless_diverged
from armid.inference.whitening import WhiteRecords
from armid.loop.fit import FAMILYWISE
from armid.model import Array, Plant
from armid.record import Record
from armid.units import shown

FREED, LEFT_OUT, REPORTED = "freed", "left_out", "reported"
# Those are fitted that to first order take away this share of what is more than noise, at most so many, in so many
# steps; each begins from differences of this share of the largest size.
HALF, MOST, N_STEPS = 0.4, 6, 8
# Of a record without which the others leave more than this share of what is more than noise, none is tried.
DISAGREE = 0.5
# Another load is tried for records that hold more than this share of what is more than noise.
SHARE = 0.2
# A fault that moves the record by less than this many times its noise accuses nobody.
MOVES = 0.7
# A fault is told that leaves noise, or so little of what was more than noise, by so many times its scatter.
LEFT, SCATTER = 0.01, 3.0
# Where noise leaves as much more often than this, no record is left out that would leave noise.
STRIKING = 1e-4
# A push lasts for less than this share of a record, and holds this share of what is more than noise in it.
PUSHED, NEARLY = 0.3, 0.9


@dataclass(frozen=True)
class Suspect:
    """Say how one record differs.

    kind: "late", "clock" (fast by a share), "offset", "drift", "gain", "start", "label" (another load or key than
    told), "push", "trend" (of all records: by how much the parameter is larger in this one, the last, than in the
    first), or of samples "gap", "clipped", "stuck", "spikes". value, low, high: size with its 95 % interval
    [unit]; from_s, to_s: where it is [s]; None where there is no such thing. action: "freed" (undone), "left_out" or
    "reported". output: whose sensor it is, "" where the plant has but one, and of the whole file. parameter: what has
    the trend, then others whose trend does as well; "" for a fault of one record.
    """

    record: str
    role: str
    kind: str
    action: str
    value: float | None = None
    unit: str = ""
    low: float | None = None
    high: float | None = None
    from_s: float | None = None
    to_s: float | None = None
    output: str = ""
    parameter: str = ""


@dataclass(frozen=True, eq=False)
class Mended:
    """Hold a model fitted with one fault of one record undone.

    index: of the record. chi2: with the square of the size over the largest plausible one.
    """

    fit: Fit
    index: int
    fault: Fault
    value: float
    deviation: float
    chi2: float

    def column(self, base: WhiteRecords) -> Array:
        """Return what its largest plausible size does to records without it, whitened, (n_samples,)."""
        change = column_of(base, self.index, start_of(base, self.fit.values), self.fault, 0.0)
        return self.fault.largest(base.data.records[self.index]) * change

    def suspect(self, record: Record, plant: Plant, action: str) -> Suspect:
        fault = self.fault
        if fault.kind == "label":
            return Suspect(record.file, record.role, "label", action, self.value, fault.unit(record, plant))
        half = NORMAL_95 * self.deviation
        output = record.output if fault.kind in OF_SENSOR and len(plant.outputs) > 1 else ""
        return Suspect(record.file, record.role, fault.kind, action, self.value, fault.unit(record, plant),
                       self.value - half, self.value + half, output=output)  # fmt: skip


def mended_records(declared: Fit, library: Library) -> list[Mended]:
    """Return a model with one fault of one record undone, the best fit first.

    Those that leave noise, or next to nothing of what was more than noise: a friction whose form is not quite that of
    the library does not hide a late record. declared: the model, with effects or without.
    """
    base, n = declared.records, len(declared.residual)
    if len({r.file for r in base.data.records}) < 2:
        return []
    tried: list[tuple[float, int, Fault]] = []
    excess = [max(float(part @ part) - len(part), 0.0) for part in base.data.by_record(declared.residual)]
    for index, record in enumerate(base.data.records):
        own = sum(excess[i] for i in of_file(base, index))
        for fault in faults_of(base, index) if others_agree(declared, index) else ():
            if fault.kind == "label":
                tried += [(np.inf, index, fault)] if own > SHARE * sum(excess) else []
                continue
            column = beyond(declared.basis, column_of(base, index, declared.z, fault, 0.0))
            square = float(column @ column) + fault.largest(record) ** -2.0
            tried.append((float(column @ declared.residual) ** 2 / square, index, fault))
    needed = HALF * (declared.chi2 - n)
    sized = sorted((t for t in tried if needed < t[0] < np.inf), key=lambda t: -t[0])[:MOST]
    library.say("asking whether one record disagrees with the others")
    found = library.each(lambda t: unless_diverged(lambda: mended(declared, *t[1:])),
                         [*sized, *(t for t in tried if t[0] == np.inf)])  # fmt: skip
    good = [m for m in found if m is not None and is_earned(declared, m.fit, m.chi2, len(tried))
            and (is_next_to_nothing(m.chi2, declared.chi2, n) or not is_significant(m.fit))]  # fmt: skip
    return sorted(good, key=lambda m: m.chi2)


def is_next_to_nothing(after: float, before: float, n: int) -> bool:
    """Tell whether of what chi2 of so many samples clearly had above the noise next to nothing is left."""
    return before - n > SCATTER * np.sqrt(2.0 * n) and after - n < LEFT * (before - n)


def is_earned(before: Fit, after: Fit, chi2: float, n_tried: int) -> bool:
    """Tell whether a fault, or a trend, does more than noise lets the best of so many do.

    What is left may pass for noise once it is undone although next to nothing has changed. chi2: after it.
    """
    fall = max(before.independent, after.independent) * np.log(before.chi2 / chi2)
    return bool(fall > chdtri(1.0, FAMILYWISE / n_tried))


def others_agree(declared: Fit, index: int) -> bool:
    """Tell whether a fit to all records but one leaves little, to first order: else no fault of that one mends them."""
    own, edges = of_file(declared.records, index), declared.records.data.edges
    others = np.repeat([i not in own for i in range(len(edges) - 1)], np.diff(edges))
    left = beyond(decomposed(declared.jacobian[others])[0], declared.residual[others])
    return float(left @ left) - len(left) < DISAGREE * (declared.chi2 - len(declared.residual))


def mended(declared: Fit, index: int, fault: Fault) -> Mended:
    """Fit the declared model and the size of one fault of one record together, by Gauss-Newton steps.

    Raises ArmidError where the simulation diverges, and for a size that is lost in the noise.
    """
    base = declared.records
    record = base.data.records[index]
    if fault.kind == "label":
        value = 1.0 - record.constants[fault.constant]
        posed = with_record(base, index, fault, value)
        fit = fit_from(posed, declared.active, [declared.z, np.full(declared.n_free, 0.5)])
        return Mended(fit, index, fault, value, 0.0, fit.chi2)
    largest, value, fit = fault.largest(record), 0.0, declared
    for _ in range(N_STEPS):
        column = beyond(fit.basis, column_of(base, index, fit.z, fault, value))
        square = float(column @ column) + largest**-2.0
        step = (float(column @ fit.residual) - value / largest**2) / square
        value += float(np.clip(step, -largest, largest))
        fit = with_own_starts(fit_from(with_record(base, index, fault, value), declared.active, [fit.z]))
        if abs(step) * np.sqrt(square) < 0.1:
            break
    if moved_by(base, index, fit.z, fault, value) < MOVES:
        raise ArmidError(f"{record.file}: a fault that is lost in the noise is none")
    # Samples that nobody measured must not speak for the fault.
    lost = len(of_file(base, index)) * sum(fault.lost(record, value))
    return Mended(fit, index, fault, value, fit.misfit * square**-0.5, fit.chi2 + (value / largest) ** 2 + lost)


def suspect_held_out(
    fit: Fit, records: Sequence[Record], library: Library
) -> tuple[tuple[Record, ...], Suspect | None]:
    """Return the held-out records with one fault of one of them undone that leaves noise, and the suspect.

    The model stays as it is. Records as they are, and None, where none is at fault alone, where the model diverges on
    one, or where it leaves more than noise on train: then what it misses elsewhere is its own.
    """
    plant = fit.model.plant
    least, best, suspect = np.inf, tuple(records), None
    if is_significant(fit):
        return best, None
    unseen = holdout_residuals(fit, tuple(records), library)
    if unseen is None or not unseen.diagnosis.significant or not np.isfinite(unseen.residual).all():
        return best, None
    before, n = float(unseen.residual @ unseen.residual), len(unseen.residual)
    base = WhiteRecords(unseen.replays, fit.records.space, unseen.data)
    files = [record.file for record in records]
    for index, record in enumerate(base.data.records):
        place = files.index(record.file)
        for fault in faults_of(base, index):
            value, deviation = fitted_size(base, index, fit.z, fault)
            if not np.isfinite(value):
                continue
            there = fault.trimmed(records[place], value, plant, record)
            changed = (*records[:place], there, *records[place + 1 :])
            left = holdout_residuals(fit, changed, library)
            assert left is not None
            # A record that is cut to what was measured has fewer samples.
            chi2 = float(left.residual @ left.residual) + n - len(left.residual)
            if chi2 < least and (is_next_to_nothing(chi2, before, n) or not left.diagnosis.significant):
                suspect = Mended(fit, index, fault, value, deviation, chi2).suspect(record, plant, REPORTED)
                least, best = chi2, changed
    return best, suspect


def disagreeing_record(fits: Sequence[Fit]) -> Suspect | None:
    """Return the one record without which what a model leaves is noise, None where there is none or several.

    fits: models to try, the smallest first. Where what it leaves there is in one stretch, that is a push.
    """
    for fit in (f for f in fits if train_residuals(f).diagnosis.p < STRIKING):
        base = fit.records
        first_of = {r.file: i for i, r in reversed([*enumerate(base.data.records)])}
        found = []
        for index in first_of.values() if len(first_of) > 2 else ():
            rest = without_record(base, index)
            again = unless_diverged(partial(fit_from, rest, fit.active, [fit.z]))
            if again is not None and not is_significant(again):
                found.append((index, again))
        if len(found) == 1:
            index, again = found[0]
            record, parts = base.data.records[index], base.data.by_record(residual_of(base, index, again.z))
            # the outputs of a file may have other samples each
            own = of_file(base, index)
            times = np.concatenate([base.replays[i].times for i in own])
            order = np.argsort(times, kind="stable")
            times = times[order]
            first, last = stretch_of(np.concatenate([parts[i] ** 2 for i in own])[order])
            kind = "push" if last - first < PUSHED * len(times) else "label"
            ends = (float(times[first]), float(times[last])) if kind == "push" else (None, None)
            return Suspect(record.file, record.role, kind, LEFT_OUT, from_s=ends[0], to_s=ends[1])
    return None


def stretch_of(squares: Array) -> tuple[int, int]:
    """Return first and last sample of the stretch that holds nearly all of what is more than noise."""
    energy = np.cumsum(np.maximum(squares - 1.0, 0.0))
    first, last = np.searchsorted(energy, energy[-1] * np.array([0.5 - 0.5 * NEARLY, 0.5 + 0.5 * NEARLY]))
    return int(first), min(int(last), len(squares) - 1)


def broken_suspects(records: Sequence[Record]) -> list[Suspect]:
    """Return the samples that are no data, which were left out."""
    return [
        Suspect(record.file, record.role, b.kind, LEFT_OUT, float(b.count), "samples", None, None, b.from_s, b.to_s)
        for record in (one for r in records for one in r.each) for b in record.broken
    ]  # fmt: skip


def suspect_sentence(s: Suspect) -> str:
    factor, name = shown(1.0, s.unit)
    unit = "" if name == "1" else f" {name}"
    if s.kind in ("gap", "clipped", "stuck", "spikes"):
        words = {"gap": "bridged over a gap", "clipped": "clipped", "stuck": "repeated", "spikes": "spikes"}[s.kind]
        where = f"from {s.from_s:.4g} to {s.to_s:.4g} s"
        return f"{s.record}: {s.value:.0f} samples are {words}, {where}: they count as no data."
    if s.kind == "push":
        return f"{s.record}: pushed from {s.from_s:.3g} to {s.to_s:.3g} s; it is left out."
    if s.kind == "label" or s.value is None or s.low is None or s.high is None:
        left = "; it is left out" if s.action == LEFT_OUT else ""
        return f"{s.record} looks like a record of another load, or of other inputs than it tells{left}."
    if s.kind == "trend":
        grew, low, high = ("larger" if s.value > 0.0 else "smaller"), *sorted((abs(s.low), abs(s.high)))
        size = f"{factor * abs(s.value):.3g}{unit} ({factor * low:.3g} to {factor * high:.3g})"
        names = " or ".join(s.parameter.split(", "))
        return (f"{names} is {size} {grew} in {s.record}, the last record, than in the first, and changes from each to "
                "the next, as of a machine that warms up, wears or runs in; so it is taken.")  # fmt: skip
    done = {FREED: "; so it is taken", LEFT_OUT: ", or another fault of it is; it is left out"}.get(s.action, "")
    if s.kind == "late":
        word = "late" if s.value > 0.0 else "early"
        low, high = sorted((1e3 * abs(s.low), 1e3 * abs(s.high)))
        return f"{s.record}: starts {1e3 * abs(s.value):.3g} ms {word} ({low:.3g} to {high:.3g}){done}."
    words = {"start": "starts elsewhere than told, by", "offset": "its sensor is off by", "gain": "its gain is off by",
             "drift": "its sensor drifts by", "clock": "its clock is fast by a share of"}[s.kind]  # fmt: skip
    where = f"{s.record}, {s.output}" if s.output else s.record
    return f"{where}: {words} {factor * s.value:.3g}{unit} ({factor * s.low:.3g} to {factor * s.high:.3g}){done}."


def fitted_size(base: WhiteRecords, index: int, z: Array, fault: Fault) -> tuple[float, float]:
    """Return the size of a fault of a record with its deviation, the model as it is; NaN where it is beyond reason."""
    record, value = base.data.records[index], 0.0
    if fault.kind == "label":
        return 1.0 - record.constants[fault.constant], 0.0
    largest, square = fault.largest(record), 1.0
    spent = [*start_changes(base, z)] if any(p.n_spent for p in base.replays[index].pieces) else []
    starts = np.linalg.qr(np.reshape(spent, (len(spent), base.data.edges[-1])).T)[0]
    for _ in range(N_STEPS):
        column = beyond(starts, column_of(base, index, z, fault, value))
        square = float(column @ column) + largest**-2.0
        here = residual_of(with_record(base, index, fault, value), index, z)
        step = (float(column @ here) - value / largest**2) / square
        if not np.isfinite(step):
            return np.nan, np.nan
        value += float(np.clip(step, -largest, largest))
    is_told = abs(value) < largest and moved_by(base, index, z, fault, value) >= MOVES
    return (value, square**-0.5) if is_told else (np.nan, np.nan)
