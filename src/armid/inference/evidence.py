"""How probable the records are in a model: the log evidence of a fit, and of what may be added to it, to first order.

By Laplace's approximation, with Student's t where a rest of few samples tells the noise,

    log Z = -(nu + n)/2 ln(1 + (Q - n)/(nu + n)) + k/2 ln 2 pi - 1/2 ln |J'J + 2 pi D| + ln prior

Q is the sum of squares over the noise, n the samples, nu the independent samples of the rest, J the whitened
sensitivities to k parameters. D holds the squared prior densities, so that no Occam factor exceeds 1.
Where the best model leaves more than noise, Q is tempered: only independent samples of what it leaves count.
Adding a column X with a strength of prior deviation s to a fit with residual r multiplies the evidence by B,

    2 ln B = (X'r)^2 / (|X|^2 + 1/s^2) - ln(1 + s^2 |X|^2),     X beyond what the unknowns of the fit can do.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.special import log_ndtr, logsumexp

from armid.estimation.constants import NAMED
from armid.estimation.least_squares import held_by_bound
from armid.inference.candidates import EffectKey
from armid.inference.checks import is_significant
from armid.inference.decisions import OUT_OF_TOLERANCE
from armid.inference.kinds.hypothesis import Proposal
from armid.inference.library import Library
from armid.inference.model import Fit
from armid.model import Array

# Prior standard deviations of a strength, as shares of its declared range: its size is known to orders of magnitude,
# and may exceed that range.
SCALES_OF_STRENGTH = np.array([0.03, 0.1, 0.3, 1.0, 3.0, 10.0])
# Prior deviation of a strength that no record shows: rms of the scales within the declared range.
USUAL_STRENGTH = 0.525
# Prior standard deviation of a constant whose tolerance is wrong, in tolerances.
WRONG_TOLERANCE = 3.0
# Fewest independent samples of a residual that is more than noise.
FEWEST_OF_RESIDUAL = 10.0
# By which factor an unknown that must not move is more precise than the records make it: rounding stays far below 1.
IMMOVABLE = 1e9
# What rounding takes of the information on one unknown: columns that are nearly alike stay apart by so much.
ROUNDING = 1e-13
# Largest exponent: exp(500) is still far from overflow.
LARGEST_EXPONENT = 500.0
LOG_2, LOG_2PI = float(np.log(2.0)), float(np.log(2.0 * np.pi))


@dataclass(frozen=True)
class Scale:
    """Hold what a sum of squares counts, the same for all models that are compared.

    n: independent samples. weight: of each square. rest: independent samples from which the noise is known.
    """

    n: float
    weight: float
    rest: float

    def log_likelihood(self, chi2: float) -> float:
        excess = (self.weight * chi2 - self.n) / (self.rest + self.n)
        return float(-0.5 * (self.rest + self.n) * np.log1p(max(excess, -1.0 + 1e-12)))

    def variance(self, chi2: float) -> float:
        """Return the variance of the noise that a fit and the rest show, as a multiple of the declared one."""
        return max((self.rest + self.weight * chi2) / (self.rest + self.n), 0.5)

    def reach(self, log_likelihood: float) -> float:
        """Return the sum of squares at a log-likelihood."""
        total = self.rest + self.n
        exponent = min(-2.0 * log_likelihood / total, LARGEST_EXPONENT)
        return float((np.expm1(exponent) * total + self.n) / self.weight)


def scale_of(best: Fit) -> Scale:
    """Return the scale on which the best model leaves what its residual shows.

    Noise: each independent sample counts. More than noise: what is left is the model's error, of unknown size.
    """
    data, n = best.records.data, float(np.count_nonzero(best.records.data.sound))
    independent = float(np.clip(best.independent, FEWEST_OF_RESIDUAL, n))
    if not is_significant(best):
        # A short rest tells the colour of the noise roughly, so that what is whitened may still be correlated.
        return Scale(independent, independent / n, data.n_noise(otherwise=n))
    square = max(best.chi2 / n, 1.0)
    # How much of the misfit is noise decides how much the rest still tells of its size.
    return Scale(independent, independent / n / square, data.n_noise(otherwise=n) / square**2)


@dataclass(frozen=True, eq=False)
class Expansion:
    """Hold a fit to second order: all its unknowns A, their prior precision, and the residual.

    doubts: further unknowns with a prior deviation of 1 that the fit holds at their prior mean, (n_samples, n).
    without: an effect whose parameters are no unknowns here.
    """

    fit: Fit
    scale: Scale
    library: Library
    doubts: Array
    without: EffectKey | None = None

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """Which free parameters are unknowns here."""
        return np.ones(self.fit.n_free, dtype=np.bool_) if self.without is None else ~self.fit.owned_by(self.without)

    @cached_property
    def unknowns(self) -> Array:
        return np.hstack([self.fit.jacobian[:, self.kept], self.fit.columns, self.doubts])

    @cached_property
    def density(self) -> Array:
        """Prior density of each free parameter along its range, at the estimate, (n_free,)."""
        fit, space = self.fit, self.fit.records.space
        density = np.ones(fit.n_free)
        places, _, deviations = fit.records.rows
        density[places] = fit.records.span[places] / deviations / np.sqrt(2.0 * np.pi)
        for i in np.flatnonzero(self.is_log_uniform):
            low, high = space.low[space.free][i], space.high[space.free][i]
            density[i] = (high - low) / (max(fit.x[i], low) * np.log(high / low))
        return density

    @cached_property
    def is_log_uniform(self) -> NDArray[np.bool_]:
        """Which free parameters are shapes of added effects whose size is unknown: log-uniform over their range."""
        fit, space = self.fit, self.fit.records.space
        low, high = space.low[space.free], space.high[space.free]
        parameters = fit.model.parameters
        shapes = [self.library.owner(name) is not None and parameters[name].null is None for name in fit.values]
        wide = np.array(shapes, dtype=np.bool_) & (low > 0.0) & (high > 5.0 * low)
        wide[fit.records.rows[0]] = False
        return np.asarray(wide)

    @cached_property
    def sizes(self) -> Array:
        """Declared size of each strength of an effect as a share of its box, NaN of other parameters, (n_free,)."""
        model, widths = self.fit.model, dict(zip(self.fit.values, self.fit.records.span, strict=True))
        is_strength = {n: self.library.owner(n) is not None and model.parameters[n].null is not None for n in widths}
        return np.array([self.library.strength_of(n, model.parameters[n]) / width if is_strength[n] else np.nan
                         for n, width in widths.items()])  # fmt: skip

    @cached_property
    def precision(self) -> Array:
        """Prior precision of all unknowns."""
        n_others = len(self.fit.others) + self.doubts.shape[1]
        return np.concatenate([2.0 * np.pi * self.density[self.kept] ** 2, np.ones(n_others)])

    @cached_property
    def gradient(self) -> Array:
        """Of half the sum of squares by the unknowns, less what their priors pull back, (n_unknowns,)."""
        gradient = self.scale.weight * (self.unknowns.T @ self.fit.residual)
        places, means, deviations = self.fit.records.rows
        if len(places):
            pull = np.zeros(self.fit.n_free)
            pull[places] = (self.fit.x[places] - means) * self.fit.records.span[places] / deviations**2
            gradient[: int(self.kept.sum())] -= pull[self.kept]
        first = int(self.kept.sum())
        gradient[first : first + len(self.fit.others)] -= [f.value for f in self.fit.others]
        return np.asarray(gradient)

    @cached_property
    def information(self) -> Array:
        """What the records know of all unknowns, the priors not counted, (n, n)."""
        return np.asarray(self.scale.weight * self.unknowns.T @ self.unknowns)

    @cached_property
    def factor(self) -> tuple[Array, bool]:
        return self.factor_with(self.precision)

    def factor_with(self, precision: Array) -> tuple[Array, bool]:
        """Return the Cholesky factor of the information and some precision of the unknowns."""
        rounding = ROUNDING * np.diag(self.information)
        return cho_factor(self.information + np.diag(precision + rounding), lower=True)

    @cached_property
    def is_pushed(self) -> NDArray[np.bool_]:
        """Which unknowns rest at an end of their range and would leave it, were it wider, (n_unknowns,)."""
        at_end = held_by_bound(self.fit.records.space, self.fit.x)[self.kept]
        outwards = self.gradient[: at_end.size] * (self.fit.z[self.kept] - 0.5) > 0.0
        return np.append(at_end & outwards, np.zeros(len(self.precision) - at_end.size, dtype=np.bool_))

    @cached_property
    def factor_of_steps(self) -> tuple[Array, bool]:
        """The factor for steps, in which an unknown that is pushed against its end does not move."""
        if not self.is_pushed.any():
            return self.factor
        held = np.where(self.is_pushed, IMMOVABLE * (np.diag(self.information) + self.precision), 0.0)
        return self.factor_with(self.precision + held)

    @cached_property
    def covariance(self) -> Array:
        """Posterior covariance of all unknowns, (n, n)."""
        return self.scale.variance(self.fit.chi2) * cho_solve(self.factor, np.eye(len(self.precision)))

    def answers_to(self, columns: Array) -> tuple[Array, Array]:
        """Return the weighted inner products of the unknowns with columns, and how the unknowns answer to each.

        columns: (n, n_samples). Both results: (n_unknowns, n).
        """
        mixed = self.scale.weight * (columns @ self.unknowns).T
        answer = cho_solve(self.factor_of_steps, mixed)
        return mixed, answer

    def products(self, columns: Array) -> tuple[Array, Array, Array]:
        """Return Gram matrix and slopes of columns beyond the unknowns, and how the unknowns answer to each column."""
        mixed, answer = self.answers_to(columns)
        gram = self.scale.weight * columns @ columns.T - mixed.T @ answer
        slope = self.scale.weight * columns @ self.fit.residual - answer.T @ self.gradient
        return gram, slope, answer

    def squares(self, columns: Array) -> tuple[Array, Array, Array]:
        """Return what `products` does, of the Gram matrix its diagonal."""
        mixed, answer = self.answers_to(columns)
        square = self.scale.weight * np.einsum("ij,ij->i", columns, columns) - np.einsum("ij,ij->j", mixed, answer)
        slope = self.scale.weight * columns @ self.fit.residual - answer.T @ self.gradient
        return np.maximum(square, 0.0), slope, answer

    @cached_property
    def base(self) -> float:
        return self.scale.rest + self.scale.weight * float(self.fit.residual @ self.fit.residual)

    def student(self, fall: Array) -> Array:
        """Return the rise of the log-likelihood by a fall of the weighted sum of squares."""
        share = np.minimum(fall / self.base, 1.0 - 1e-9)
        return np.asarray(-0.5 * (self.scale.rest + self.scale.n) * np.log1p(-share))


@dataclass(frozen=True, eq=False)
class Forecast:
    """Hold what a proposal does to the evidence, to first order.

    log_factor: log Bayes factor of each variant and scale, their prior included, (n_variants, n_scales). strength:
    expected, of each. answer: of the unknowns per full strength, (n_unknowns, n_variants). deviation: of the strength.
    Of a joint proposal: strength is the prior scale, answer and deviation are those of all unknowns at the best scale.
    """

    proposal: Proposal
    log_factor: Array
    strength: Array
    answer: Array
    deviation: Array

    @cached_property
    def total(self) -> float:
        """Log Bayes factor of the hypothesis, without its prior odds."""
        return float(logsumexp(self.log_factor))

    @property
    def without_columns(self) -> "Forecast":
        """Itself without the columns of its proposal: of long records they take most of the memory of a search."""
        return replace(self, proposal=replace(self.proposal, columns=np.empty((0, 0))))

    @property
    def posterior(self) -> float:
        """Log odds of the model with it against the model without."""
        return self.total + self.proposal.hypothesis.log_prior

    def best(self, n: int) -> list[tuple[int, float]]:
        """Return the best variants with their strengths, the best first."""
        logs = logsumexp(self.log_factor, axis=1)
        order = np.argsort(-logs, kind="stable")[:n]
        return [(int(i), float(self.strength[i, np.argmax(self.log_factor[i])])) for i in order if np.isfinite(logs[i])]


def forecast(about: Expansion, proposal: Proposal) -> Forecast:
    """Return the log Bayes factor of a fit with a proposal against the fit alone, to first order."""
    if proposal.joint:
        return joint_forecast(about, proposal)
    square, slope, answer = about.squares(proposal.columns)
    # What the unknowns do whole leaves rounding.
    seen = square > 1e-9 * about.scale.weight * np.einsum("ij,ij->i", proposal.columns, proposal.columns)
    square, slope = np.where(seen, square, 0.0)[:, np.newaxis], np.where(seen, slope, 0.0)[:, np.newaxis]
    variance = 1.0 / (square + proposal.scales**-2.0)
    strength = variance * slope
    rise = about.student(strength * slope) - 0.5 * np.log1p(square * proposal.scales**2)
    deviation = np.sqrt(variance)
    if proposal.one_sided:
        rise = rise + np.log(2.0) + log_ndtr(strength / deviation)
    log_factor = rise + proposal.variants[:, np.newaxis] - np.log(len(proposal.scales))
    return Forecast(proposal, np.where(np.isfinite(log_factor), log_factor, -np.inf), strength, answer, deviation)


def joint_forecast(about: Expansion, proposal: Proposal) -> Forecast:
    """Return what `forecast` does where all columns act together, each with the same prior deviation."""
    gram, slope, answer = about.products(proposal.columns)
    values, vectors = np.linalg.eigh(0.5 * (gram + gram.T))
    values, along = np.maximum(values, 0.0), vectors.T @ slope
    spread = 1.0 / (values[:, np.newaxis] + proposal.scales**-2.0)
    fall = np.sum(spread * along[:, np.newaxis] ** 2, axis=0)
    rise = about.student(fall) - 0.5 * np.sum(np.log1p(values[:, np.newaxis] * proposal.scales**2), axis=0)
    log_factor = rise + proposal.variants[0] - np.log(len(proposal.scales))
    best = int(np.argmax(log_factor))
    strengths = vectors @ (spread[:, best] * along)
    total = answer @ strengths
    moved = answer @ (vectors * np.sqrt(spread[:, best]))
    return Forecast(proposal, log_factor[np.newaxis], np.broadcast_to(proposal.scales, (1, len(proposal.scales))),
                    total[:, np.newaxis], np.sqrt(np.sum(moved**2, axis=1))[:, np.newaxis])  # fmt: skip


def log_normal(values: Array, covariance: Array) -> float:
    """Return the log density of a normal distribution about 0."""
    _, determinant = np.linalg.slogdet(covariance)
    square = float(values @ np.linalg.solve(covariance, values))
    return float(-0.5 * (square + determinant + len(values) * LOG_2PI))


def log_evidence(about: Expansion) -> float:
    """Return the log evidence of a fit, without the prior odds of its hypotheses."""
    fit, scale = about.fit, about.scale
    density, factor = about.density, about.factor[0]
    determinant = 2.0 * float(np.sum(np.log(np.diag(factor))))
    # A strength counts with its own prior, below; the density along its box cancels there.
    evidence = scale.log_likelihood(fit.chi2) + 0.5 * fit.n_free * LOG_2PI - 0.5 * determinant
    evidence += float(np.sum(np.log(density)))
    _, means, deviations = fit.records.rows
    evidence -= 0.5 * float(np.sum(((fit.x[fit.records.rows[0]] - means) / deviations) ** 2))
    # Samples that are left out count as all others do: only independent ones.
    share = scale.n / len(fit.residual)
    evidence -= 0.5 * float(sum(f.value**2 + share * f.unknown.lost(f.value) for f in fit.others))
    evidence -= 0.5 * fit.records.data.log_cover
    return evidence + log_tails(fit) + log_strengths(about)


def log_strengths(about: Expansion) -> float:
    """Return the log prior density of the strengths of all effects, averaged over their posterior and over the scales.

    A strength is half-normal, or normal where it may have either sign, with one of the scales. What the prior of one
    effect tells of its strengths moves what is known of the others' (assumed density filtering): effects that the
    records show only together are not each free to be what suits the other.
    """
    fit, space = about.fit, about.fit.records.space
    low, high, names = space.low[space.free], space.high[space.free], list(fit.values)
    declared = fit.model.parameters
    nulls = {i: null for i, name in enumerate(names) if (null := declared[name].null) is not None}
    owned = [[i for i in nulls if key.owns(names[i])] for key in fit.active]
    places = [i for own in owned for i in own]
    if not places:
        return 0.0
    size = about.sizes[places]
    mean = np.array([(fit.values[names[i]] - nulls[i]) / about.library.strength_of(names[i], declared[names[i]])
                     for i in places])  # fmt: skip
    covariance = about.covariance[np.ix_(places, places)] / np.outer(size, size)
    signs = sum(not low[i] < nulls[i] < high[i] for i in places)
    total = signs * LOG_2 - float(np.sum(np.log(size)))
    for own in filter(None, owned):
        at = [places.index(i) for i in own]
        wider = [covariance[np.ix_(at, at)] + s * s * np.eye(len(at)) for s in SCALES_OF_STRENGTH]
        densities = np.array([log_normal(mean[at], one) for one in wider])
        total += float(logsumexp(densities)) - np.log(len(densities))
        gains = [covariance[:, at] @ np.linalg.inv(one) for one in wider]
        mean, covariance = pooled([(mean - gain @ mean[at], covariance - gain @ covariance[at]) for gain in gains],
                                  np.exp(densities - logsumexp(densities)))  # fmt: skip
    return float(total)


def pooled(normals: Sequence[tuple[Array, Array]], weights: Array) -> tuple[Array, Array]:
    """Return mean and covariance of a mixture of normal distributions."""
    mean = np.sum([w * m for w, (m, _) in zip(weights, normals, strict=True)], axis=0)
    spread = [w * (c + np.outer(m - mean, m - mean)) for w, (m, c) in zip(weights, normals, strict=True)]
    return mean, np.sum(spread, axis=0)


def log_tails(fit: Fit) -> float:
    """Return by how much the log prior of constants rises as a tolerance may be wrong: a normal one has no tail.

    A constant is off by v tolerances with the density 0.95 N(v; 0, 1) + 0.05 N(v; 0, t^2).
    """
    v = np.array([f.value for f in fit.others if f.unknown.name.startswith(NAMED)])
    wrong = 0.5 * v**2 * (1.0 - WRONG_TOLERANCE**-2.0) + np.log(OUT_OF_TOLERANCE / WRONG_TOLERANCE)
    return float(np.sum(np.logaddexp(np.log1p(-OUT_OF_TOLERANCE), wrong)))


def doubts_of(fit: Fit, library: Library) -> Array:
    """Return what one prior deviation of constants and starts that a fit holds does to it, (n_samples, n)."""
    freed = any(f.unknown.name.startswith(NAMED) for f in fit.others)
    held = [] if freed else [p.column for p in fit.products(library.tolerances)]
    columns = [*held, *fit.start_slopes.T]
    return np.array(columns).reshape(len(columns), len(fit.residual)).T


def expansion_of(fit: Fit, scale: Scale, library: Library, with_doubts: bool = True) -> Expansion:
    none = np.empty((len(fit.residual), 0))
    return Expansion(fit, scale, library, doubts_of(fit, library) if with_doubts else none)
