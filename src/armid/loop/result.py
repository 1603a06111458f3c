"""What the closed loop found, for programs: the result, its parameters with their doubts, and report.json."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from armid.estimation.identify import Errors
from armid.estimation.information import information_of
from armid.estimation.least_squares import held_by_bound
from armid.loop.advice import Advice
from armid.loop.candidates import Library
from armid.loop.diagnose import Diagnosis, Residuals
from armid.loop.empirical import Term
from armid.loop.equivalence import EffectGroup, RivalModel
from armid.loop.fit import Fit
from armid.loop.missing_signal import Missing
from armid.loop.score_test import Score
from armid.loop.search import Search
from armid.model import Model
from armid.record import Campaign

NO_DISCREPANCY, EXPLAINED, PARTLY, UNEXPLAINED, TOO_ALIKE = (
    "no_discrepancy", "explained", "partly_explained", "unexplained", "cannot_tell_apart",
)  # fmt: skip
# An effect of the library that could bias a parameter by more than this share without being noticed is a doubt: on one
# stroke 2-7 %, on four different ones at most 0.6 % (measured on the arm).
BIASED = 0.01
# Half of the 95 % interval may be this share of the value; correlations may be this strong.
WIDEST, STRONGEST = 0.05, 0.99


@dataclass(frozen=True)
class Estimate:
    """Hold one parameter.

    value, low, high: SI, the 95 % interval, None where it is fixed or not determined. trusted: False where a
    significant discrepancy remains, the bound holds it, the half width exceeds 5 % of the value, a correlation exceeds
    0.99, an effect could bias it unseen, or it was not identified at all; doubts: these reasons in words.
    """

    name: str
    value: float
    unit: str
    low: float | None
    high: float | None
    doubts: tuple[str, ...]

    @property
    def trusted(self) -> bool:
        """Whether nothing speaks against the value and its interval."""
        return not self.doubts


@dataclass(frozen=True, eq=False)
class Judgement:
    """Hold one model and what it leaves.

    train, holdout: what it leaves on the records, their errors and what was found there; holdout None where there are
    no such records.
    """

    fit: Fit
    model: Model
    estimates: tuple[Estimate, ...]
    train: Residuals
    holdout: Residuals | None
    train_error: Errors
    holdout_error: Errors | None
    diagnosis: Diagnosis
    holdout_diagnosis: Diagnosis | None

    @property
    def significant(self) -> bool:
        return self.diagnosis.significant or (self.holdout_diagnosis is not None and self.holdout_diagnosis.significant)


@dataclass(frozen=True, eq=False)
class Step:
    """Hold one turn of the loop: the effect that was added and what became of errors and parameters.

    alternatives: names of the effects that it cannot be told from. empirical: whether it is a term without a name.
    """

    effect: str
    port: str
    alternatives: tuple[str, ...]
    empirical: bool
    after: Judgement
    group: EffectGroup


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """Hold the result of the closed loop.

    verdict: "no_discrepancy", "explained", "partly_explained", "unexplained" or "cannot_tell_apart". before, after: the
    declared model, and the model with the effects that earned their place. refused: a group too big to be a finding,
    None where there is none. rivals: other models that fit nearly as well and differ in more effects than one. library,
    search: everything that was tried. missing: the signal that the named effects leave unexplained, None where they
    leave nothing; term: the empirical term for it, None where none earned its place.
    """

    campaign: Campaign
    noise_rms: float
    verdict: str
    before: Judgement
    after: Judgement
    steps: tuple[Step, ...]
    refused: EffectGroup | None
    rivals: tuple[RivalModel, ...]
    advice: tuple[Advice, ...]
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
    def parameters(self) -> dict[str, float]:
        """Name -> value after the last step, SI."""
        return {e.name: e.value for e in self.after.estimates}


Biases = Mapping[str, Sequence[tuple[float, str]]]


def unseen_biases_of(declared: Fit, found: Sequence[Score]) -> Biases:
    """Return, for each declared parameter, by how much which effect could bias it unseen, the strongest first."""
    return {
        name: sorted(((float(s.biases[i]), s.key.public) for s in found), reverse=True)
        for i, name in enumerate(declared.values)
    }


def estimates(fit: Fit, library: Library, discrepancy: bool, biases: Biases) -> tuple[Estimate, ...]:
    """Return the parameters of the declared model and of the effects added, under their public names.

    discrepancy: whether a significant one remains. biases: see `unseen_biases_of`.
    """
    space, held = fit.records.space, held_by_bound(fit.records.space, fit.x)
    information = information_of(fit.records, fit.z, fit.records.data.trust(fit.residual))
    active = {key.declared for key in fit.active}
    present = {key.public for key in fit.active}
    others = np.abs(information.correlation - np.diag(np.diag(information.correlation)))
    strongest = np.nan_to_num(others, nan=1.0).max(axis=1, initial=0.0)
    found = []
    for name, value, unit in zip(space.names, map(float, fit.candidate), space.units, strict=True):
        owner = library.owner(name)
        if owner is not None and owner not in active:
            continue
        public = name if owner is None else f"{owner.public}.{name.partition('.')[2]}"
        if name not in space.free_names:
            found.append(Estimate(public, value, unit, None, None, ("it was not identified: its value is declared",)))
            continue
        i = space.free_names.index(name)
        half = float(information.half_width[i])
        doubts = ["a significant discrepancy remains"] if discrepancy else []
        doubts += ["its bound holds it"] if held[i] else []
        if not half <= WIDEST * abs(value):
            doubts.append(f"half of its interval exceeds {WIDEST:.0%} of the value")
        if strongest[i] > STRONGEST:
            doubts.append(f"it is correlated with another by more than {STRONGEST}")
        share, effect = next((b for b in biases.get(name, ()) if b[1] not in present), (0.0, ""))
        if share > BIASED:
            doubts.append(f"{effect} could bias it by {share:.1%} without being seen on these records")
        low, high = (value - half, value + half) if np.isfinite(half) else (None, None)
        found.append(Estimate(public, value, unit, low, high, tuple(doubts)))
    return tuple(found)


def report_of(found: ClosedLoop) -> dict[str, Any]:
    """Return the result as JSON can hold it, SI throughout, always with these keys."""
    return {
        "campaign": found.campaign.name,
        "plant": found.campaign.plant.name,
        "unit": found.campaign.unit,
        "noise_rms": found.noise_rms,
        "verdict": found.verdict,
        "effects": list(found.effects),
        "error": {"before": errors_of(found.before), "after": errors_of(found.after)},
        "parameters": {"before": entries(found.before), "after": entries(found.after)},
        "steps": [
            {
                "effect": s.effect, "port": s.port, "alternatives": list(s.alternatives), "empirical": s.empirical,
                "error": errors_of(s.after), "parameters": entries(s.after),
            }
            for s in found.steps
        ],
        "advice": [
            {
                "manoeuvre": {k: v.item() if isinstance(v, np.generic) else v for k, v in a.manoeuvre.items()},
                "separates": list(a.separates), "power": a.power,
            }
            for a in found.advice
        ],
    }  # fmt: skip


def errors_of(judged: Judgement) -> dict[str, dict[str, float | None] | None]:
    return {"train": error_entry(judged.train_error), "holdout": error_entry(judged.holdout_error)}


def error_entry(errors: Errors | None) -> dict[str, float | None] | None:
    return None if errors is None else {k: finite(v) for k, v in asdict(errors).items()}


def entries(judged: Judgement) -> dict[str, dict[str, Any]]:
    return {
        e.name: {"value": e.value, "unit": e.unit, "low": finite(e.low), "high": finite(e.high), "trusted": e.trusted}
        for e in judged.estimates
    }


def finite(value: float | None) -> float | None:
    """Return a float that JSON can hold, None for NaN and infinity."""
    return None if value is None or not np.isfinite(value) else float(value)
