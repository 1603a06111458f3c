"""What the closed loop found, for programs."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from armid.estimation.identify import Errors
from armid.estimation.information import information_at
from armid.loop.advice import Advice
from armid.loop.candidates import Library, base
from armid.loop.diagnose import Diagnosis, View
from armid.loop.empirical import Term
from armid.loop.equivalence import Group, RivalModel
from armid.loop.fit import Fit
from armid.loop.missing_signal import Missing
from armid.loop.score_test import Score
from armid.loop.search import Search
from armid.model import Model
from armid.record import Campaign

# An effect of the library that could bend a parameter by more than this share without being noticed is a doubt: on one
# stroke 2-7 %, on four different ones at most 0.6 % (measured on the arm).
BENT = 0.01
# Half of the 95 % interval may be this share of the value; correlations may be this strong; this near is on a bound.
WIDEST, STRONGEST, AT_BOUND = 0.05, 0.99, 1e-4


@dataclass(frozen=True)
class Estimate:
    """Hold one parameter.

    value, low, high: SI, the 95 % interval, None where it is fixed or not determined. trusted: False where a
    significant discrepancy remains, the bound holds it, the half width exceeds 5 % of the value, a correlation exceeds
    0.99, an effect could bend it unseen, or it was not identified at all; doubts: these reasons in words.
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


def unseen(declared: Fit, scores: Sequence[Score], library: Library) -> dict[str, list[tuple[float, str]]]:
    """Return, for each declared parameter, by how much which effect could bend it unseen, the strongest first."""
    return {
        name: sorted(((float(s.bends[i]), library.public(s.name)) for s in scores), reverse=True)
        for i, name in enumerate(declared.values)
    }


def estimates(
    fit: Fit, library: Library, discrepancy: bool, bends: Mapping[str, Sequence[tuple[float, str]]]
) -> tuple[Estimate, ...]:
    """Return the parameters of the declared model and of the effects added, under their public names.

    discrepancy: whether a significant one remains. bends: see `unseen`.
    """
    problem = fit.records
    space = problem.space
    information = information_at(problem.replays, space, fit.x)
    half = dict(zip(information.names, information.half_width, strict=True))
    strongest = strongest_correlations(information.correlation)
    wanted = {base(n) for n in fit.active}
    found = []
    for i, name in enumerate(space.names):
        owner = name.partition(".")[0]
        if owner in library.candidates and owner not in wanted:
            continue
        value, unit = float(fit.candidate[i]), space.units[i]
        public = public_name(name, library)
        if name not in half:
            found.append(Estimate(public, value, unit, None, None, ("it was not identified: its value is declared",)))
            continue
        j = space.free_names.index(name)
        width = float(half[name])
        doubts = tuple(doubts_of(value, width, float(fit.z[j]), strongest[j], discrepancy))
        doubts += bent_by([b for b in bends.get(name, ()) if b[1] not in {library.public(n) for n in fit.active}])
        low, high = (value - width, value + width) if np.isfinite(width) else (None, None)
        found.append(Estimate(public, value, unit, low, high, doubts))
    return tuple(found)


def bent_by(bends: Sequence[tuple[float, str]]) -> tuple[str, ...]:
    """Return the doubt about a parameter that an effect could bend unseen."""
    if not bends or bends[0][0] <= BENT:
        return ()
    return (f"{bends[0][1]} could bend it by {bends[0][0]:.1%} without being seen on these records",)


def strongest_correlations(correlation: np.ndarray) -> list[float]:
    """Return the strongest correlation of each parameter with another, 1 where it is not determined."""
    off = np.abs(correlation - np.diag(np.diag(correlation)))
    return [float(x) for x in np.nan_to_num(off, nan=1.0).max(axis=1, initial=0.0)] if len(off) else []


def doubts_of(value: float, half: float, share: float, correlation: float, discrepancy: bool) -> list[str]:
    """Return what speaks against a parameter, in words."""
    said = []
    if discrepancy:
        said.append("a significant discrepancy remains")
    if share <= AT_BOUND or share >= 1.0 - AT_BOUND:
        said.append("its bound holds it")
    if not half <= WIDEST * abs(value):
        said.append(f"half of its interval exceeds {WIDEST:.0%} of the value")
    if correlation > STRONGEST:
        said.append(f"it is correlated with another by more than {STRONGEST}")
    return said


def public_name(name: str, library: Library) -> str:
    """Return the name of a parameter as reports show it, whatever form its effect has."""
    owner, dot, own = name.partition(".")
    return f"{library.public(owner)}.{own}" if dot and owner in library.candidates else name


def public_model(fit: Fit, library: Library) -> Model:
    """Return the model of a fit, its effects under their public names."""
    return library.exact(fit.active)


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
