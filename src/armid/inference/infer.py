"""Infer what a declared model lacks: the models that the train records ask for, and how probable each is."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from math import comb
from pathlib import Path
from typing import Any

import numpy as np

from armid.errors import ArmidError, nearest
from armid.estimation.constants import NAMED
from armid.estimation.corrections import rms
from armid.estimation.information import NORMAL_95
from armid.estimation.input_noise import estimated, moved_by_draws, pooled_noise
from armid.estimation.least_squares import Estimates, with_fitted_starts
from armid.estimation.noise_model import NoiseModel, levels_in_motion, levels_left
from armid.inference.candidates import constant_effects
from armid.inference.carry_over import predicting_best
from armid.inference.checks import is_significant, train_residuals
from armid.inference.decisions import LISTED, calibration
from armid.inference.declared import (
    declared_again,
    in_form,
    in_other_form,
    likelier_form,
    schwarz,
    with_fitting_forms,
    with_fitting_shapes,
    with_scales,
)
from armid.inference.evidence import expansion_of
from armid.inference.kinds.effects import least_waves
from armid.inference.kinds.hypothesis import Hypotheses, Hypothesis
from armid.inference.kinds.same_law import doubles
from armid.inference.library import Library, library_of
from armid.inference.model import Fit, unless_diverged, with_data_of
from armid.inference.moves import Exploration, simpler
from armid.inference.posterior import CONSTANTS_TEXT, Posterior, posterior, spread
from armid.inference.search import explore, is_named, leaders_of, without_denied
from armid.inference.unknowns import freed
from armid.inference.whitening import whitened, with_answers
from armid.model import EFFECTS, Effect, Model
from armid.model.effects.sensor import sensor_effects
from armid.problem.problem import by_record
from armid.problem.space import Space
from armid.record import Campaign
from armid.units import counted

# Returns the library with another noise or form, where an inference shows it, else the library as it is.
Revision = Callable[[Library, "Inference"], Library]
# By which factor strengths that scale with the machine may exceed their declared range.
REACH_OF_STRENGTHS = 16.0
# Share of what a model leaves, below which noise of the inputs is a trifle: a thousandth of its square. What ends near
# it is judged again with that noise.
TRIFLE = 0.03
# Names in the sentence that leads, and constants that are named as a cause of an interval's width.
MOST_LEADING, MOST_CONSTANTS = 5, 3


@dataclass(frozen=True)
class Interval:
    """Hold what is known of one parameter, SI.

    low, high: 95 % over the mixture of models. noise_low, noise_high: of noise alone, the model in force as it is.
    causes: what makes the interval wide, with shares of its width squared, the largest first.
    """

    low: float
    high: float
    noise_low: float
    noise_high: float
    causes: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Inference:
    """Hold the models that were fitted, and the posterior over them."""

    exploration: Exploration
    posterior: Posterior
    standing: Hypotheses | None = None

    @property
    def best(self) -> Fit:
        """The most probable model."""
        return self.exploration.fits[self.exploration.ranked()[0][0]]

    @cached_property
    def in_force(self) -> Hypotheses:
        """The most probable model whose parts all have names; where no model is right, the one that predicts best.

        Where held-out records denied some of its parts, what stands of it.
        """
        if self.standing is not None:
            return self.standing
        if not self.posterior.unknown_is_likely:
            return self.named[0]
        return predicting_best(self.named, self.exploration.fits, self.exploration.library)

    @property
    def named(self) -> list[Hypotheses]:
        """The models whose parts all have names, by the summed probability of all forms, then by their own.

        Those with an effect at its null are left out.
        """
        fits = self.exploration.fits
        ranked = [(m, p) for m, p in self.exploration.ranked() if is_named(m) and not fits[m].has_idle_effect]
        sums: dict[frozenset[tuple[str, str]], float] = {}
        for model, p in ranked:
            names = frozenset(h.public for h in model)
            sums[names] = float(np.logaddexp(sums.get(names, -np.inf), p))
        return sorted((m for m, _ in ranked), key=lambda m: -sums[frozenset(h.public for h in m)])

    def without(self, denied: Hypotheses, standing: Hypotheses) -> "Inference":
        """Return what is probable where held-out records deny some hypotheses; standing: the model that is left."""
        exploration = without_denied(self.exploration, denied, standing)
        gone = frozenset(h.public for h in denied)
        return Inference(exploration, self.posterior.without(gone, posterior(exploration)), standing)

    def after_holdout(self, over: Sequence[bool]) -> "Inference":
        """Return what is probable where some of the records held out are missed by more than noise.

        These may be faulty, each for itself, or the model is wrong: then any share of them may be missed, all shares
        being equally likely. P(k of n | wrong) = 1/((n + 1) C(n, k)), P(k of n | faults) = f**k (1 - f)**(n - k).

        Parameters
        ----------
        over : sequence of bool
            Of each held-out record, whether it is missed.

        Returns
        -------
        Inference
            With the same model in force.
        """
        expected, n, k = calibration().expected, len(over), sum(over)
        fault = min(expected["record"] / (n + len(self.exploration.declared.records.data.records)), 0.5)
        wrong = expected["unknown"] / ((n + 1) * comb(n, k))
        faults = (1.0 - expected["unknown"]) * fault**k * (1.0 - fault) ** (n - k)
        return replace(self, posterior=self.posterior.with_unseen(wrong / (wrong + faults)), standing=self.in_force)

    @property
    def probabilities(self) -> dict[str, Any]:
        """What is probable: effects, sets, nothing, unknown, records, drifts; and constants, in their tolerances."""
        post = self.posterior
        return {
            "effects": worth_listing(post.of_kind("effect")),
            "effects_beside_unknown": worth_listing(post.of_kind("effect", True)),
            "sets": [{"hypotheses": sorted(name for _, name in names), "probability": p}
                     for names, p in post.sets.items() if p >= LISTED],
            "nothing": post.nothing,
            "unknown": post.probability("unknown"),
            "records": worth_listing(post.of_kind("record")),
            "drifts": worth_listing(post.of_kind("drift")),
            "constants": self.best.deviations,
        }  # fmt: skip

    def partners(self, model: Hypotheses, hypothesis: Hypothesis) -> dict[str, float]:
        """Return the effects that may replace one of a model, with the probability of such sets."""
        rest, probabilities = {h.public for h in model} - {hypothesis.public}, dict[str, float]()
        for names, p in self.posterior.sets.items():
            named = {n for n in names if n[0] != "unknown"}
            other = named - rest
            if rest < named and len(other) == 1 and other != {hypothesis.public}:
                ((kind, name),) = other
                if kind == "effect":
                    probabilities[name] = probabilities.get(name, 0.0) + p
        return worth_listing(probabilities)

    @cached_property
    def intervals(self) -> dict[str, Interval]:
        """Of each parameter of the model in force; those of an effect over the models that hold it."""
        fit, intervals = self.exploration.fits[self.in_force], {}
        scale, library = self.exploration.scale(), self.exploration.library
        alone = expansion_of(replace(fit, others=()), scale, library, with_doubts=False)
        of_noise = dict(zip(fit.values, fit.records.span * np.sqrt(np.diag(spread(alone))), strict=True))
        sizes = [f.unknown.name for f in self.best.others if not f.unknown.name.startswith(NAMED)]
        constants = self.best.deviations
        which = f" ({', '.join(constants)})" if 0 < len(constants) <= MOST_CONSTANTS else ""
        parts = ["where something unknown acts"] if self.posterior.best_is_unknown else []
        parts += [f"{CONSTANTS_TEXT}{which}"] if constants else [f"size of {sizes[0]}"] if sizes else []
        otherwise = CONSTANTS_TEXT if self.exploration.library.tolerances else "starts of the records"
        beside = ", and ".join(parts) or otherwise
        for name, one in self.of_fit(self.in_force).items():
            if name in self.posterior.parameters:
                causes = tuple(self.posterior.causes(name, float(of_noise[name]), beside))
                low, high = self.posterior.interval(name)
                # what counts all holds what counts noise alone, and not what was known before
                if not (self.posterior.best_is_unknown or name in library.known):
                    low, high = np.fmin(low, one.noise_low), np.fmax(high, one.noise_high)
                low, high = in_box(fit.records.space, name, float(low), float(high))
                intervals[name] = replace(one, low=low, high=high, causes=causes)
        return intervals

    def of_fit(self, model: Hypotheses) -> dict[str, Interval]:
        """Return the intervals of all parameters of one model, were it true: with its constants, and of noise alone.

        That of noise is the one of `identify`: what the model leaves counts as noise.
        """
        exploration, fit = self.exploration, self.exploration.fits[model]
        expansion, n = expansion_of(fit, exploration.scale(), exploration.library), fit.n_free
        narrow, wide = fit.noise_half_width, NORMAL_95 * fit.records.span * np.sqrt(np.diag(spread(expansion))[:n])
        wide = np.maximum(wide, np.where(np.isfinite(narrow), narrow, 0.0))
        triples = zip(fit.values.items(), wide.tolist(), narrow.tolist(), strict=True)
        space = fit.records.space
        return {name: Interval(*in_box(space, name, v - w, v + w), *space.of_one_sign(name, v - a, v + a))
                for (name, v), w, a in triples}  # fmt: skip

    @property
    def sentence(self) -> str:
        """The probabilities in one line."""
        return sentence_of(self.probabilities)

    def __repr__(self) -> str:
        return self.sentence


def in_box(space: Space, name: str, low: float, high: float) -> tuple[float, float]:
    """Return the part of an interval that lies in the box: no machine has a parameter outside it."""
    least, most = (float(ends[space.index(name)]) for ends in (space.low, space.high))
    return min(max(low, least), most), min(max(high, least), most)


def sentence_of(chances: Mapping[str, Any]) -> str:
    """Return probabilities in one line: the effects, faults of records, drifts, nothing, and what nobody knows."""
    named = [f"{name} {p:.2f}" for name, p in chances["effects"].items()]
    left = len(named) - MOST_LEADING
    more = [counted(left, "other")] if left > 0 else []
    faults = [f"{name} {p:.2f}" for name, p in chances["records"].items()]
    faults += [f"drift of {name.removeprefix(NAMED)} {p:.2f}" for name, p in chances["drifts"].items()]
    return "; ".join([*named[:MOST_LEADING], *more, *faults[:MOST_LEADING], f"nothing missing {chances['nothing']:.2f}",
                      f"something that the library does not hold {chances['unknown']:.2f}"])  # fmt: skip


def worth_listing(probabilities: Mapping[str, float]) -> dict[str, float]:
    """Return the probabilities that are listed, the largest first."""
    likely = {name: p for name, p in probabilities.items() if p >= LISTED}
    return dict(sorted(likely.items(), key=lambda pair: -pair[1]))


def prepared(
    model: Model,
    campaign: Campaign,
    candidates: Mapping[str, Effect] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    priors: Mapping[str, float] | None = None,
    threads: int = 1,
    told: Callable[[str], None] = lambda _: None,
    progress: Path | None = None,
) -> tuple[Library, Fit]:
    """Return the declared model with its candidates and the train records, and its fit.

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
        What is known before the records; those that the campaign tells count too.
    threads : int
        Among which candidates are shared; the result does not depend on it.
    told : callable
        Called with a sentence before what takes long.
    progress : Path, optional
        File in which estimates are kept as they are made: a second start goes on from them.

    Returns
    -------
    (Library, Fit)
        What `infer` takes.

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
    estimates = None if progress is None else Estimates(progress)
    if estimates:
        told(f"going on from {len(estimates)} fits of {progress}")
    data = replace(whitened(campaign.train, model.plant), estimates=estimates)
    chances = {**campaign.chances, **(priors or {})}
    known = {name: (one.mean, one.sd) for name, one in campaign.known.items()}

    library = library_of(model, candidates, data, campaign.parameters, bounds or {}, fixed or {}, threads, told, within)
    library = replace(library, reach=REACH_OF_STRENGTHS, priors=chances, known=known)
    problem = library.problem(())
    library = library.about(with_fitted_starts(problem.replays, problem.space))
    exact, declared = with_fitting_forms(*with_noise(*with_scales(library)))
    library = with_input_noise(exact, declared)
    declared = declared if library is exact else declared_again(library, declared)
    return searched(library, declared), declared


