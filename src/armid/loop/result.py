"""What the closed loop found, for programs: the result, its doubts, records that differ, and report.json."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from armid.estimation.advice import Advice
from armid.estimation.constants import NAMED
from armid.estimation.identify import JointErrors, entries_of_noise, errors_by_file, record_errors
from armid.estimation.information import NORMAL_95
from armid.estimation.least_squares import held_by_bound
from armid.inference.carry_over import Missed, least_noise, missed_records
from armid.inference.checks import Diagnosis, Residuals
from armid.inference.decisions import AS_WELL, CLAIMED, OVER_NOISE
from armid.inference.evidence import expansion_of
from armid.inference.infer import Inference
from armid.inference.kinds.drifts import OfParameter
from armid.inference.kinds.faults import OfRecord
from armid.inference.kinds.hypothesis import Hypotheses, Hypothesis, words
from armid.inference.kinds.missing_signal import Missing
from armid.inference.library import Library
from armid.inference.model import Fit
from armid.model import Array, Model
from armid.problem.problem import Replay
from armid.record import Campaign, Record
from armid.report.document import curve_entry, plain
from armid.report.result import LOOP, Kind, Result
from armid.units import behind, shown

# Doubts for which an interval does not hold.
REMAINS, ACTS, HELD = "a significant discrepancy remains", "something unknown acts", "it rests at its bound"
# A shape that armid sets free by itself, such as the width of a sign: nobody needs to widen its range.
SEARCHED = "it lies at the end of the range that was searched"
NOT_IDENTIFIED = "it was not identified: its value is declared"
INSTEAD = "a constant without a tolerance may be off instead"
# Kind of a fault -> words: of samples that are no data, and of a size that the whole record is off by.
NO_DATA = {"gap": "bridged over a gap", "clipped": "clipped", "stuck": "repeated", "spikes": "spikes"}
OFF_BY = {
    "start": "starts elsewhere than declared, by", "offset": "its sensor is off by", "gain": "its gain is off by",
    "drift": "its sensor drifts by", "clock": "its clock is fast by",
}  # fmt: skip
# Sizes that are shares of what the file tells.
SHARES = ("gain", "clock")
Verdict = Literal[
    "implausible_records", "record_disagrees", "does_not_carry_over", "no_discrepancy", "explained", "partly_explained",
    "unexplained", "cannot_tell_apart",
]  # fmt: skip
# Listed causes of the width of an interval, and listed models.
MOST_CAUSES, MOST_LISTED = 2, 30
# Of the keys of report.json: 2 came with probabilities.
REPORT_VERSION = 2


@dataclass(frozen=True)
class RecordFault:
    """Say how one record differs.

    kind: "late", "clock" (fast by a share), "offset", "drift", "gain", "start", "label" (another load or key than
    declared), "parameter" (by how much it is larger in this record than in the others), "trend" (of all records: by
    how much it is larger in this one, the last, than in the first), or of samples "gap", "clipped", "stuck", "spikes".
    value, low, high: size with its 95 % interval [unit]; from_s, to_s: where it is [s]; None where there is no such
    thing. action: "freed" (undone) or "left_out" (of samples). output: whose sensor it is, or the input whose gain it
    is, "" where the plant has but one output, and of the whole file. parameter: what is another, or has the trend, then
    others that do as well; "" for other kinds.
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


@dataclass(frozen=True)
class Estimate:
    """Hold one parameter.

    value, low, high: SI, the 95 % interval over all models; None where it is fixed or not determined. noise_low,
    noise_high: of noise alone, the model as it is. causes: what makes the interval wide, in words. doubts: why it is
    not to be trusted, in words.
    """

    name: str
    value: float
    unit: str
    low: float | None
    high: float | None
    doubts: tuple[str, ...]
    noise_low: float | None = None
    noise_high: float | None = None
    causes: tuple[str, ...] = ()

    @property
    def trusted(self) -> bool:
        """Whether nothing speaks against the value and its interval."""
        return not self.doubts

    @property
    def interval_holds(self) -> bool:
        """Whether there is an interval, and nothing speaks against it."""
        return self.low is not None and not {REMAINS, ACTS, HELD} & set(self.doubts)

    @property
    def entry(self) -> dict[str, Any]:
        """The parameter as report.json holds it."""
        return {**plain(self), "trusted": self.trusted, "interval_holds": self.interval_holds}


