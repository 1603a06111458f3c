"""What the closed loop found, for programs: the result, its parameters with their doubts, and report.json."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from armid.estimation.advice import Advice
from armid.estimation.constants import columns_of
from armid.estimation.identify import JointErrors, errors_by_file, errors_entry, record_errors
from armid.estimation.information import Information, information_of
from armid.estimation.least_squares import held_by_bound
from armid.inference.carry_over import Missed, missed_records
from armid.inference.checks import Diagnosis, Residuals
from armid.inference.library import Library
from armid.inference.missing_signal import Missing
from armid.inference.model import Fit
from armid.inference.score_test import rest_of, score
from armid.loop.empirical import Term
from armid.loop.equivalence import EffectGroup
from armid.loop.search import Search
from armid.loop.suspects import Suspect
from armid.model import Array, Model, is_late_as_a_whole
from armid.problem.problem import Replay
from armid.record import Campaign
from armid.report.document import curve_entry, finite
from armid.report.result import LOOP, Kind, Result

IMPLAUSIBLE, DISAGREES, CARRIES_NOT, NO_DISCREPANCY, EXPLAINED, PARTLY, UNEXPLAINED, TOO_ALIKE = (
    "implausible_records", "record_disagrees", "does_not_carry_over", "no_discrepancy", "explained",
    "partly_explained", "unexplained", "cannot_tell_apart",
)  # fmt: skip
# Where train is noise, held-out records may be simulated worse than their noise by this factor.
CARRIED = 1.1
# An effect of the library that could bias a parameter by more than this share without being noticed is a doubt: on one
# stroke 10-19 %, on four different ones up to 1.2 % (of p0; measured on the arm).
BIASED = 0.01
# An interval that the tolerances of constants widen by more than this factor, and beyond BIASED, rests on them.
RESTS_ON = 2.0
# Doubts for which an interval does not hold.
REMAINS, HELD, CREPT = (
    "a significant discrepancy remains", "its bound holds it", "the fit creeps and has not arrived",
)  # fmt: skip
# Doubt of every value where an effect delays what the motor induces with what drives it.
LATE = "is told of all the drive, of which a part follows the motion: were the voltage alone late, it would be another"
# Candidates whose predicted change of the residual is drawn.
MOST_DRAWN = 4
# Half of the 95 % interval may be this share of the value; correlations may be this strong.
WIDEST, STRONGEST = 0.05, 0.99


@dataclass(frozen=True)
class Estimate:
    """Hold one parameter.

    value, low, high: SI, the 95 % interval, which counts the tolerances of the constants; None where it is fixed or not
    determined. given_low, given_high: were the constants as declared. trusted: False where a
    significant discrepancy remains, the bound holds it, the half width exceeds 5 % of the value, a correlation exceeds
    0.99, an effect could bias it unseen, or it was not identified at all; doubts: these reasons in words.
    """

    name: str
    value: float
    unit: str
    low: float | None
    high: float | None
    doubts: tuple[str, ...]
    given_low: float | None = None
    given_high: float | None = None
    given_doubts: tuple[str, ...] = ()

    @property
    def trusted(self) -> bool:
        """Whether nothing speaks against the value and its interval."""
        return not self.doubts

    @property
    def trusted_given_constants(self) -> bool:
        """Whether nothing would, were the constants as declared."""
        return not self.given_doubts


@dataclass(frozen=True, eq=False)
class Judgement:
    """Hold one model and what it leaves on the records; holdout: None where there are no such records."""

    fit: Fit
    model: Model
    estimates: tuple[Estimate, ...]
    train: Residuals
    holdout: Residuals | None

    @property
    def train_error(self) -> JointErrors:
        return self.train.errors

    @property
    def holdout_error(self) -> JointErrors | None:
        return None if self.holdout is None else self.holdout.errors

    @property
    def diagnosis(self) -> Diagnosis:
        return self.train.diagnosis

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
        # what differences tell of the noise is the least that it can be
        seen = self.train_error.outputs
        least = {n: max(rms, seen[n].rmse if n in seen else 0.0) for n, rms in unseen.noise_of.items()}
        return any(e.rmse > CARRIED * least[n] for n, e in unseen.errors.outputs.items())


@dataclass(frozen=True, eq=False)
class Step:
    """Hold one turn of the loop: the effect that was added and what became of errors and parameters.

    alternatives: names of the effects that it cannot be told from. empirical: whether it is a term without a name.
    claimed: whether its name is claimed, or only a candidate, as where it does not carry over. constants: names of
    constants that would do as well within their tolerances; where the step is such constants, those that it moves.
    """

    effect: str
    port: str
    alternatives: tuple[str, ...]
    empirical: bool
    claimed: bool
    constants: tuple[str, ...]
    after: Judgement
    group: EffectGroup


@dataclass(frozen=True, eq=False)
class Withdrawn:
    """Hold an addition that the records held out denied: its steps, and the model that it was."""

    steps: tuple[Step, ...]
    judged: Judgement


@dataclass(frozen=True, eq=False, repr=False)
class ClosedLoop(Result):
    """Hold the result of the closed loop; it prints itself, and has a table, figures and files.

    verdict: "implausible_records", "record_disagrees", "does_not_carry_over", "no_discrepancy", "explained",
    "partly_explained", "unexplained" or "cannot_tell_apart"; also: the others that hold. before, after: the declared
    model, and the model in force, with the effects that earned their place. withdrawn: what the held-out records
    denied, None where nothing. refused: a group too big to be a finding, None where there is none. rivals: other models
    that fit nearly as well and differ in more effects than one. next_steps: what to do beside the record that is
    advised, in words. known_together: which parameters and constants the train records give only together, in words.
    suspects: records that differ, and samples that are no data; error_all_records: "before" and
    "after" -> errors on train and holdout with nothing left out. library, search: everything that was tried. missing:
    the signal that the named effects leave unexplained, None where they leave nothing or it was not sought; term: the
    empirical term for it, None where none earned its place.
    """

    kind: ClassVar[Kind] = LOOP
    campaign: Campaign
    verdict: str
    also: tuple[str, ...]
    before: Judgement
    after: Judgement
    steps: tuple[Step, ...]
    withdrawn: Withdrawn | None
    refused: EffectGroup | None
    rivals: tuple[Fit, ...]
    advice: tuple[Advice, ...]
    next_steps: tuple[str, ...]
    known_together: tuple[str, ...]
    suspects: tuple[Suspect, ...]
    error_all_records: Mapping[str, Sequence[JointErrors | None]]
    library: Library
    search: Search
    missing: Missing | None
    term: Term | None

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that were added, in order."""
        return tuple(s.effect for s in self.steps)

    @property
    def model(self) -> Model:
        """The declared model with the effects."""
        return self.after.model

    @property
    def outputs(self) -> dict[str, dict[str, Any]]:
        """Output -> its unit and the noise of its train records."""
        train = self.before.train
        pairs = [(r.place, level.rms) for r, level in zip(train.replays, train.data.levels, strict=True)]
        each = [(o, [rms for place, rms in pairs if place == i]) for i, o in enumerate(self.campaign.plant.outputs)]
        return {o.name: {"unit": o.unit, "noise_rms": float(np.mean(rms))} for o, rms in each if rms}

    @property
    def noise_rms(self) -> float:
        """Noise of the train records of the first output, its unit; NaN where none holds it."""
        return float(self.outputs.get(self.campaign.plant.outputs[0].name, {"noise_rms": np.nan})["noise_rms"])

    @property
    def parameters(self) -> dict[str, float]:
        """Name -> value after the last step, SI."""
        return {e.name: e.value for e in self.after.estimates}


