"""What the closed loop found, for programs."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from armid.discrepancy.advise import Advice
from armid.discrepancy.diagnose import Diagnosis
from armid.discrepancy.estimates import Estimate
from armid.discrepancy.fit import Fit
from armid.discrepancy.group import Group, RivalModel
from armid.discrepancy.library import Library
from armid.discrepancy.missing import Missing
from armid.discrepancy.search import Search
from armid.discrepancy.term import Term
from armid.discrepancy.view import View
from armid.identification import Errors
from armid.model import Model
from armid.record import Campaign

NO_DISCREPANCY, EXPLAINED, PARTLY, UNEXPLAINED, TOO_ALIKE = (
    "no_discrepancy", "explained", "partly_explained", "unexplained", "cannot_tell_apart",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Judgement:
    """Hold one model and what it leaves.

    train, holdout: records as it sees them, their errors and what was found in the residuals; holdout None where there
    are no such records.
    """

    fit: Fit
    model: Model
    estimates: tuple[Estimate, ...]
    train: View
    holdout: View | None
    train_error: Errors
    holdout_error: Errors | None
    diagnosis: Diagnosis
    holdout_diagnosis: Diagnosis | None

    @property
    def significant(self) -> bool:
        """Whether more than noise is left on train or holdout."""
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
    group: Group


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
    refused: Group | None
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
        "advice": [{"manoeuvre": plain(a.manoeuvre), "separates": list(a.separates), "power": a.power}
                   for a in found.advice],
    }  # fmt: skip


def errors_of(judged: Judgement) -> dict[str, dict[str, float | None] | None]:
    """Return errors on train and holdout, null for what is not finite."""
    return {"train": error_entry(judged.train_error), "holdout": error_entry(judged.holdout_error)}


def error_entry(errors: Errors | None) -> dict[str, float | None] | None:
    """Return the errors of some records."""
    return None if errors is None else {k: finite(v) for k, v in asdict(errors).items()}


def entries(judged: Judgement) -> dict[str, dict[str, Any]]:
    """Return name -> value, unit, interval and whether to trust it."""
    return {
        e.name: {"value": e.value, "unit": e.unit, "low": finite(e.low), "high": finite(e.high), "trusted": e.trusted}
        for e in judged.estimates
    }


def plain(manoeuvre: Mapping[str, Any]) -> dict[str, Any]:
    """Return a manoeuvre with Python's own numbers."""
    return {k: v.item() if isinstance(v, np.generic) else v for k, v in manoeuvre.items()}


def finite(value: float | None) -> float | None:
    """Return a float that JSON can hold, None for NaN and infinity."""
    return None if value is None or not np.isfinite(value) else float(value)
