"""The posterior over models: probabilities of hypotheses and sets, and intervals that count what may be missing.

Every fitted model has its posterior weight; hypotheses that were not fitted with an expanded model count to first
order. A parameter's interval holds 95 % of the mixture of all (Hoeting and others 1999, doi:10.1214/ss/1009212519).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import logsumexp, ndtr

from armid.estimation.information import NORMAL_95
from armid.estimation.least_squares import held_by_bound
from armid.inference.checks import train_residuals
from armid.inference.decisions import MENTIONED, calibration
from armid.inference.evidence import USUAL_STRENGTH, Expansion, expansion_of
from armid.inference.kinds.hypothesis import Hypotheses, log_prior
from armid.inference.model import Fit
from armid.inference.moves import Exploration
from armid.inference.unknowns import residuals_at
from armid.model import Array

# Models of a smaller weight than this, relative to the best, do not count.
NEGLIGIBLE = float(np.log(1e-6))
# Something that nobody knows, wherever it acts.
UNSEEN = frozenset({("unknown", "an unknown place")})
# A smaller p-value leaves no chance that arithmetic could hold.
SMALLEST_P = 1e-12
# A deviation of so many ranges is that of even odds.
AS_EVEN = 100.0
# What further unknowns of a model are, in words.
CONSTANTS_TEXT = "constants within tolerances"
# How far unknowns are moved along an axis of their posterior, in deviations; how often, as a wider axis is looked at
# again. Share of the rise of the sum of squares that slopes foretell from which they are believed, and the least that
# matters. Times it from which the way is taken to bend; how often the others then follow it, and the fall of the rise,
# as a share of what is left, for which they follow once more.
DEVIATIONS, MOST_LOOKS, BELIEVED, LEAST_RISE = 2.0, 4, 0.5, 0.05
BENT_RISE, MOST_ANSWERS, FOLLOWED = 2.0, 10, 0.2


@dataclass(frozen=True, eq=False)
class Atom:
    """Hold one model of the mixture: its hypotheses, their log prior odds, means and deviations of the parameters.

    NaN for parameters that the model does not hold.
    """

    log_evidence: float
    log_prior: float
    names: frozenset[tuple[str, str]]
    mean: Array
    deviation: Array


@dataclass(frozen=True, eq=False)
class Posterior:
    """Hold the mixture.

    parameters: names of those of the declared model and of effects, in the order of the atoms' values. declared: what
    the declared model's own fit says of them, NaN of effects, None where nothing is doubted by it. known: deviation of
    each before the records, as a prior or its box says. temperature: log evidence is divided by it.
    """

    atoms: tuple[Atom, ...]
    parameters: tuple[str, ...]
    temperature: float = 1.0
    declared: Array | None = None
    known: Array | float = np.inf

    @cached_property
    def weights(self) -> Array:
        logs = np.array([a.log_evidence / self.temperature + a.log_prior for a in self.atoms])
        return np.asarray(np.exp(logs - logsumexp(logs)))

    @cached_property
    def means(self) -> Array:
        """Mean of each parameter in each model, (n_atoms, n_parameters)."""
        return np.array([a.mean for a in self.atoms])

    @cached_property
    def deviations(self) -> Array:
        """Deviation of each parameter in each model, (n_atoms, n_parameters).

        Where something unknown acts, every model is wrong, and names stand in for what nobody knows: that they moved a
        parameter tells how far a form of the model moves it, and not where to. Everything between the estimate of the
        declared model and as far on the other side is then equally likely: a variance of a third of the move squared,
        up to what was known before.
        """
        own = np.array([a.deviation for a in self.atoms])
        if self.declared is None:
            return own
        wrong = np.array([any(kind == "unknown" for kind, _ in a.names) for a in self.atoms])
        moved = np.where(wrong[:, np.newaxis], np.nan_to_num(self.means - self.declared), 0.0)
        return np.asarray(np.maximum(own, np.minimum(np.sqrt(own**2 + moved**2 / 3.0), self.known)))

    @cached_property
    def sets(self) -> dict[frozenset[tuple[str, str]], float]:
        """Probability of each set of hypotheses, the most probable first."""
        sets: dict[frozenset[tuple[str, str]], float] = {}
        for atom, weight in zip(self.atoms, self.weights, strict=True):
            sets[atom.names] = sets.get(atom.names, 0.0) + float(weight)
        return dict(sorted(sets.items(), key=lambda pair: -pair[1]))

    def probability(self, kind: str, name: str | None = None, beside_unknown: bool = False) -> float:
        """Return the probability of a hypothesis, or of any of a kind.

        A name counts in sets without `unknown` alone, unless beside_unknown: what nobody knows may do what it does.
        """
        total = 0.0
        for names, weight in self.sets.items():
            if name is not None and not beside_unknown and any(k == "unknown" for k, _ in names):
                continue
            total += weight * any(k == kind and name in (None, n) for k, n in names)
        return min(total, 1.0)

    def with_unseen(self, wrong: float) -> "Posterior":
        """Return the mixture where something unknown acts, with a probability, that the train records do not show."""
        shares = ((1.0 - wrong, frozenset[tuple[str, str]]()), (wrong, UNSEEN))
        return replace(self, atoms=tuple(replace(a, log_prior=a.log_prior + np.log(p), names=a.names | more)
                                         for a in self.atoms for p, more in shares))  # fmt: skip

    def without(self, denied: frozenset[tuple[str, str]], instead: "Posterior") -> "Posterior":
        """Return the mixture where models that hold what is denied leave their weight to another mixture.

        The others are as probable as before: a denied name makes its rivals no more credible.
        """
        names = tuple(dict.fromkeys((*instead.parameters, *self.parameters)))
        own, other = self.over(names), instead.over(names)
        pairs = list(zip(own.atoms, own.weights, strict=True))
        sound = [(atom, weight) for atom, weight in pairs if not atom.names & denied]
        lost = 1.0 - sum(weight for _, weight in sound)
        sound += [(atom, lost * weight) for atom, weight in zip(other.atoms, other.weights, strict=True)]
        atoms = tuple(replace(a, log_evidence=0.0, log_prior=float(np.log(w))) for a, w in sound if w > 0.0)
        found = replace(own, atoms=atoms, known=np.fmin(own.known, other.known))
        held = np.asarray(np.isfinite(found.means).any(axis=0))
        return found.over(tuple(name for name, is_held in zip(names, held, strict=True) if is_held))

    def over(self, names: tuple[str, ...]) -> "Posterior":
        """Return the same mixture with other parameters, NaN for those that it does not know."""
        places = [self.parameters.index(n) if n in self.parameters else -1 for n in names]

        def taken(values: Array) -> Array:
            return np.append(values, np.nan)[places]

        atoms = tuple(replace(a, mean=taken(a.mean), deviation=taken(a.deviation)) for a in self.atoms)
        declared = None if self.declared is None else taken(self.declared)
        known = taken(np.broadcast_to(self.known, len(self.parameters)))
        return replace(self, atoms=atoms, parameters=names, declared=declared, known=known)

    @property
    def nothing(self) -> float:
        return self.sets.get(frozenset(), 0.0)

    def of_kind(self, kind: str, beside_unknown: bool = False) -> dict[str, float]:
        """Return the probabilities of the hypotheses of a kind, the most probable first."""
        names = sorted({n for s in self.sets for k, n in s if k == kind})
        pairs = ((n, self.probability(kind, n, beside_unknown)) for n in names)
        return dict(sorted(pairs, key=lambda pair: -pair[1]))

    def quantile(self, parameter: str, share: float) -> float:
        """Return the value below which a share of the mixture lies; of an effect, of the models that hold it."""
        _, weights, means, deviations = self.holding(parameter)
        deviations = np.maximum(deviations, 1e-300)
        low, high = float((means - 40.0 * deviations).min()), float((means + 40.0 * deviations).max())
        for _ in range(200):
            middle = 0.5 * (low + high)
            below = float(weights @ ndtr((middle - means) / deviations))
            low, high = (middle, high) if below < share else (low, middle)
        return 0.5 * (low + high)

    @property
    def unknown_is_likely(self) -> bool:
        """Whether it is more likely than not that something acts which no name explains."""
        return self.probability("unknown") >= MENTIONED

    @property
    def best_is_unknown(self) -> bool:
        """Whether something unknown acts in the most probable model."""
        return any(kind == "unknown" for kind, _ in self.atoms[int(np.argmax(self.weights))].names)

    def holding(self, parameter: str) -> tuple[tuple[Atom, ...], Array, Array, Array]:
        """Return the models that hold a parameter, their weights among themselves, means and deviations."""
        i = self.parameters.index(parameter)
        held = np.flatnonzero(np.isfinite(self.means[:, i]))
        weights = self.weights[held] / max(float(self.weights[held].sum()), 1e-300)
        return tuple(self.atoms[j] for j in held), weights, self.means[held, i], self.deviations[held, i]

    def interval(self, parameter: str) -> tuple[float, float]:
        """Return the interval that holds 95 % of the mixture."""
        return self.quantile(parameter, 0.025), self.quantile(parameter, 0.975)

    def causes(self, parameter: str, noise: float, beside: str = CONSTANTS_TEXT) -> list[tuple[str, float]]:
        """Return what makes the interval of a parameter wide, with shares of its width squared, the largest first.

        noise: deviation by noise alone, SI. beside: name of the other unknowns of the most probable model.
        """
        atoms, weights, means, deviations = self.holding(parameter)
        first = int(np.argmax(weights))
        best = atoms[first]
        low, high = self.interval(parameter)
        # rare models far away have much of the variance, and little of the interval
        total, own = ((high - low) / (2.0 * NORMAL_95)) ** 2, deviations[first] ** 2
        if max(total, own) <= 0.0:
            return []
        away: dict[str, float] = {}
        for j, (atom, weight) in enumerate(zip(atoms, weights, strict=True)):
            names = sorted(f"something unknown at {name}" if kind == "unknown" else name
                           for kind, name in atom.names ^ best.names)  # fmt: skip
            more = weight * ((means[j] - means[first]) ** 2 + deviations[j] ** 2 - own)
            for name in names:
                away[name] = away.get(name, 0.0) + float(more) / len(names)
        # Only what widens an interval is a cause; other models share their part of the variance in these proportions.
        away = {name: size for name, size in away.items() if size > 0.0}
        scale = max(total - own, 0.0) / max(sum(away.values()), 1e-300)
        variances = {"noise": min(noise**2, own), beside: max(own - noise**2, 0.0)}
        variances |= {name: scale * size for name, size in away.items()}
        shares = {name: float(size) / max(total, own) for name, size in variances.items() if size > 0.0}
        return sorted(shares.items(), key=lambda pair: (-pair[1], pair[0]))


def posterior(exploration: Exploration) -> Posterior:
    """Return the mixture of all fitted models, and of the hypotheses that were forecast with the expanded ones."""
    library, scale = exploration.library, exploration.scale()
    ranked, atoms = exploration.ranked(), []
    top = ranked[0][1]
    counted = [exploration.fits[model] for model, value in ranked if value >= top + NEGLIGIBLE]
    own = tuple(dict.fromkeys(n for fit in (exploration.declared, *counted) for n in fit.values))
    for model, value in ranked:
        if value < top + NEGLIGIBLE:
            continue
        about = expansion_of(exploration.fits[model], scale, library)
        mean, covariance = of_parameters(about, own)
        names = frozenset(h.public for h in model)
        atoms.append(Atom(value - log_prior(model), log_prior(model), names, mean, np.sqrt(np.diag(covariance))))
        atoms += beside(exploration, model, value, about, own, mean, covariance, top)
    fit = exploration.declared
    known = {n: span / np.sqrt(12.0) for f in (*counted, fit) for n, span in zip(f.values, f.records.span, strict=True)}
    known |= {name: deviation for name, (_, deviation) in library.known.items()}
    declared, before = (np.array([each.get(n, np.nan) for n in own]) for each in (fit.values, known))
    mixture = Posterior(tuple(atoms), own, calibration().temperature, declared, before)
    # What tests find beyond the best model, and no fitted signal explains, is something that nobody knows.
    found = most_odds(train_residuals(exploration.fits[ranked[0][0]]).diagnosis.p) - 1.0
    odds = calibration().expected["unseen"] * found
    return mixture.with_unseen(odds / (1.0 + odds)) if found else mixture


def most_odds(p: float) -> float:
    """Return the largest Bayes factor against noise alone that a p-value allows, -1/(e p ln p).

    Sellke, Bayarri and Berger 2001, doi:10.1198/000313001300339950.
    """
    p = max(p, SMALLEST_P)
    return 1.0 if p >= np.exp(-1.0) else float(-1.0 / (np.e * p * np.log(p)))


def of_parameters(about: Expansion, own: Sequence[str]) -> tuple[Array, Array]:
    """Return parameters at a fit, SI, and their covariance; NaN for those that it does not hold.

    No parameter lies outside its box, and no strength has another sign: where the records hardly show one, it and what
    makes up for it lie inside, and not about the end at which a fit happened to stop. Mean and covariance are those of
    the truncated normal distribution, one parameter after the other.
    """
    fit, covariance, moved = about.fit, unbounded(about), np.zeros(about.fit.n_free)
    for i in range(fit.n_free):
        deviation, size = float(np.sqrt(covariance[i, i])), float(fit.z[i] + moved[i])
        if deviation <= 0.0:
            continue
        mean, left = boxed(size, deviation)
        answer = covariance[:, i] / deviation**2
        moved += answer * (mean - size)
        covariance -= np.outer(answer, answer) * (deviation**2 - left**2)
    places, held = places_of(own, fit)
    span, values, all_values = fit.records.span[places], np.full(len(own), np.nan), np.array(list(fit.values.values()))
    values[held] = all_values[places] + span * moved[places]
    squares = np.full((len(own), len(own)), np.nan)
    squares[np.ix_(held, held)] = covariance[np.ix_(places, places)] * np.outer(span, span)
    return values, squares


def places_of(own: Sequence[str], fit: Fit) -> tuple[list[int], list[int]]:
    """Return where parameters stand among those of a fit, and which of them it holds."""
    names = list(fit.values)
    held = [i for i, n in enumerate(own) if n in fit.values]
    return [names.index(own[i]) for i in held], held


def spread(about: Expansion) -> Array:
    """Return the covariance of the free parameters, no deviation larger than that of even odds over the box."""
    covariance = unbounded(about)
    shrunk = np.minimum(1.0, np.sqrt(1.0 / 12.0 / np.maximum(np.diag(covariance), 1e-300)))
    return np.asarray(covariance * np.outer(shrunk, shrunk))


def unbounded(about: Expansion) -> Array:
    """Return the posterior covariance of the free parameters, where within their box all values are alike.

    The normal prior of `precision`, which gives the evidence, would hold them closer; here it is one range wide, and of
    a strength the size to expect, however wide its box.
    """
    n, fit = int(about.kept.sum()), about.fit
    is_known = np.isin(np.arange(fit.n_free), fit.records.rows[0])[about.kept]
    flat = about.precision / np.append(np.where(is_known, 1.0, 2.0 * np.pi), np.ones(len(about.precision) - n))
    usual = USUAL_STRENGTH * about.sizes[about.kept]
    flat[:n] *= np.where(usual < 1.0, 1.0 / usual, 1.0) ** 2
    columns, cover = confirmed_slopes(fit, about.unknowns, flat, about.scale.weight), fit.records.data.cover
    known = about.scale.weight * columns.T @ columns + np.diag(flat)
    if cover is not None:
        known = known - cover.taken(columns, about.scale.weight)
    return np.asarray(about.scale.variance(fit.chi2) * np.linalg.inv(known)[:n, :n])


def confirmed_slopes(fit: Fit, columns: Array, flat: Array, weight: float) -> Array:
    """Return columns whose squares give the information on the unknowns that simulations confirm, (n_samples, n).

    Slopes are differences, and those of a motion with sharp friction hold the engine's rounding. Where parameters and
    constants make up for each other exactly (inertia, friction and resistance of a motor), that rounding alone would
    tell them apart, and an interval would not hold. So the unknowns are moved along each axis of their posterior. Steps
    that are longer than a deviation, or slopes that a fit has carried on, err where unknowns nearly make up for each
    other: along an axis that the records show the slopes are those between both ends of the move.
    columns: whitened slopes by the free parameters, the further unknowns of the fit, and what it holds, (n_samples, n).
    flat: prior precision of each, (n,). weight: of each square, see `evidence.Scale`.
    """
    n_free, n = fit.n_free, fit.n_free + len(fit.others)
    if not n_free:
        return columns
    base = fit.base if fit.base is not None and fit.others else fit.records
    base, unknowns = base.plain, [f.unknown for f in fit.others]
    here, root = np.concatenate([fit.z, [f.value for f in fit.others]]), np.sqrt(weight)
    # What a bound holds stays there: the axes are those of the others.
    held = np.append(held_by_bound(fit.records.space, fit.x), np.zeros(n - n_free, dtype=np.bool_))
    moving = np.flatnonzero(~held)
    counted = np.append(moving, np.arange(n, columns.shape[1]))

    def residuals(rows: Array) -> Array:
        return np.asarray(root * residuals_at(base, unknowns, rows[:, n_free:], rows[:, :n_free]))

    def axes_and_moves(columns: Array) -> tuple[Array, Array, Array]:
        axes = np.zeros((n, moving.size))
        axes[moving] = principal_axes(columns[:, counted], flat[counted], weight, moving.size)
        shares = room(here[:n_free], DEVIATIONS * axes[:n_free])
        return axes, shares, DEVIATIONS * shares * axes

    if not moving.size:
        return columns
    axes, shares, moves = axes_and_moves(columns)
    below, above = np.split(residuals(np.concatenate([here - moves.T, here + moves.T])) / root, 2)
    along = columns[:, :n] @ axes
    chords = (below - above).T / np.maximum(2.0 * DEVIATIONS * shares, 1e-300)
    shown = (shares == 1.0) & (weight * np.sum(along**2, axis=0) > BELIEVED) & np.isfinite(chords).all(axis=0)
    columns = columns.copy()
    columns[:, moving] = np.where(shown, chords, along) @ np.linalg.inv(axes[moving])
    for _ in range(MOST_LOOKS):
        axes, shares, moves = axes_and_moves(columns)
        along, foretold = root * columns[:, :n] @ axes, weight * np.sum((columns[:, :n] @ moves) ** 2, axis=0)
        rise = rises(residuals, here, moves, axes, along, root * fit.residual, foretold, n_free)
        matters = np.isfinite(rise) & (foretold > LEAST_RISE * shares**2)
        believed = np.where(matters, np.clip(rise / np.maximum(foretold, 1e-300), 0.0, 1.0), 1.0)
        if (believed >= BELIEVED).all():
            break
        kept = np.where(believed < BELIEVED, np.sqrt(believed), 1.0)
        columns = columns.copy()
        columns[:, moving] = columns[:, :n] @ (axes * kept) @ np.linalg.inv(axes[moving])
    return columns


def rises(
    residuals: Callable[[Array], Array], here: Array, moves: Array, axes: Array, along: Array, residual: Array,
    foretold: Array, n_free: int,
) -> Array:  # fmt: skip
    """Return by how much the sum of squares rises along each axis, the mean of both sides, (n,).

    Where the way bends, the other unknowns follow it. residuals: of rows of unknowns. moves: along each axis, as
    columns. along: the slopes along the axes. residual: at the estimate. foretold: the rise that the slopes foretell.
    """
    n, rows = moves.shape[1], np.concatenate([here + moves.T, here - moves.T])
    rise, bends = np.full(n, np.inf), np.ones(n, dtype=np.bool_)
    for _ in range(MOST_ANSWERS):
        tried, before = residuals(rows), rise
        answered = [left(along, i, np.array([tried[i], tried[n + i], residual])) for i in range(n)]
        now = np.array([0.5 * (above + below) - middle for (above, below, middle), _ in answered])
        rise = np.where(bends, np.fmin(rise, now), rise)
        bends &= np.isfinite(rise) & (rise > np.where(np.isfinite(before), LEAST_RISE, BENT_RISE) * foretold)
        fell = np.where(bends, before, 0.0) - np.where(bends, rise, 0.0)
        if not (bends & (fell > FOLLOWED * rise)).any():
            break
        steps = np.concatenate([[axes @ answer[:, side] for _, answer in answered] for side in (0, 1)])
        rows = rows + np.nan_to_num(steps)
        rows[:, :n_free] = np.clip(rows[:, :n_free], 0.0, 1.0)
    return rise


def left(along: Array, i: int, residuals: Array) -> tuple[Array, Array]:
    """Return the squares of residuals, (n_residuals, n_samples), that the slopes along all axes but one cannot take up.

    Then the steps along the axes that take up the rest, (n_axes, n_residuals). The ways on which unknowns make up for
    each other bend: what a straight one leaves the others answer, as far as their priors let them. along: per posterior
    deviation, so that what the records do not know of an axis is prior.
    """
    others = np.delete(along, i, axis=1)
    square, mixed = others.T @ others, residuals @ others
    answer = np.linalg.solve(square + np.diag(np.maximum(1.0 - np.diag(square), 1e-9)), mixed.T)
    return np.sum(residuals**2, axis=1) - np.sum(mixed.T * answer, axis=0), np.insert(answer, i, 0.0, axis=0)


def principal_axes(columns: Array, flat: Array, weight: float, n: int) -> Array:
    """Return the principal axes of the first n unknowns, one posterior deviation long each, as columns, (n, n)."""
    covariance = np.linalg.inv(weight * columns.T @ columns + np.diag(flat))[:n, :n]
    sizes = np.sqrt(np.diag(covariance))
    squares, vectors = np.linalg.eigh(covariance / np.outer(sizes, sizes))
    return np.asarray(sizes[:, np.newaxis] * vectors * np.sqrt(np.maximum(squares, 1e-12)))


def room(z: Array, moves: Array) -> Array:
    """Return which share of each move, (n_free, n), stays in the box on either side, (n,)."""
    sizes, ends = np.abs(moves), np.minimum(z, 1.0 - z)[:, np.newaxis]
    return np.asarray(np.min(np.where(sizes > ends, ends / np.maximum(sizes, 1e-300), 1.0), axis=0))


def beside(
    exploration: Exploration, model: Hypotheses, value: float, about: Expansion, own: Sequence[str], mean: Array,
    covariance: Array, top: float,
) -> list[Atom]:  # fmt: skip
    """Return the atoms of an expanded model with one hypothesis that was forecast and not fitted, to first order."""
    fit = about.fit
    places, held = places_of(own, fit)
    span, atoms = fit.records.span[places], []
    names = frozenset(h.public for h in model)
    for ahead in exploration.forecasts.get(model, ()):
        hypothesis = ahead.proposal.hypothesis
        if model | {hypothesis} in exploration.fits or model | {hypothesis} in exploration.refused:
            continue
        weight, prior = value + hypothesis.log_prior, log_prior(model | {hypothesis})
        for i, k in np.argwhere(ahead.log_factor + weight > top + NEGLIGIBLE):
            if ahead.proposal.joint:
                moved = -span * ahead.answer[places, 0]
                spread = (span * ahead.deviation[places, 0]) ** 2
            else:
                answer = ahead.answer[places, i]
                strength, deviation = ahead.strength[i, k], ahead.deviation[i, k]
                if ahead.proposal.one_sided:
                    strength, deviation = truncated(float(strength), float(deviation))
                moved = -span * answer * strength
                spread = (span * answer * deviation) ** 2
            means, squares = mean.copy(), np.diag(covariance).copy()
            means[held] += moved
            squares[held] += spread
            atoms.append(Atom(weight - prior + float(ahead.log_factor[i, k]), prior, names | {hypothesis.public},
                              means, np.sqrt(squares)))  # fmt: skip
    return atoms


def boxed(mean: float, deviation: float) -> tuple[float, float]:
    """Return mean and deviation of the part of a normal distribution between 0 and 1."""
    if mean > 0.5:
        mirrored, left = boxed(1.0 - mean, deviation)
        return 1.0 - mirrored, left
    width = min(deviation, AS_EVEN)
    if mean < -5.0 * width:
        return truncated(mean, width)
    low, high = -mean / width, (1.0 - mean) / width
    inside = float(ndtr(-low) - ndtr(-high))
    first, last = density(low) / inside, density(high) / inside
    square = 1.0 + low * first - high * last - (first - last) ** 2
    return mean + width * (first - last), width * float(np.sqrt(max(square, 1e-12)))


def truncated(mean: float, deviation: float) -> tuple[float, float]:
    """Return mean and deviation of the positive part of a normal distribution."""
    if mean < -5.0 * deviation:
        size = deviation**2 / max(-mean, 1e-300)
        return size, size
    at = mean / deviation
    ratio = density(at) / float(ndtr(at))
    return mean + deviation * ratio, deviation * float(np.sqrt(max(1.0 - ratio * (at + ratio), 1e-6)))


def density(at: float) -> float:
    """Return the density of the standard normal distribution."""
    return float(np.exp(-0.5 * at * at) / np.sqrt(2.0 * np.pi))