Biases = Mapping[str, Sequence[tuple[float, str]]]


def unseen_biases_of(fit: Fit, found: Iterable[tuple[str, Array]]) -> Biases:
    """Return, for each parameter, by how much of its value which effect could bias it unseen, the strongest first.

    found: public name of an effect and the biases of each free parameter, SI.
    """
    pairs = list(found)
    return {
        name: sorted(((float(own[i]) / abs(value), effect) for effect, own in pairs if value), reverse=True)
        for i, (name, value) in enumerate(fit.values.items())
    }


def estimates(
    fit: Fit, library: Library, discrepancy: bool, biases: Biases, members: Sequence[Fit]
) -> tuple[Estimate, ...]:
    """Return the parameters of the declared model and of the effects added, under their public names.

    discrepancy: whether a significant one remains. biases: see `unseen_biases_of`. members: other models over which the
    intervals of the declared model's own parameters reach; an effect that one of them does without is not trusted.
    """
    views = [interval_view(fit, members, {})]
    views.append(interval_view(fit, members, library.tolerances) if library.tolerances else views[0])
    space, held = fit.records.space, held_by_bound(fit.records.space, fit.x)
    active = {key.declared for key in fit.active}
    present = {key.public for key in fit.active}
    late = delays_of_the_drive(fit, library) if is_late_as_a_whole(library.declared.plant) else []
    found = []
    for name, value, unit in zip(space.names, map(float, fit.candidate), space.units, strict=True):
        owner = library.owner(name)
        if owner is not None and owner not in active:
            continue
        public = name if owner is None else f"{owner.public}.{name.partition('.')[2]}"
        if name not in space.free_names:
            why = ("it was not identified: its value is declared",)
            found.append(Estimate(public, value, unit, None, None, why, given_doubts=why))
            continue
        i = space.free_names.index(name)
        share, effect = next((b for b in biases.get(name, ()) if b[1] not in present), (0.0, ""))
        rivals = [] if owner is None else sorted(
            {n for m in members if owner.public not in m.names for n in m.names} - present
        )  # fmt: skip
        in_doubt = [f"{' or '.join(rivals)} would do in the place of {public.partition('.')[0]}"] if rivals else []
        told = []
        for intervals, strongest in views:
            low, high = intervals[name]
            given = 0.5 * (views[0][0][name][1] - views[0][0][name][0])
            doubts_of = [REMAINS] if discrepancy else []
            doubts_of += [HELD] if held[i] else []
            doubts_of += [CREPT] if fit.crept else []
            doubts_of += in_doubt
            doubts_of += [f"{' and '.join(late)} {LATE}"] if late else []
            if not max(value - low, high - value) <= WIDEST * abs(value):
                doubts_of.append(f"half of its interval exceeds {WIDEST:.0%} of the value")
            if strongest[i] > STRONGEST:
                doubts_of.append(f"it is correlated with another by more than {STRONGEST}")
            if share > BIASED:
                size = f"{share:.1%}" if share < 1.0 else "more than itself"
                doubts_of.append(f"{effect} could bias it by {size} without being seen on these records")
            if 0.5 * (high - low) > max(BIASED * abs(value), RESTS_ON * given):
                doubts_of.append("it rests on constants that are known within tolerances alone")
            ends = (low, high) if np.isfinite(high - low) else (None, None)
            told.append((*ends, tuple(doubts_of)))
        (given_low, given_high, given_doubts), (low, high, doubts) = told
        doubts = tuple(d if d in given_doubts else f"{d}, the tolerances of the constants counted" for d in doubts)
        found.append(Estimate(public, value, unit, low, high, doubts, given_low, given_high, given_doubts))
    return tuple(found)