def searched(library: Library, declared: Fit) -> Library:
    """Return the library with what of it the fit of its declared model leaves out of a search."""
    whole = replace(library, doubles={}, least_waves=0.0, _problems={})
    return replace(whole, doubles=doubles(declared, whole), least_waves=least_waves(declared), _problems={})


def infer(library: Library, declared: Fit) -> Inference:
    """Return how probable it is that a declared model lacks each effect of a library, from the train records.

    Each hypothesis (an effect, a fault of one record, a drift, a signal without a form) is a block of further unknowns
    with a prior, or a covariance. Models are explored in Occam's window; `evidence` says how one gets its probability.
    All is repeated with another noise, or form of a declared effect, where the records are more probable so, each at
    most once: `REVISIONS`.
    """
    return inferred(library, declared, REVISIONS)


def inferred(
    library: Library, declared: Fit, changes: Sequence[Revision], led_by: Mapping[Hypotheses, Fit] | None = None
) -> Inference:
    """Return an inference, with the first of some changes of the noise that it asks for, and those after it.

    Noise of the inputs counts from the first leading model on that may show it: what it does looks like many effects.
    Models that lead before a change of the noise (led_by) are fitted after it as well.
    """
    noisy = library

    @cache
    def inputs_act(fit: Fit) -> bool:
        nonlocal noisy
        noisy = with_input_noise(library, fit) if with_exact_inputs in changes else library
        return noisy is not library

    exploration = explore(library, declared, inputs_act, led_by)
    if noisy is not library:
        return inferred(noisy, declared_again(noisy, declared), changes, leaders_of(exploration))
    inference = Inference(exploration, posterior(exploration))
    for change in changes:
        other = change(library, inference)
        if other is library:
            continue
        left = [c for c in changes if c is not change]
        if other.declared is library.declared and other.own_shapes_free == library.own_shapes_free:
            return inferred(other, declared_again(other, declared), left, leaders_of(exploration))
        other, again = with_fitting_shapes(*with_scales(other))
        return inferred(searched(other, again), again, left)
    return inference