@dataclass(frozen=True, eq=False)
class Judgement:
    """Hold one model and what it leaves on the records; holdout: None where there are no such records."""

    fit: Fit
    model: Model
    estimates: tuple[Estimate, ...]
    train: Residuals
    holdout: Residuals | None

    @property
    def diagnosis(self) -> Diagnosis:
        return self.train.diagnosis

    @property
    def entries(self) -> dict[str, dict[str, Any]]:
        """Name -> parameter, as report.json holds them."""
        return {e.name: e.entry for e in self.estimates}

    @property
    def significant(self) -> bool:
        return self.diagnosis.significant or (self.holdout is not None and self.holdout.diagnosis.significant)

    @cached_property
    def missed(self) -> list[Missed]:
        """The held-out records whose error is far larger than that of the train records."""
        return missed_records(self.fit, self.train, self.holdout)

    @property
    def fails_to_carry_over(self) -> bool:
        """Whether held-out records are missed by more than noise where train is noise, or far more than train."""
        unseen = self.holdout
        if unseen is None or not unseen.diagnosis.significant:
            return False
        if self.diagnosis.significant:
            return bool(self.missed)
        least = least_noise(self.train, unseen)
        return any(e.rmse > OVER_NOISE * least[n] for n, e in unseen.errors.outputs.items())


@dataclass(frozen=True, eq=False)
class Step:
    """Hold one turn of the loop: the effect that was added and what became of errors and parameters.

    alternatives: names of the effects that may stand in its place, the most probable first. claimed: whether its name
    is claimed. probability: that the machine has it. form: word of its published form, "" for the first:
    `--effects NAME:FORM` declares it. instead: constants without a tolerance that would explain the records as well ->
    by which share each would be off.
    """

    effect: str
    port: str
    alternatives: tuple[str, ...]
    claimed: bool
    probability: float
    after: Judgement
    form: str = ""
    instead: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Withdrawn:
    """Hold an addition that the records held out denied: its steps, and the model that it was.

    worse: by which share their error is larger with it than with the best of the models before it.
    """

    steps: tuple[Step, ...]
    judged: Judgement
    worse: float