def delays_of_the_drive(fit: Fit, library: Library) -> list[str]:
    """Return the names of the effects that follow the drive with states of their own, and act in its place."""
    effects = {key.public: library.candidates[key.declared] for key in fit.active}
    return sorted(n for n, e in effects.items() if (e.states or e.delays) and "drive" in e.adds)


def interval_view(
    fit: Fit, members: Sequence[Fit], tolerances: Mapping[str, float]
) -> tuple[dict[str, tuple[float, float]], Array]:
    """Return the interval of each free parameter over a model and others, and its strongest correlation."""
    information = information_at_fit(fit, tolerances)
    others = np.abs(information.correlation - np.diag(np.diag(information.correlation)))
    intervals = interval_of(fit, information)
    for member in members:
        for name, (low, high) in interval_of(member, information_at_fit(member, tolerances)).items():
            if name in intervals and "." not in name:
                intervals[name] = min(low, intervals[name][0]), max(high, intervals[name][1])
    return intervals, np.nan_to_num(others, nan=1.0).max(axis=1, initial=0.0)


def information_at_fit(fit: Fit, tolerances: Mapping[str, float]) -> Information:
    data, columns = fit.records.data, columns_of(fit.products(tolerances), len(fit.residual))
    columns = columns if data.freed is None else np.hstack([columns, data.freed])
    return information_of(fit.records, fit.z, data.trust(fit.residual), columns)


def interval_of(fit: Fit, information: Information) -> dict[str, tuple[float, float]]:
    return {n: (v - float(h), v + float(h))
            for (n, v), h in zip(fit.values.items(), information.half_width, strict=True)}  # fmt: skip


def report_of(found: ClosedLoop) -> dict[str, Any]:
    """Return the result as JSON can hold it, SI throughout, always with these keys.

    Parameters
    ----------
    found : ClosedLoop
        What `close_loop` returns.

    Returns
    -------
    dict
        What report.json holds.
    """
    return {
        "campaign": found.campaign.name,
        "plant": found.campaign.plant.name,
        "unit": found.campaign.unit,
        "noise_rms": found.noise_rms,
        "noise_rms_holdout": finite(found.before.holdout.noise_rms) if found.before.holdout is not None else None,
        "outputs": found.outputs,
        "verdict": found.verdict,
        "also": list(found.also),
        "effects": list(found.effects),
        "error": {"before": errors_of(found.before), "after": errors_of(found.after)},
        "error_all_records": {
            when: dict(zip(("train", "holdout"), map(errors_entry, told), strict=True))
            for when, told in found.error_all_records.items()
        },
        "suspects": [asdict(s) for s in found.suspects],
        "parameters": {"before": entries(found.before), "after": entries(found.after)},
        "steps": [step_entry(s) for s in found.steps],
        "withdrawn": None if found.withdrawn is None else {
            "effects": [s.effect for s in found.withdrawn.steps],
            "error": {"before": errors_of(found.before), "after": errors_of(found.withdrawn.judged)},
            "parameters": entries(found.withdrawn.judged),
            "steps": [step_entry(s) for s in found.withdrawn.steps],
        },
        "advice": [
            {
                "manoeuvre": {k: v.item() if isinstance(v, np.generic) else v for k, v in a.manoeuvre.items()},
                "separates": list(a.separates), "power": a.power,
            }
            for a in found.advice
        ],
        "next_steps": list(found.next_steps),
        "known_together": list(found.known_together),
        "taken_as_exact": list(found.campaign.taken_as_exact),
        "log": list(found.search.rounds),
    }  # fmt: skip


