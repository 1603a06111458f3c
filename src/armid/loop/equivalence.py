"""Effects that these records cannot tell apart."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from armid.loop.candidates import Library, base, rays
from armid.loop.fit import Fit, span
from armid.loop.score_test import at_null, responses
from armid.loop.select import criterion

Array = NDArray[np.float64]
# Rivals whose refits differ by less than this in the criterion and whose traces correlate above that are one group.
WITHIN, ALIKE, MOST = 6.0, 0.95, 4


@dataclass(frozen=True)
class Likeness:
    """Hold an effect that would take another's place: by how much the criterion is worse, and how alike the traces."""

    name: str
    gap: float
    correlation: float


@dataclass(frozen=True)
class Group:
    """Hold the effect of a step with its rivals within the criterion.

    alike: those that leave the same trace. unlike: those that do not, but fit nearly as well.
    """

    name: str
    alike: tuple[Likeness, ...]
    unlike: tuple[Likeness, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The effect and what it cannot be told from."""
        return (self.name, *(r.name for r in self.alike))

    @property
    def too_big(self) -> bool:
        """Whether so many effects would do that naming them says nothing."""
        return len(self.alike) + len(self.unlike) >= MOST


def group_of(fit: Fit, key: str, others: Sequence[Fit], library: Library) -> Group:
    """Return the rivals of one effect of a model: models that differ in that effect alone, within the criterion."""
    kept = {base(n) for n in fit.active if n != key}
    mine, own = trace_of(fit, key), sensitivity_of(fit, key)
    best: dict[str, Likeness] = {}
    for other in others:
        new = [n for n in other.active if base(n) not in kept]
        if len(new) != 1 or len(other.active) != len(fit.active) or library.public(new[0]) == library.public(key):
            continue
        gap = criterion(other, fit.independent) - criterion(fit, fit.independent)
        name = library.public(new[0])
        if gap < WITHIN and (name not in best or gap < best[name].gap):
            likeness = max(abs(mine @ trace_of(other, new[0])), abs(own @ sensitivity_of(other, new[0])))
            best[name] = Likeness(name, float(gap), float(likeness))
    rivals = sorted(best.values(), key=lambda r: r.gap)
    alike = tuple(r for r in rivals if r.correlation > ALIKE)
    return Group(library.public(key), alike, tuple(r for r in rivals if r not in alike))


@dataclass(frozen=True, eq=False)
class RivalModel:
    """Hold another model of as many effects, two or more of them others, that fits nearly as well."""

    names: tuple[str, ...]
    gap: float
    fit: Fit


def rival_models(fit: Fit, others: Sequence[Fit], library: Library) -> tuple[RivalModel, ...]:
    """Return the models within the criterion that differ in more effects than one, the nearest first."""
    mine = {library.public(n) for n in fit.active}
    found: dict[frozenset[str], RivalModel] = {}
    for other in others:
        names = tuple(library.public(n) for n in other.active)
        gap = criterion(other, fit.independent) - criterion(fit, fit.independent)
        if len(names) == len(mine) and len(set(names) - mine) > 1 and gap < WITHIN:
            found.setdefault(frozenset(names), RivalModel(names, float(gap), other))
    return tuple(sorted(found.values(), key=lambda r: r.gap)[:MOST])


def trace_of(fit: Fit, key: str) -> Array:
    """Return the change of the whitened signal by an effect, projected off the other free parameters, of length 1."""
    return beyond_others(fit, key, change_by(fit, key))


def sensitivity_of(fit: Fit, key: str) -> Array:
    """Return the derivative by an effect's strength at the fit, projected off the other free parameters, of length 1.

    Of several strengths the direction in which they are away from their nulls. Two models that say the same in other
    words (a torque and an inertia in one proportion) have one sensitivity, while the changes from null to value differ
    by what other parameters have to make up for.
    """
    space, declared = fit.records.space, fit.records.replays[0].model.parameters
    away = np.zeros(fit.n_free)
    for i, name in enumerate(fit.values):
        null, place = declared[name].null, space.index(name)
        if name.partition(".")[0] == base(key) and null is not None:
            away[i] = fit.z[i] - (null - space.low[place]) / (space.high[place] - space.low[place])
    return beyond_others(fit, key, fit.jacobian @ away)


def beyond_others(fit: Fit, key: str, moved: Array) -> Array:
    """Return what parameters other than an effect's own cannot do of a change of the signal, of length 1."""
    basis = span(fit.jacobian[:, ~owned_by(fit, key)])
    free = moved - basis @ (basis.T @ moved)
    length = float(np.linalg.norm(free))
    return np.asarray(free / length) if length > 0.0 else np.asarray(free)


def change_by(fit: Fit, key: str) -> Array:
    """Return the change of the whitened signal by an effect of a fit, (n_samples,)."""
    without = at_null(fit.records, fit.candidate, key)
    signals = fit.records.whole_signals(np.array([fit.candidate, without]))
    return np.asarray(signals[0] - signals[1])


def owned_by(fit: Fit, key: str) -> NDArray[np.bool_]:
    """Return which free parameters of a fit belong to an effect, (n_free,)."""
    return np.array([name.partition(".")[0] == base(key) for name in fit.values], dtype=np.bool_)


# Candidates that could take the place of an effect in a model: they move the records as it does.
#
# A score at the model without the effect is a linear guess from parameters that the lack of it has bent; dry friction
# can rank fourteenth there and still fit as well as the first (seen on one stroke). About the model with the effect
# the guess is good: put in its place, a rival does nearly what it does, the parameters making up for what they can.

# A rival whose trace correlates below this is none (a group asks for 0.95); so many are worth a fit.
LIKELY, MOST_RIVALS_ALIKE = 0.9, 8


@dataclass(frozen=True)
class Rival:
    """Hold what could stand in the place of an effect, how alike the two are, and values from which to fit it."""

    place: str
    name: str
    correlation: float
    values: dict[str, float]


def alike(fit: Fit, library: Library) -> list[Rival]:
    """Return the candidates that move the records like an effect of a fit, the likest first."""
    changes = {name: change_by(fit, name) for name in fit.active}
    spans = {name: span(fit.jacobian[:, ~owned_by(fit, name)]) for name in fit.active}
    candidates = [c for c in library.candidates if library.can_join(c, fit.active)]
    each = library.each(lambda c: list(rivals(fit, library, c, changes, spans)), candidates)
    found = sorted(chain.from_iterable(each), key=lambda r: -r.correlation)
    return [r for place in fit.active for r in [r for r in found if r.place == place][:MOST_RIVALS_ALIKE]]


def rivals(
    fit: Fit, library: Library, candidate: str, changes: Mapping[str, Array], spans: Mapping[str, Array]
) -> Iterator[Rival]:
    """Yield the effects of a fit that a candidate moves the records like.

    changes: by each effect, (n_samples,); spans: bases of what the other parameters can absorb, (n_samples, rank).
    """
    records = library.problem((*fit.active, candidate), fit.values)
    found, _ = rays(records, candidate)
    for name in fit.active:
        best = likest(changes[name], responses(fit, records, found, without=name), spans[name])
        if best is not None:
            ray, correlation, amplitude = found[best[0]], best[1], float(np.clip(best[2], 0.01, 1.0))
            yield Rival(name, candidate, correlation, fit.values | ray.at(amplitude))


def likest(change: Array, moved: Array, basis: Array) -> tuple[int, float, float] | None:
    """Return the ray that moves the signal most like a change, their correlation, and the amplitude that does.

    None where none is near.

    change: (n_samples,), moved: per full strength, (n_rays, n_samples), both projected off a basis.
    """
    wanted = change - basis @ (basis.T @ change)
    within, slope = moved @ basis, moved @ wanted
    square = np.einsum("ij,ij->i", moved, moved) - np.einsum("ij,ij->i", within, within)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = slope / np.sqrt(square * (wanted @ wanted))
    correlation[~np.isfinite(correlation)] = 0.0
    best = int(np.argmax(correlation))
    if correlation[best] <= LIKELY:
        return None
    return best, float(correlation[best]), float(slope[best] / square[best])
