"""Infer what a declared model lacks: the models that the train records ask for, and how probable each is."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from armid.errors import ArmidError, nearest
from armid.estimation.constants import NAMED
from armid.estimation.information import NORMAL_95
from armid.estimation.least_squares import Estimates, with_fitted_starts
from armid.inference.evidence import Expansion
from armid.inference.library import constant_effects, library_of
from armid.inference.model import Fit
from armid.inference.posterior import Posterior, posterior
from armid.inference.search import Exploration, explore
from armid.inference.whitening import whitened
from armid.model import EFFECTS, Effect, Model
from armid.model.effects.sensor import sensor_effects
from armid.record import Campaign

# By which factor strengths that scale with the machine may exceed their declared range.
REACH = 16.0
# Sets and hypotheses of a smaller probability are not listed.
LISTED = 0.01
# A cause of an interval's width is told where it makes at least this share.
LARGEST_CAUSES = 2


@dataclass(frozen=True, eq=False)
class Inference:
    """Hold the models that were fitted, and the posterior over them."""

    found: Exploration
    posterior: Posterior

    @property
    def best(self) -> Fit:
        """The most probable model."""
        return self.found.fits[self.found.ranked()[0][0]]

    @property
    def probabilities(self) -> dict[str, Any]:
        """What is probable: effects, sets, nothing, unknown, records, drifts, and constants in tolerances."""
        post = self.posterior
        return {
            "effects": {n: p for n, p in post.of_kind("effect").items() if p >= LISTED},
            "effects_beside_unknown": {n: p for n, p in post.of_kind("effect", True).items() if p >= LISTED},
            "sets": [{"hypotheses": sorted(name for _, name in names), "probability": p}
                     for names, p in post.sets.items() if p >= LISTED],
            "nothing": post.nothing,
            "unknown": post.probability("unknown"),
            "records": {n: p for n, p in post.of_kind("record").items() if p >= LISTED},
            "drifts": {n: p for n, p in post.of_kind("drift").items() if p >= LISTED},
            "constants": {f.unknown.name.removeprefix(NAMED): f.value for f in self.best.others
                          if f.unknown.name.startswith(NAMED)},
        }  # fmt: skip

    @cached_property
    def intervals(self) -> dict[str, dict[str, Any]]:
        """Of each parameter of the declared model: value, 95 % interval, that of noise alone, causes of the width."""
        found, post = self.found, self.posterior
        best = self.best
        alone = Expansion(best, found.scale(), found.library, np.empty((len(best.residual), 0)))
        alone = replace(alone, fit=replace(best, others=()))
        told = {}
        for name in post.parameters:
            place = list(best.values).index(name)
            half = NORMAL_95 * float(np.sqrt(alone.covariance[place, place]) * best.records.span[place])
            value = best.values[name]
            low, high = post.interval(name)
            causes = post.causes(name, half / NORMAL_95)[:LARGEST_CAUSES]
            told[name] = {"value": value, "low": low, "high": high, "noise_low": value - half,
                          "noise_high": value + half, "causes": causes}  # fmt: skip
        return told

    def __repr__(self) -> str:
        chances = self.probabilities
        named = [f"{n} {p:.2f}" for n, p in chances["effects"].items()]
        listed = [*named[:5], *(f"{n} {p:.2f}" for n, p in chances["records"].items())]
        return "; ".join([*listed, f"nothing missing {chances['nothing']:.2f}",
                          f"something that the library does not hold {chances['unknown']:.2f}"])  # fmt: skip


# Threads of the linear algebra inside our own threads would only wait for each other.
@threadpool_limits.wrap(limits=1, user_api="blas")  # type: ignore[untyped-decorator]
def infer(
    model: Model,
    campaign: Campaign,
    candidates: Mapping[str, Effect] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    priors: Mapping[str, float] | None = None,
    threads: int = 1,
    told: Callable[[str], None] = lambda _: None,
    progress: Path | None = None,
) -> Inference:
    """Return how probable it is that a declared model lacks each effect of a library, from the train records.

    Each hypothesis (an effect, a fault of one record, a drift, a signal without a form) is a block of further unknowns
    with a prior. Models are explored in Occam's window; `evidence` says how a model gets its probability.

    Parameters
    ----------
    model : Model
        The declared model.
    campaign : Campaign
        Records of one machine; those held out are not read.
    candidates : mapping of name to Effect
        None: the library, and the effects of the plant's sensors.
    bounds, fixed : mapping of parameter to (low, high) or value, SI
        Of the model or of a candidate; a bound is a wall, a declared range of a strength is a size to expect.
    priors : mapping of effect to probability
        What is known before the records.
    threads : int
        Among which candidates are shared; the result does not depend on it.
    told : callable
        Called with a sentence before what takes long.
    progress : Path, optional
        File in which estimates are kept as they are made: a second start goes on from them.

    Returns
    -------
    Inference

    Raises
    ------
    ArmidError
        When every candidate of the declared model diverges, for an unknown parameter, and for a prior of an unknown
        effect or outside 0 to 1.
    """
    candidates = {**sensor_effects(model.plant), **EFFECTS} if candidates is None else candidates
    for name, p in (priors or {}).items():
        if name not in candidates:
            raise ArmidError(f"prior of effect '{name}': {nearest(name, candidates)}")
        if not 0.0 < p < 1.0:
            raise ArmidError(f"prior of effect '{name}' is {p:g}: a probability between 0 and 1 is expected")
    within = {name: t for name, t in campaign.tolerances.items() if name not in campaign.rough}
    if campaign.rough:
        model = replace(model, plant=model.plant.known_roughly(campaign.rough))
        candidates = {**candidates, **constant_effects(campaign.rough)}
    data = replace(whitened(campaign.train, model.plant),
                   estimates=None if progress is None else Estimates(progress))  # fmt: skip
    library = library_of(model, candidates, data, campaign.parameters, bounds or {}, fixed or {}, threads, told, within)
    library = replace(library, reach=REACH, priors=priors or {})
    posed = library.problem(())
    library = library.about(with_fitted_starts(posed.replays, posed.space), library.misfit)
    found = explore(library)
    return Inference(found, posterior(found))