def step_entry(step: Step) -> dict[str, Any]:
    return {
        "effect": step.effect, "port": step.port, "alternatives": list(step.alternatives), "empirical": step.empirical,
        "claimed": step.claimed, "constants": list(step.constants), "error": errors_of(step.after),
        "parameters": entries(step.after),
    }  # fmt: skip


def errors_of(judged: Judgement) -> dict[str, Any]:
    """Return the errors on train, on holdout (None where there is none) and on each record."""
    replays = (*judged.train.judged, *(judged.holdout.judged if judged.holdout is not None else ()))
    records = {file: errors_entry(e) for file, e in errors_by_file(replays, judged.train.candidate).items()}
    return {"train": errors_entry(judged.train_error), "holdout": errors_entry(judged.holdout_error),
            "records": records}  # fmt: skip


def entries(judged: Judgement) -> dict[str, dict[str, Any]]:
    return {
        e.name: {
            "value": e.value,
            "unit": e.unit,
            "low": finite(e.low),
            "high": finite(e.high),
            "trusted": e.trusted,
            "interval_holds": e.low is not None and not {REMAINS, HELD, CREPT} & set(e.doubts),
            "given_low": finite(e.given_low),
            "given_high": finite(e.given_high),
            "trusted_given_constants": e.trusted_given_constants,
        }
        for e in judged.estimates
    }


def record_entries(before: Residuals | None, after: Residuals | None) -> list[dict[str, Any]]:
    if before is None or after is None:
        return []
    return [
        {
            "file": old.name, "record": old.record.file, "role": old.record.role, "n_samples": len(was),
            "noise_rms": finite(old.record.noise.rms), "unit": old.record.unit,
            "error": {"before": of_output(old, before.candidate), "after": of_output(new, after.candidate)},
            "curves": {"before": curve_entry(old.times, was), "after": curve_entry(new.times, now)},
        }
        for old, was, new, now in zip(before.replays, before.raw, after.replays, after.raw, strict=True)
    ]  # fmt: skip


def of_output(replay: Replay, candidate: Array) -> dict[str, Any]:
    errors = record_errors(replay, candidate)
    outputs = {replay.record.output: errors}
    return errors_entry(JointErrors(**vars(errors), joint_nrmse=errors.rmse / errors.span, outputs=outputs)) or {}


def candidates_of(found: ClosedLoop) -> dict[str, Any]:
    """Return the candidates at the declared model, best first, the changes of the leading ones as curves.

    drop: predicted fall of chi2 as a share of it; reached: that of the full fit with the effect alone, null where there
    was none. Curves are whitened, in standard deviations of the noise, against the number of the sample.
    """
    start = found.before.fit
    reached: dict[str, float] = {}
    for fit in found.search.of_size(1):
        name = fit.active[0].public
        reached[name] = max(reached.get(name, 0.0), 1.0 - fit.chi2 / start.chi2)
    listed: list[dict[str, Any]] = []
    for own in found.search.scores_at(start):
        name = own.key.public
        if any(entry["effect"] == name for entry in listed):
            continue
        again = score(start, own.key, found.library) if len(listed) < MOST_DRAWN else None
        listed.append({
            "effect": name, "drop": finite(own.drop / start.chi2), "p": finite(own.p),
            "reached": finite(reached.get(name)), "share": finite(own.share), "alignment": finite(own.alignment),
            "curve": None if again is None else curve_entry(np.arange(len(again[1]), dtype=float), again[1]),
        })  # fmt: skip
    rest = rest_of(start)
    edges = found.before.train.data.edges
    return {
        "listed": listed,
        "residual": curve_entry(np.arange(len(rest), dtype=float), rest),
        "edges": [int(e) for e in edges],
        "files": [r.name for r in found.before.train.replays],
    }
