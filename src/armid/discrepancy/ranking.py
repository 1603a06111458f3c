"""Which scores deserve a fit, which fits a further look."""

from collections.abc import Iterable, Mapping

import numpy as np

from armid.discrepancy.fit import Fit
from armid.discrepancy.names import base
from armid.discrepancy.select import criterion
from armid.discrepancy.trace import Score

# Scores are a linear guess: refit at least and at most so many, and those within a factor of the best.
FEWEST, MOST, WITHIN = 6, 12, 4.0
# So many of them are refitted even where the score says that they cannot do as well as a model that is known.
SURE = 4
# The others must come to what is known with so many times their score: without a friction every rate is bent.
REACH = 10.0
# A drop of chi2 that one candidate in thousands reaches on noise: below it nothing is refitted.
WORTH = 8.0
# An addition whose statistic stays below this is not looked at further; one in ten thousand asks for 15.
PROMISING = 12.0
# Models within this factor of the least chi2 are told apart by the criterion; what they leave has about one character.
COMPARABLE = 1.5


def ranked(fits: Iterable[Fit]) -> list[Fit]:
    """Return models by their criterion, best first, with the effective samples of the one with the least chi2."""
    known = list(fits)
    if not known:
        return []
    least = min(f.chi2 for f in known)
    n_eff = max(f.independent for f in known if f.chi2 <= COMPARABLE * least)
    return sorted(known, key=lambda f: criterion(f, n_eff))


def different(fits: Iterable[Fit]) -> list[Fit]:
    """Return models, best first, without those that another holds with a shape set free."""
    found: dict[frozenset[str], Fit] = {}
    for fit in fits:
        found.setdefault(frozenset(map(base, fit.active)), fit)
    return list(found.values())


def leading(parent: Fit, scores: list[Score]) -> list[Score]:
    """Return the scores that deserve a full fit."""
    if not scores:
        return []
    worth = [s for s in scores if s.drop > WORTH * max(1.0, parent.chi2 / len(parent.residual))]
    near = [s for s in worth if s.drop * WITHIN >= worth[0].drop]
    return worth[: max(FEWEST, min(MOST, len(near)))]


def within_reach(parent: Fit, found: Score, fits: Mapping[frozenset[str], Fit]) -> bool:
    """Tell whether a candidate may come to the best model of its size, its score a guess within a factor."""
    known = [f.chi2 for key, f in fits.items() if len(key) == len(parent.active) + 1]
    return parent.chi2 - REACH * found.drop <= min(known, default=np.inf)


def promising(smaller: Fit, larger: Fit) -> bool:
    """Tell whether an addition may come to be significant."""
    n_eff = max(smaller.independent, larger.independent)
    return bool(n_eff * np.log(smaller.chi2 / larger.chi2) > PROMISING)