def with_answering_inputs(library: Library, inference: Inference) -> Library:
    """Return the library with noise of its inputs as the model in force answers to it, if that is all that it leaves.

    The records have to be more probable so than with a signal without a form. The declared model, and one without a
    fault of a record, may answer to the inputs quite otherwise.
    """
    fit = inference.exploration.fits[inference.in_force]
    if not (inference.in_force and inference.posterior.unknown_is_likely and pooled_noise(library.data.records)):
        return library
    answering = with_measured_inputs(as_exact(library), fit)
    if not matters(answering, fit):
        return library
    again = fitted_to(answering, fit, inference)
    if is_significant(again) or not is_likelier(again, inference):
        return library
    library.say("the same with the noise of the inputs as the best model answers to it")
    return answering


def is_likelier(fit: Fit, inference: Inference) -> bool:
    """Tell whether the records are more probable by a fit, with other noise, than by the best model."""
    best = inference.best
    return fit.log_density > best.log_density - 0.5 * best.records.data.log_cover


def fitted_to(library: Library, fit: Fit, inference: Inference) -> Fit:
    """Return a model of an inference fitted to other data of the same records, constants and faults free."""
    again = with_data_of(fit, library)
    if not fit.others:
        return again
    return freed(again, again.records, [f.unknown for f in fit.others], inference.exploration.scale().weight)


