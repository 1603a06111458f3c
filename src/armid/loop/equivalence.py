"""Effects that these records cannot tell apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armid.inference.library import CONSTANT, EffectKey, declared_keys, shape_counts
from armid.inference.model import Fit
from armid.loop.fit import behind

# Rivals whose refits differ by less than this in the criterion are one group; so many of them are too many to name.
WITHIN, MOST = 6.0, 4


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
