"""Effects that these records cannot tell apart."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from armid.loop.candidates import CONSTANT, EffectKey, Library, activation_grid, declared_keys, shape_counts
from armid.loop.fit import Fit, behind, beyond, decomposed
from armid.loop.score_test import at_null, responses, square_beyond
from armid.model import Array

# Rivals whose refits differ by less than this in the criterion are one group; so many of them are too many to name.
WITHIN, MOST = 6.0, 4
# A candidate whose response correlates below this is no substitute; so many are worth a fit.
LIKELY, MOST_SUBSTITUTES = 0.9, 8


@dataclass(frozen=True)
class EffectGroup:
    """Hold the name of the effect of a step with those of its rivals within the criterion, the best first."""

    name: str
    rivals: tuple[str, ...]

    @property
    def too_big(self) -> bool:
        """Whether so many effects would do that naming them says nothing."""
        return sum(not name.startswith(CONSTANT) for name in self.rivals) >= MOST


def group_of(fit: Fit, key: EffectKey, others: Sequence[Fit]) -> EffectGroup:
    """Return the rivals of one effect of a model: models that differ in that effect alone, within the criterion.

    A shape that a rival has more counts as the places of it that were searched, 2 ln(places), not as a free parameter:
    that a simpler effect fits as well does not deny the other one (a lag of first and one of second order).
    """
    kept = declared_keys(k for k in fit.active if k != key)
    gaps: dict[str, float] = {}
    for other in others:
        new = [k for k in other.active if k.declared not in kept]
        if other is fit or len(new) != 1 or len(other.active) != len(fit.active) or new[0].public == key.public:
            continue
        spared = max(spared_by_shapes(other, new[0]) - spared_by_shapes(fit, key), 0.0)
        name, gap = new[0].public, behind(other, fit) - spared
        if gap < min(WITHIN, gaps.get(name, np.inf)):
            gaps[name] = gap
    return EffectGroup(key.public, tuple(sorted(gaps, key=lambda name: gaps[name])))


def spared_by_shapes(fit: Fit, key: EffectKey) -> float:
    """Return by how much less than free parameters the shapes of an effect count as places that were searched."""
    n_shapes = sum(key.owns(n) and fit.model.parameters[n].null is None for n in fit.values)
    return float(n_shapes * np.log(fit.independent) - 2.0 * np.log(np.prod(shape_counts(n_shapes))))


def rival_models(fit: Fit, others: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return the other models of as many effects, two or more of them others, that fit nearly as well."""
    mine, found = set(fit.names), dict[frozenset[str], Fit]()
    for other in others:
        if len(other.names) == len(mine) and len(set(other.names) - mine) > 1 and behind(other, fit) < WITHIN:
            found.setdefault(frozenset(other.names), other)
    return tuple(sorted(found.values(), key=lambda other: behind(other, fit))[:MOST])


def change_by(fit: Fit, key: EffectKey) -> Array:
    signals = fit.records.whole_signals(np.array([fit.candidate, at_null(fit.records, fit.candidate, key)]))
    return np.asarray(signals[0] - signals[1])


@dataclass(frozen=True)
class Substitute:
    """Hold what could stand in the place of an effect, how alike the two are, and values from which to fit it."""

    place: EffectKey
    key: EffectKey
    correlation: float
    values: dict[str, float]


def substitutes(fit: Fit, library: Library) -> list[Substitute]:
    """Return the candidates that move the records like an effect of a fit, the likest first.

    A score at the model without the effect is a linear guess from parameters that the lack of it has biased; dry
    friction can rank fourteenth there and still fit as well as the first (seen on one stroke). About the model with the
    effect the guess is good: put in its place, a rival does nearly what it does, the parameters making up for what they
    can. Another form of an effect stands in its place alone.
    """
    changes = {key: change_by(fit, key) for key in fit.active}
    # of what parameters other than an effect's own can do, (n_samples, rank)
    bases = {key: decomposed(fit.jacobian[:, ~fit.owned_by(key)])[0] for key in fit.active}
    mine, others = declared_keys(fit.active), {key.public for key in library.joinable(fit.active)}

    def places_of(candidate: EffectKey) -> list[Substitute]:
        """Return the effects of the fit that a candidate moves the records like."""
        records = library.problem((*fit.active, candidate), fit.values)
        grid, _ = activation_grid(records, candidate)
        near = [(key, likest(changes[key], responses(fit, records, grid, without=key), bases[key]))
                for key in fit.active if candidate.public in others or candidate.public == key.public]  # fmt: skip
        return [Substitute(key, candidate, best[1], fit.values | grid[best[0]].at(float(np.clip(best[2], 0.01, 1.0))))
                for key, best in near if best is not None]  # fmt: skip

    each = library.each(places_of, [key for key in library.candidates if key not in mine])
    found = sorted(chain.from_iterable(each), key=lambda r: -r.correlation)
    return [r for place in fit.active for r in [r for r in found if r.place == place][:MOST_SUBSTITUTES]]


def likest(change: Array, moved: Array, basis: Array) -> tuple[int, float, float] | None:
    """Return the activation that moves the signal most like a change, their correlation, and the amplitude that does.

    None where none is near, or there is none.
    change: (n_samples,), moved: per full strength, (n_activations, n_samples), both projected off a basis.
    """
    if not len(moved):
        return None
    wanted = beyond(basis, change)
    slope, square = moved @ wanted, square_beyond(basis, moved)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = slope / np.sqrt(square * (wanted @ wanted))
    correlation[~np.isfinite(correlation)] = 0.0
    best = int(np.argmax(correlation))
    if correlation[best] <= LIKELY:
        return None
    return best, float(correlation[best]), float(slope[best] / square[best])