def as_exact(library: Library) -> Library:
    """Return a library whose inputs count as exact."""
    return library if library.as_read is None else library.with_data(library.as_read)


def with_exact_inputs(library: Library, inference: Inference) -> Library:
    """Return the library with its inputs as they were read, where they count as noisy and records deny that.

    A controller that computes its output from a noisy speed makes a column that looks like a noisy one. Constants and
    faults are free in both.
    """
    exact = as_exact(library)
    if exact is library:
        return library
    fit = inference.exploration.fits[inference.named[0]]
    if fitted_to(exact, fit, inference).log_density <= fit.log_density:
        return library
    library.say("the inputs count as exact: the records are more probable so")
    return exact


def matters(library: Library, fit: Fit) -> bool:
    """Tell whether what noise of the inputs does is more than a trifle of what a model leaves.

    Where a model is far from right, fits that spare this noise would look at little else but its fastest changes.
    """
    return any(level.moved > TRIFLE * left for level, left in moved_and_left(library, fit))


def may_matter(library: Library, fit: Fit) -> bool:
    """Tell whether noise of the inputs may be more than a trifle of what a model leaves, from a few drawn errors.

    The exact answer takes a simulation for each wave of the noise.
    """
    noise = pooled_noise(library.data.records)
    left = dict(zip(fit.records.replays, train_residuals(fit).raw, strict=True))
    moved = [(r, by) for ready, signals in by_record(fit.records.replays).items()
             for r, by in zip(signals, moved_by_draws(ready, signals, fit.candidate, noise), strict=True)]  # fmt: skip
    return any(by > TRIFLE * rms(left[r]) for r, by in moved)


def moved_and_left(library: Library, fit: Fit) -> list[tuple[NoiseModel, float]]:
    """Return of each signal its noise and what a model leaves of it, rms [its unit]."""
    pairs = zip(library.data.levels, train_residuals(fit).raw, strict=True)
    return [(level, rms(left)) for level, left in pairs]