@dataclass(frozen=True, eq=False, repr=False)
class ClosedLoop(Result):
    """Hold the result of the closed loop; it prints itself, and has a table, figures and files.

    verdict, also: the most important one, and the others that hold. before, after: the declared model, and the model in
    force, with the effects that earned their place. withdrawn: what the held-out records denied, None where nothing.
    next_steps: what to do as well as the advised record, in words. known_together:
    which parameters and constants the train records give only together, in words. suspects: records that differ, and
    samples that are no data; error_all_records: "before" and "after" -> errors on train and holdout with nothing left
    out. inference: all models that were fitted, and how probable each is. missing: the signal that the model in force
    leaves unexplained, None where it leaves nothing.
    """

    kind: ClassVar[Kind] = LOOP
    campaign: Campaign
    verdict: Verdict
    also: tuple[Verdict, ...]
    before: Judgement
    after: Judgement
    steps: tuple[Step, ...]
    withdrawn: Withdrawn | None
    advice: tuple[Advice, ...]
    next_steps: tuple[str, ...]
    known_together: tuple[str, ...]
    suspects: tuple[RecordFault, ...]
    error_all_records: Mapping[str, Sequence[JointErrors | None]]
    inference: Inference
    missing: Missing | None

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that were added, in order."""
        return tuple(s.effect for s in self.steps)

    @property
    def model(self) -> Model:
        """The declared model with the effects."""
        return self.after.model

    @cached_property
    def outputs(self) -> dict[str, dict[str, Any]]:
        """Output -> its unit, the noise of its train records, and how far noise of inputs moves the model."""
        levels, train = self.before.train.data.levels, self.after.train
        unseen = () if self.after.holdout is None else self.after.holdout.replays
        return entries_of_noise(train.replays, levels, train.candidate, unseen)

    @property
    def noise_rms(self) -> float:
        """Noise of the train records of the first output, its unit; NaN where none holds it."""
        return float(self.outputs.get(self.campaign.plant.outputs[0].name, {"noise_rms": np.nan})["noise_rms"])

    @property
    def parameters(self) -> dict[str, float]:
        """Name -> value after the last step, SI."""
        return {e.name: e.value for e in self.after.estimates}


def estimates(
    inference: Inference, model: Hypotheses, fit: Fit, discrepancy: bool, within: float
) -> tuple[Estimate, ...]:  # fmt: skip
    """Return the parameters of the declared model and of the effects added, under their public names.

    model: one of the inference; fit: it, as it is judged. Of the declared model's own parameters the interval of the
    model in force counts all others. discrepancy: whether a significant one remains.
    """
    library, own = inference.exploration.library, inference.of_fit(model)
    known = {**own, **inference.intervals} if model == inference.in_force else own
    space, held = fit.records.space, held_by_bound(fit.records.space, fit.x)
    alone = dict(zip(fit.values, fit.noise_half_width, strict=True))
    active = {key.declared for key in fit.active}
    is_unknown = inference.posterior.unknown_is_likely
    estimates = []
    for name, value, unit in zip(space.names, map(float, fit.candidate), space.units, strict=True):
        owner = library.owner(name)
        if name not in library.declared.parameters and owner not in active:
            continue
        public = library.public(name)
        if name not in known:
            estimates.append(Estimate(public, value, unit, None, None, (NOT_IDENTIFIED,)))
            continue
        one = known[name]
        low, high = min(one.low, value), max(one.high, value)
        seen = [(cause if " " in cause or cause == "noise" else f"whether {cause} acts", share)
                for cause, share in one.causes[:MOST_CAUSES] if round(share, 2)]  # fmt: skip
        causes = tuple(f"{cause}, {share:.0%}" for cause, share in seen)
        doubts = ([ACTS] if is_unknown else [REMAINS] if model != inference.in_force else []) if discrepancy else []
        if owner is not None and inference.posterior.probability("effect", owner.public) < CLAIMED:
            doubts.append(f"{owner.public} is not certain")
        if held[space.free_names.index(name)]:
            doubts.append(SEARCHED if owner is not None and name in library.fixed_shapes(owner) else HELD)
        if not max(value - low, high - value) <= within * abs(value):
            why = f" (mostly: {seen[0][0]})" if seen and seen[0][1] > 0.5 else ""
            doubts.append(f"its interval reaches more than {within:.0%} away from the value{why}")
        ends = shown_ends(low, high)
        of_noise = shown_ends(*space.of_one_sign(name, value - alone[name], value + alone[name]))
        estimates.append(Estimate(public, value, unit, *ends, tuple(doubts), *of_noise, causes=causes))
    return tuple(estimates)


def shown_ends(low: float, high: float) -> tuple[float | None, float | None]:
    """Return the ends of an interval, None for one that has none."""
    return (low, high) if np.isfinite(high - low) else (None, None)


def report_of(loop: ClosedLoop) -> dict[str, Any]:
    """Return the result as JSON can hold it, SI throughout, always with these keys.

    Parameters
    ----------
    loop : ClosedLoop
        What `close_loop` returns.

    Returns
    -------
    dict
        What report.json holds.
    """
    return plain({
        "version": REPORT_VERSION,
        "campaign": loop.campaign.name,
        "plant": loop.campaign.plant.name,
        "unit": loop.campaign.unit,
        "noise_rms": loop.noise_rms,
        "noise_rms_holdout": None if loop.before.holdout is None else loop.before.holdout.noise_rms,
        "outputs": loop.outputs,
        "verdict": loop.verdict,
        "also": loop.also,
        "probabilities": loop.inference.probabilities | {"among": among(loop.inference.exploration.library)},
        "effects": loop.effects,
        "error": {"before": errors_of(loop.before), "after": errors_of(loop.after)},
        "error_all_records": {
            when: dict(zip(("train", "holdout"), errors, strict=True))
            for when, errors in loop.error_all_records.items()
        },
        "suspects": loop.suspects,
        "parameters": {"before": loop.before.entries, "after": loop.after.entries},
        "steps": [step_entry(s) for s in loop.steps],
        "withdrawn": None if loop.withdrawn is None else {
            "effects": [s.effect for s in loop.withdrawn.steps],
            "error": {"before": errors_of(loop.before), "after": errors_of(loop.withdrawn.judged)},
            "parameters": loop.withdrawn.judged.entries,
            "steps": [step_entry(s) for s in loop.withdrawn.steps],
        },
        "advice": loop.advice,
        "next_steps": loop.next_steps,
        "known_together": loop.known_together,
        "taken_as_exact": (*loop.campaign.taken_as_exact, *loop.campaign.fixed_as_exact),
        "log": log_of(loop.inference),
    })  # fmt: skip


def among(library: Library) -> list[int]:
    """Return how many effects may be named, and how many share the prior probability."""
    return [len({key.public for key in library.joinable(())}), len(library.known_names)]


def step_entry(step: Step) -> dict[str, Any]:
    return {
        "effect": step.effect, "form": step.form, "port": step.port, "alternatives": step.alternatives,
        # a step was a term without a name in results of earlier versions, whose readers ask for the key
        "instead": step.instead, "empirical": False, "claimed": step.claimed, "probability": step.probability,
        "error": errors_of(step.after), "parameters": step.after.entries,
    }  # fmt: skip


def errors_of(judged: Judgement) -> dict[str, Any]:
    """Return the errors on train, on holdout (None where there is none) and on each record."""
    train, holdout = judged.train, judged.holdout
    replays = (*train.judged, *(() if holdout is None else holdout.judged))
    return {"train": train.errors, "holdout": None if holdout is None else holdout.errors,
            "records": errors_by_file(replays, train.candidate)}  # fmt: skip


def record_entries(before: Residuals | None, after: Residuals | None) -> list[dict[str, Any]]:
    if before is None or after is None:
        return []
    return [
        {
            "file": old.name, "record": old.record.file, "role": old.record.role, "n_samples": len(was),
            "noise_rms": old.record.noise.rms, "unit": old.record.unit,
            "error": {"before": of_output(old, before.candidate), "after": of_output(new, after.candidate)},
            "curves": {"before": curve_entry(old.times, was), "after": curve_entry(new.times, now)},
        }
        for old, was, new, now in zip(before.replays, before.raw, after.replays, after.raw, strict=True)
    ]  # fmt: skip


def of_output(replay: Replay, candidate: Array) -> JointErrors:
    errors = record_errors(replay, candidate)
    outputs = {replay.record.output: errors}
    return JointErrors(**vars(errors), joint_nrmse=errors.rmse / errors.span, outputs=outputs)


def spelled(hypothesis: Hypothesis) -> str:
    """Return a hypothesis in words, an effect with the word of its form, an unknown signal with what it follows."""
    joint = {"effect": ":", "unknown": ", over "}.get(hypothesis.kind, "")
    return f"{words([hypothesis])}{joint}{hypothesis.form}" if hypothesis.form and joint else words([hypothesis])


def log_of(inference: Inference) -> list[dict[str, Any]]:
    """Return the models that were fitted, the most probable first, with what they leave."""
    ranked = inference.exploration.ranked()
    return [
        {"hypotheses": sorted(map(spelled, model)), "log_probability": value - ranked[0][1],
         "chi2_per_sample": inference.exploration.fits[model].chi2 / len(inference.exploration.fits[model].residual)}
        for model, value in ranked[:MOST_LISTED]
    ]  # fmt: skip


FREED, LEFT_OUT = "freed", "left_out"
# Unit of a change that is a share of the parameter's value.
OF_VALUE = "of its value"


def record_faults_of(accused: Sequence[Hypothesis], model: Hypotheses, inference: Inference) -> list[RecordFault]:
    """Return the faults of records, and the changes of parameters, among some hypotheses of a model."""
    fit = inference.exploration.fits[model]
    return [change_of(h, fit, inference) if isinstance(h.means, OfParameter) else fault_of(h, fit, inference)
            for h in sorted(accused) if h.kind in ("record", "drift")]  # fmt: skip


def fault_of(hypothesis: Hypothesis, fit: Fit, inference: Inference) -> RecordFault:
    what: OfRecord = hypothesis.means
    record, fault, plant = fit.records.data.each[what.index], what.fault, inference.exploration.library.declared.plant
    if fault.kind == "label":
        constant = record.constants[fault.constant]
        return RecordFault(record.file, record.role, "label", FREED, 1.0 - constant, fault.unit(record, plant))
    output = fault.input or (record.output if fault.of_sensor and len(plant.outputs) > 1 else "")
    size = size_of(hypothesis, what.largest, fault.unit(record, plant), fit, inference)
    return RecordFault(record.file, record.role, fault.kind, FREED, *size, output=output)


def change_of(hypothesis: Hypothesis, fit: Fit, inference: Inference) -> RecordFault:
    what: OfParameter = hypothesis.means
    change: Any = next(f.unknown.moved for f in fit.others if f.unknown.name == hypothesis.size_name)
    unit = OF_VALUE if what.product is not None else fit.model.parameters[what.name].unit
    kind = "parameter" if what.file else "trend"
    record = next((r for r in fit.records.data.records if r.file == what.file), fit.records.data.records[-1])
    likely = inference.posterior.of_kind(hypothesis.kind)
    mine = {h.name: h.means for h in inference.exploration.drifts if h.kind == hypothesis.kind}
    others = [mine[n].name for n, p in likely.items()
              if n in mine and mine[n].file == what.file and n != hypothesis.name and p >= AS_WELL]  # fmt: skip
    size = size_of(hypothesis, change.reach, unit, fit, inference)
    names = ", ".join(name.removeprefix(NAMED) for name in (what.name, *others))
    return RecordFault(record.file, record.role, kind, FREED, *size, parameter=names)


def size_of(
    hypothesis: Hypothesis, factor: float, unit: str, fit: Fit, inference: Inference
) -> tuple[float, str, float, float]:  # fmt: skip
    """Return the size of a fault or change: value, unit and 95 % interval; factor: the unit per prior deviation."""
    place = next(i for i, f in enumerate(fit.others) if f.unknown.name == hypothesis.size_name)
    covariance = expansion_of(fit, inference.exploration.scale(), inference.exploration.library).covariance
    at = fit.n_free + place
    value, half = fit.others[place].value, NORMAL_95 * float(np.sqrt(covariance[at, at]))
    return factor * value, unit, factor * (value - half), factor * (value + half)


def broken_records(records: Sequence[Record]) -> list[RecordFault]:
    """Return the samples that are no data, which were left out."""
    return [
        RecordFault(record.file, record.role, b.kind, LEFT_OUT, float(b.count), "samples", None, None, b.from_s, b.to_s)
        for record in records for signal in record.signals for b in signal.broken
    ]  # fmt: skip


def along(value: float, low: float, high: float) -> tuple[float, float]:
    """Return the ends of an interval in the direction of a value, below 0 where it reaches to the other side."""
    return (low, high) if value > 0.0 else (-high, -low)


def fault_sentence(s: RecordFault) -> str:
    factor, name = (100.0, "%") if s.kind in SHARES else shown(1.0, s.unit)
    unit = behind(name)
    if s.kind in NO_DATA:
        return (f"{s.record}: {s.value:.0f} samples are {NO_DATA[s.kind]}, from {s.from_s:.4g} to {s.to_s:.4g} s: they "
                "count as no data.")  # fmt: skip
    if s.kind == "label" or s.value is None or s.low is None or s.high is None:
        return f"{s.record} looks like a record of another load, or of other inputs than it tells."
    if s.parameter:
        return change_sentence(s, s.value, s.low, s.high)
    if s.kind == "late":
        word = "late" if s.value > 0.0 else "early"
        low, high = along(s.value, 1e3 * s.low, 1e3 * s.high)
        where = f"{s.record}, {s.output}: its sensor is" if s.output else f"{s.record}: starts"
        return f"{where} {sized(1e3 * abs(s.value), low, high, f' ms {word}')}; corrected."
    where = f"{s.record}, {s.output}" if s.output else s.record
    size = sized(factor * s.value, factor * s.low, factor * s.high, unit)
    return f"{where}: {OFF_BY[s.kind]} {size}; corrected."


def change_sentence(s: RecordFault, value: float, low: float, high: float) -> str:
    """Tell by how much a parameter is another; a change of a share by -2 turns its sign."""
    names, is_share = " or ".join(s.parameter.split(", ")), s.unit == OF_VALUE
    factor, unit = (100.0, "%") if is_share else shown(1.0, s.unit)
    turns = is_share and low <= -2.0 <= high
    grew, (low, high) = ("larger" if value > 0.0 else "smaller"), along(value, low, high)
    changed = f"{names} is {sized(factor * abs(value), factor * low, factor * high, behind(unit))} {grew}"
    if s.kind == "trend":
        return (f"{changed} in {s.record}, the last record, than in the first, and changes from each to the next, as "
                "in a machine that warms up, wears or runs in; corrected.")  # fmt: skip
    if turns:
        changed = f"as where an input or a sensor is inverted, {names} has the other sign"
    return f"{s.record}: {changed} in it than in the other records; corrected."


def sized(value: float, low: float, high: float, unit: str) -> str:
    """Return a size with its interval, with as many digits as tell its ends apart."""
    digits = next((n for n in range(3, 7) if f"{low:.{n}g}" != f"{high:.{n}g}"), 7)
    return f"{value:.{digits}g}{unit} ({low:.{digits}g} to {high:.{digits}g})"
