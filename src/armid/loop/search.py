"""Look for the effects that the records ask for: one more at a time, a few models of each size kept."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.loop.candidates import LOOSE, Library, base, loose
from armid.loop.diagnose import diagnose, train_view
from armid.loop.equivalence import alike
from armid.loop.fit import Fit, fit_from, fit_globally
from armid.loop.score_test import (
    SURE,
    Score,
    accurate,
    at_null,
    different,
    leading,
    promising,
    ranked,
    refitted,
    start_of,
    substituted,
    traced,
    within_reach,
)
from armid.loop.select import Verdict, compare
from armid.loop.whitening import WhiteRecords

Array = NDArray[np.float64]
# Shares of their range from which all shapes begin; then each alone from the best of so many places along its range:
# the best period of a sampled control is a narrow one.
STARTS, N_PLACES = (0.03, 0.5), 384


def loosened(fit: Fit, name: str, library: Library) -> Fit:
    """Return the fit with the fixed shapes of one of its effects free, such as the width over which a sign is smoothed.

    A declared shape that is not the machine's leaves a residual that another effect would be taken for.
    """
    active = loose(fit.active, name)
    records = library.problem(active, fit.values)
    known = dict(zip(fit.records.space.names, fit.candidate, strict=True))
    z = records.shares(np.array([known[n] for n in records.space.free_names]))
    free = np.array([n in library.loosened(name) for n in records.space.free_names])
    starts = [np.where(free, share, z) for share in STARTS]
    # The strength has taken up what it could of the shape's part, so that each shape is tried without it too.
    rest = records.shares(at_null(records, fit.candidate, name)[records.space.free])
    starts += [best_along(records, at, place) for place in map(int, np.flatnonzero(free)) for at in (z, rest)]
    return fit_from(records, active, [np.clip(z, 1e-3, 1.0 - 1e-3), *starts])


def best_along(records: WhiteRecords, z: Array, place: int) -> Array:
    """Return a candidate with one of its free parameters where it does best, the others as they are, (n_free,)."""
    tried = np.tile(z, (N_PLACES, 1))
    tried[:, place] = (np.arange(N_PLACES) + 0.5) / N_PLACES
    return np.asarray(tried[np.argmin(records.chi2(tried))])


MOST_EFFECTS = 6
# Of one size so many models are extended: a strong second effect can mislead the choice of the first.
BEAM = 3
N_EXCHANGES = 3
# Where no test of what remains is more striking than this, all together, no second effect is looked for: it would need
# more of the residual than the tests would overlook, and looking costs more than everything before.
QUIET = 0.1
# Of so many of the best the fixed shapes are set free: a rival must not lose by the width of a sign alone.
N_LOOSENED = 4
LOOSENED_WITHIN = 4.0
Trial = Callable[[], Fit]
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Level:
    """Hold the models with one number of effects, best first.

    verdict: of the best against the best of the level before, None for the first.
    """

    fits: tuple[Fit, ...]
    verdict: Verdict | None = None

    @property
    def best(self) -> Fit:
        """The model with the lowest criterion."""
        return self.fits[0]


@dataclass(eq=False)
class Search:
    """Extend models until nothing earns its parameters.

    fits: every model that was fitted, by its effects. scores: of the candidates at each of them.
    """

    library: Library
    fits: dict[frozenset[str], Fit] = field(default_factory=dict)
    scores: dict[frozenset[str], list[Score]] = field(default_factory=dict)

    def run(self) -> list[Level]:
        """Return the levels: the declared model, then those whose best earned its place."""
        declared = accurate(fit_globally(self.library.problem(()), ()), self.library)
        self.fits[frozenset()] = declared
        levels = [Level((declared,))]
        while len(levels) <= MOST_EFFECTS:
            level = self.next_level(levels[-1])
            if level is None or level.verdict is None or not level.verdict.earned:
                break
            levels.append(level)
        return levels

    def next_level(self, last: Level) -> Level | None:
        """Return the best models with one effect more, None where no candidate is worth a fit."""
        size = len(last.best.active) + 1
        if last.best.active and diagnose(train_view(last.best)).p > QUIET:
            return None
        self.extend(last.best)
        if last.best.is_noise and not (self.of_size(size) and promising(last.best, self.of_size(size)[0])):
            return None
        for parent in different(last.fits)[1:BEAM]:
            self.extend(parent)
        if not self.of_size(size):
            return None
        if not promising(self.of_size(size - 1)[0], self.of_size(size)[0]):
            return None
        for _ in range(N_EXCHANGES):
            best = self.of_size(size)[0]
            self.exchange(best)
            if self.of_size(size)[0] is best:
                self.exchange_alike(best)
            leaders = self.of_size(size)[:N_LOOSENED]
            self.loosen(f for f in leaders if f.chi2 <= LOOSENED_WITHIN * best.chi2)
            if self.of_size(size)[0] is best:
                break
        smaller, fits = self.of_size(size - 1)[0], self.of_size(size)
        self.library.told(f"judging {self.shown(fits[0].active)}")
        verdict = compare(smaller, fits[0], len(self.library.candidates), self.shapes(smaller, fits[0]))
        return Level(tuple(fits), verdict)

    def shown(self, active: Iterable[str]) -> str:
        """Return effects as people read them."""
        return " + ".join(self.library.public(n) for n in active)

    def shapes(self, smaller: Fit, larger: Fit) -> int:
        """Return how many shapes were searched for what is new in a model."""
        new = [s.n_shapes for s in self.trace(smaller) if s.name in larger.active and s.name not in smaller.active]
        return max(new, default=1)

    def exchange(self, best: Fit) -> None:
        """Take each effect of a model out and look what else would take its place."""
        for name in best.active:
            rest = tuple(n for n in best.active if n != name)
            self.extend(self.reduced(best, rest))

    def exchange_alike(self, best: Fit) -> None:
        """Fit the models in which a candidate that moves the records alike stands in the place of an effect."""
        tried: dict[frozenset[str], Trial] = {}
        for rival in alike(best, self.library):
            active = (*(n for n in best.active if n != rival.place), rival.name)
            tried.setdefault(frozenset(active), partial(substituted, active, rival.values, self.library))
        self.fit_each(tried)

    def reduced(self, fit: Fit, rest: tuple[str, ...]) -> Fit:
        """Return the fit with some effects only, from the values that they had."""
        key = frozenset(rest)
        if key not in self.fits:
            records = self.library.problem(rest, fit.values)
            start = start_of(records, fit.values)
            if not np.isfinite(records.chi2(start)[0]):
                # What was held in check by the effect that is gone may run away: begin with all that is left at rest.
                start = start_of(records, self.fits[frozenset()].values)
            self.fits[key] = accurate(fit_from(records, rest, [start]), self.library)
        return self.fits[key]

    def loosen(self, fits: Iterable[Fit]) -> None:
        """Set the fixed shapes of each effect of some models free, one effect at a time (see `loosened`)."""
        tried: dict[frozenset[str], Trial] = {}
        for fit in fits:
            for name in fit.active:
                if not name.endswith(LOOSE) and self.library.loosened(name):
                    tried.setdefault(frozenset(loose(fit.active, name)), partial(loosened, fit, name, self.library))
        self.fit_each(tried)

    def extend(self, parent: Fit) -> None:
        """Fit a model with each of the leading candidates added, beyond the first few where it is in reach."""
        scores = leading(parent, self.trace(parent))
        self.refit(parent, scores[:SURE])
        self.refit(parent, [s for s in scores[SURE:] if within_reach(parent, s, self.fits)])

    def refit(self, parent: Fit, scores: Iterable[Score]) -> None:
        """Fit a model with each of some candidates added."""
        self.fit_each({frozenset((*parent.active, s.name)): partial(refitted, parent, s, self.library) for s in scores})

    def fit_each(self, tried: Mapping[frozenset[str], Trial]) -> None:
        """Make the fits that are not known yet, side by side; one that diverges whatever its start is left out."""
        new = {key: trial for key, trial in tried.items() if key not in self.fits}
        for key in new:
            self.library.told(f"fitting {self.shown(sorted(key))}")
        found = self.library.each(unless_diverged, new.values())
        self.fits.update({key: fit for key, fit in zip(new, found, strict=True) if fit and np.isfinite(fit.chi2)})

    def trace(self, fit: Fit) -> list[Score]:
        """Return the scores of the candidates at a fit, best first."""
        key = frozenset(fit.active)
        if key not in self.scores:
            self.scores[key] = traced(fit, self.library)
        return self.scores[key]

    def ordered(self, fit: Fit) -> Fit:
        """Return the fit with its effects in the order in which they would be added, the most telling first."""
        order: list[str] = []
        while len(order) < len(fit.active):
            left = [n for n in fit.active if n not in order]
            each = {n: self.reduced(fit, (*order, n)) if len(order) + 1 < len(fit.active) else fit for n in left}
            order.append(min(left, key=lambda n: each[n].chi2))
        return replace(fit, active=tuple(order))

    def model_with(self, name: str, best: Fit) -> Fit | None:
        """Return the best fit of the same size that holds an effect and differs from the best by no more than it."""
        known = [f for f in self.of_size(len(best.active)) if name in map(self.library.public, f.active)]
        near = [f for f in known if len(set(map(base, f.active)) - set(map(base, best.active))) <= 1]
        return near[0] if near else None

    def of_size(self, size: int) -> list[Fit]:
        """Return the models with a number of effects, by their criterion, best first."""
        fits = [f for key, f in self.fits.items() if len(key) == size]
        return ranked(fits)


def unless_diverged(trial: Callable[[], T]) -> T | None:
    """Return what a fit gives, None where each of its starts diverges or it cannot be composed."""
    try:
        return trial()
    except ArmidError:
        return None