def with_noise(library: Library, declared: Fit) -> tuple[Library, Fit]:
    """Return the library with the noise that the declared fit shows where no rest tells it, and that fit."""
    if library.data.known:
        return library, declared
    seen = train_residuals(declared)
    levels = levels_left(library.data.levels, seen.replays, seen.raw)
    if levels == library.data.levels:
        return library, declared
    library = library.with_data(library.data.with_levels(levels))
    return library, declared_again(library, declared)


def with_noise_in_motion(library: Library, inference: Inference) -> Library:
    """Return the library with the noise in motion that the model in force shows, else the library as it is.

    If an unknown signal is probable, noise in motion takes its place if the records are more probable with it and no
    test finds more. A fault or an effect of the model in force may only stand in for that noise. If a model may be
    right and records have no rest, alternating noise is looked for too: its differences make it look larger than it is,
    which hides effects.
    """
    is_unknown, read = inference.posterior.unknown_is_likely, library.as_read or library.data
    if not is_unknown and read.known:
        return library
    less = simpler(inference.exploration, inference.in_force, of_any_kind=True) if is_unknown else []
    for model in (inference.in_force, *less):
        noisy = with_noise_left(library, inference.exploration.fits[model], inference, is_unknown)
        if noisy is not None:
            library.say("the noise in motion is another than at rest: the records are more probable so")
            return noisy
    return library


def with_noise_left(library: Library, fit: Fit, inference: Inference, all_is_noise: bool) -> Library | None:
    """Return the library with the noise in motion that a fit shows, None where the records are less probable with it.

    all_is_noise: whether no test may find more in what the fit leaves.
    """
    read, seen = library.as_read or library.data, train_residuals(fit)
    levels = levels_in_motion(read.levels, seen.replays, seen.raw)
    if not any(level.in_motion for level in levels):
        return None
    noisy = library.with_data(read.with_levels(levels))
    noisy = with_measured_inputs(noisy, fit) if library.as_read else noisy
    problem = replace(fit.records, data=noisy.data)
    shown = Fit(fit.active, problem, fit.z, problem.plain.residuals(fit.z)[0])
    if (all_is_noise and is_significant(shown)) or not is_likelier(shown, inference):
        return None
    return noisy


def with_input_noise(library: Library, fit: Fit) -> Library:
    """Return the library whose inputs count as measured with noise, where what a fit leaves may show it."""
    if library.as_read is not None or not pooled_noise(library.data.records) or not is_significant(fit):
        return library
    if not may_matter(library, fit):
        return library
    with_noise = with_measured_inputs(library, fit)
    if not matters(with_noise, fit):
        return library
    library.say("taking the measured inputs as measured with noise")
    return with_noise


def with_measured_inputs(library: Library, fit: Fit) -> Library:
    """Return a library whose inputs are estimates of what was measured, with the noise to which a fit answers.

    library: whose inputs count as exact. fit: of any model, to these records.
    """
    data, noise = library.data, pooled_noise(library.data.records)
    with_noise = with_answers(data, fit.records.replays, fit.candidate, noise)
    records = tuple(estimated(r, noise) for r in data.records)
    return library.with_data(replace(with_noise, records=records), as_read=data)


def with_likelier_form(library: Library, inference: Inference) -> Library:
    """Return the library with a declared effect in another form, or its shapes free, if records are more probable so.

    Far from the noise a form that is wrong may do as well as the right one.
    """
    if not (inference.in_force or inference.posterior.unknown_is_likely):
        return library
    exploration, weight = inference.exploration, inference.exploration.scale().weight
    # a name of the model in force may only stand in for the other form
    models = [inference.in_force, *simpler(exploration, inference.in_force)]

    def fitted(other: Library) -> Fit | None:
        there = replace(other, own_shapes_free=True)
        fits = [unless_diverged(partial(in_other_form, exploration.fits[m], there, weight)) for m in models]
        return max((fit for fit in fits if fit is not None), key=schwarz, default=None)

    least, found = schwarz(exploration.fits[inference.in_force]), library
    if library.own_shapes and not library.own_shapes_free:
        same = fitted(replace(in_form(library, library.declared), bundles=()))
        if same is not None and schwarz(same) > least:
            least, found = schwarz(same), replace(library, own_shapes_free=True, _problems={})
    form = likelier_form(library, least, fitted)
    return found if form is None else replace(in_form(library, form), own_shapes_free=True)


# In this order: inputs that are wrongly taken for noisy, or for exact, look like noise in motion.
REVISIONS: tuple[Revision, ...] = (with_exact_inputs, with_answering_inputs, with_noise_in_motion, with_likelier_form)
