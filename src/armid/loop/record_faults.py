"""Records that differ: faults and drifts that the model in force holds, and samples that are no data."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armid.estimation.information import NORMAL_95
from armid.inference.decisions import AS_WELL
from armid.inference.evidence import expansion_of
from armid.inference.hypothesis import Hypotheses, Hypothesis
from armid.inference.infer import Inference
from armid.inference.kinds.drifts import LARGEST, OfParameter
from armid.inference.kinds.faults import OF_SENSOR
from armid.inference.kinds.records import OfRecord
from armid.inference.model import Fit
from armid.record import Record
from armid.units import shown

FREED, LEFT_OUT = "freed", "left_out"


@dataclass(frozen=True)
class RecordFault:
    """Say how one record differs.

    kind: "late", "clock" (fast by a share), "offset", "drift", "gain", "start", "label" (another load or key than
    declared), "trend" (of all records: by how much the parameter is larger in this one, the last, than in the
    first), or of samples "gap", "clipped", "stuck", "spikes". value, low, high: size with its 95 % interval
    [unit]; from_s, to_s: where it is [s]; None where there is no such thing. action: "freed" (undone) or "left_out" (of
    samples). output: whose sensor it is, "" where the plant has but one, and of the whole file. parameter: what has
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


def record_faults_of(accused: Sequence[Hypothesis], model: Hypotheses, inference: Inference) -> list[RecordFault]:
    """Return the faults of records, and the drifts, among some hypotheses of a model."""
    fit = inference.exploration.fits[model]
    return [fault_of(h.means, h.name, fit, inference) if h.kind == "record" else
            drift_of(h.means, h.name, fit, inference)
            for h in sorted(accused) if h.kind in ("record", "drift")]  # fmt: skip


def fault_of(what: OfRecord, name: str, fit: Fit, inference: Inference) -> RecordFault:
    record, fault, plant = fit.records.data.each[what.index], what.fault, inference.exploration.library.declared.plant
    if fault.kind == "label":
        constant = record.constants[fault.constant]
        return RecordFault(record.file, record.role, "label", FREED, 1.0 - constant, fault.unit(record, plant))
    value, half = size_of(name, fit, inference)
    output = record.output if fault.kind in OF_SENSOR and len(plant.outputs) > 1 else ""
    low, high = what.largest * (value - half), what.largest * (value + half)
    unit = fault.unit(record, plant)
    return RecordFault(
        record.file, record.role, fault.kind, FREED, what.largest * value, unit, low, high, output=output
    )


def drift_of(what: OfParameter, name: str, fit: Fit, inference: Inference) -> RecordFault:
    value, half = size_of(f"drift of {name}", fit, inference)
    last, factor, unit = fit.records.data.records[-1], LARGEST, "1"
    if what.product is None:
        place = list(fit.values).index(what.name)
        factor, unit = factor * float(fit.records.span[place]), fit.model.parameters[what.name].unit
    low, high = factor * (value - half), factor * (value + half)
    others = [n for n, p in inference.posterior.of_kind("drift").items() if n != name and p >= AS_WELL]
    return RecordFault(
        last.file, last.role, "trend", FREED, factor * value, unit, low, high, parameter=", ".join([name, *others])
    )


def size_of(name: str, fit: Fit, inference: Inference) -> tuple[float, float]:
    """Return a further unknown of a fit and half its 95 % interval, in prior deviations."""
    place = next(i for i, f in enumerate(fit.others) if f.unknown.name == name)
    covariance = expansion_of(fit, inference.exploration.scale(), inference.exploration.library).covariance
    at = fit.n_free + place
    return fit.others[place].value, NORMAL_95 * float(np.sqrt(covariance[at, at]))


def broken_records(records: Sequence[Record]) -> list[RecordFault]:
    """Return the samples that are no data, which were left out."""
    return [
        RecordFault(record.file, record.role, b.kind, LEFT_OUT, float(b.count), "samples", None, None, b.from_s, b.to_s)
        for record in records for signal in record.signals for b in signal.broken
    ]  # fmt: skip


def fault_sentence(s: RecordFault) -> str:
    factor, name = shown(1.0, s.unit)
    unit = "" if name == "1" else f" {name}"
    if s.kind in ("gap", "clipped", "stuck", "spikes"):
        words = {"gap": "bridged over a gap", "clipped": "clipped", "stuck": "repeated", "spikes": "spikes"}[s.kind]
        where = f"from {s.from_s:.4g} to {s.to_s:.4g} s"
        return f"{s.record}: {s.value:.0f} samples are {words}, {where}: they count as no data."
    if s.kind == "label" or s.value is None or s.low is None or s.high is None:
        return f"{s.record} looks like a record of another load, or of other inputs than it tells."
    if s.kind == "trend":
        grew, low, high = ("larger" if s.value > 0.0 else "smaller"), *sorted((abs(s.low), abs(s.high)))
        size = f"{factor * abs(s.value):.3g}{unit} ({factor * low:.3g} to {factor * high:.3g})"
        names = " or ".join(s.parameter.split(", "))
        return (f"{names} is {size} {grew} in {s.record}, the last record, than in the first, and changes from each to "
                "the next, as in a machine that warms up, wears or runs in; corrected.")  # fmt: skip
    if s.kind == "late":
        word = "late" if s.value > 0.0 else "early"
        low, high = sorted((1e3 * abs(s.low), 1e3 * abs(s.high)))
        return f"{s.record}: starts {1e3 * abs(s.value):.3g} ms {word} ({low:.3g} to {high:.3g}); corrected."
    words = {"start": "starts elsewhere than declared, by", "offset": "its sensor is off by",
             "gain": "its gain is off by", "drift": "its sensor drifts by",
             "clock": "its clock is fast by a share of"}[s.kind]  # fmt: skip
    where = f"{s.record}, {s.output}" if s.output else s.record
    size = f"{factor * s.value:.3g}{unit} ({factor * s.low:.3g} to {factor * s.high:.3g})"
    return f"{where}: {words} {size}; corrected."
