"""Effects that these records cannot tell apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.fit import Fit, span
from armid.discrepancy.library import Library
from armid.discrepancy.names import base
from armid.discrepancy.select import criterion
from armid.discrepancy.trace import at_null

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
