"""Look for the effects that the records ask for: one more at a time, a few models of each size kept."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.loop.candidates import Active, EffectKey, Library, declared_keys
from armid.loop.diagnose import diagnose, train_residuals
from armid.loop.equivalence import substitutes
from armid.loop.fit import Fit, fit_from, fit_globally
from armid.loop.score_test import N_TRIED, Score, at_null, free_values, scores
from armid.loop.select import Comparison, compare, criterion
from armid.loop.whitening import WhiteRecords

Array = NDArray[np.float64]
Trial = Callable[[], Fit]
T = TypeVar("T")
MOST_EFFECTS = 6
# Of one size so many models are extended: a strong second effect can mislead the choice of the first.
BEAM = 3
N_EXCHANGES = 3
# Where no test of what remains is more striking than this, all together, no second effect is looked for: it would need
# more of the residual than the tests would overlook, and looking costs more than everything before.
QUIET = 0.1
# Of so many of the best the fixed shapes are set free: a rival must not lose by the width of a sign alone.
N_FREED, FREED_WITHIN = 4, 4.0
# Scores are a linear guess: refit at least and at most so many, and those within a factor of the best.
FEWEST, MOST, WITHIN = 6, 12, 4.0
# So many of them are refitted even where the score says that they cannot do as well as a model that is known.
SURE = 4
# The others must come to what is known with so many times their score: without a friction every rate is biased.
REACH = 10.0
# A drop of chi2 that one candidate in thousands reaches on noise: below it nothing is refitted.
WORTH = 8.0
# An addition whose statistic stays below this is not looked at further; one in ten thousand asks for 15.
PROMISING = 12.0
# Models within this factor of the least chi2 are told apart by the criterion; what they leave has about one character.
COMPARABLE = 1.5


@dataclass(frozen=True, eq=False)
class SearchLevel:
    """Hold the models with one number of effects, best first.

    comparison: of the best with the best of the level before, None for the first.
    """

    fits: tuple[Fit, ...]
    comparison: Comparison | None = None

    @property
    def best(self) -> Fit:
        return self.fits[0]


@dataclass(eq=False)
class Search:
    """Extend models until nothing earns its parameters.

    fits: every model that was fitted, by its effects. scores: of the candidates at each of them.
    """

    library: Library
    fits: dict[frozenset[EffectKey], Fit] = field(default_factory=dict)
    scores: dict[frozenset[EffectKey], list[Score]] = field(default_factory=dict)

    def run(self) -> list[SearchLevel]:
        """Return the levels: the declared model, then those whose best earned its place."""
        declared = accurate(fit_globally(self.library.problem(()), ()), self.library)
        self.fits[frozenset()] = declared
        levels = [SearchLevel((declared,))]
        while len(levels) <= MOST_EFFECTS:
            level = self.next_level(levels[-1])
            if level is None or level.comparison is None or not level.comparison.earned:
                break
            levels.append(level)
        return levels

    def next_level(self, last: SearchLevel) -> SearchLevel | None:
        """Return the best models with one effect more, None where no candidate is worth a fit."""
        size = len(last.best.active) + 1
        if last.best.active and diagnose(train_residuals(last.best)).p > QUIET:
            return None
        self.extend(last.best)
        if last.best.is_noise and not (self.of_size(size) and promising(last.best, self.of_size(size)[0])):
            return None
        distinct: dict[frozenset[EffectKey], Fit] = {}
        for fit in last.fits:  # a model with a shape set free is no other
            distinct.setdefault(frozenset(declared_keys(fit.active)), fit)
        for parent in list(distinct.values())[1:BEAM]:
            self.extend(parent)
        if not self.of_size(size) or not promising(self.of_size(size - 1)[0], self.of_size(size)[0]):
            return None
        for _ in range(N_EXCHANGES):
            best = self.of_size(size)[0]
            for key in best.active:
                self.extend(self.reduced(best, tuple(k for k in best.active if k != key)))
            if self.of_size(size)[0] is best:
                self.exchange_substitutes(best)
            self.free_shapes(f for f in self.of_size(size)[:N_FREED] if f.chi2 <= FREED_WITHIN * best.chi2)
            if self.of_size(size)[0] is best:
                break
        smaller, fits = self.of_size(size - 1)[0], self.of_size(size)
        self.library.say(f"judging {shown(fits[0].active)}")
        new = [s.n_shapes for s in self.scores_at(smaller) if s.key in fits[0].active and s.key not in smaller.active]
        return SearchLevel(tuple(fits), compare(smaller, fits[0], len(self.library.candidates), max(new, default=1)))

    def scores_at(self, fit: Fit) -> list[Score]:
        active = frozenset(fit.active)
        if active not in self.scores:
            self.scores[active] = scores(fit, self.library)
        return self.scores[active]

    def extend(self, parent: Fit) -> None:
        """Fit a model with each of the leading candidates added, beyond the first few where it is in reach."""
        worth = [s for s in self.scores_at(parent) if s.drop > WORTH * max(1.0, parent.chi2 / len(parent.residual))]
        near = [s for s in worth if s.drop * WITHIN >= worth[0].drop]
        leading = worth[: max(FEWEST, min(MOST, len(near)))]
        self.add_each(parent, leading[:SURE])
        known = [f.chi2 for active, f in self.fits.items() if len(active) == len(parent.active) + 1]
        limit = min(known, default=np.inf)
        self.add_each(parent, [s for s in leading[SURE:] if parent.chi2 - REACH * s.drop <= limit])

    def add_each(self, parent: Fit, found: Iterable[Score]) -> None:
        self.fit_each({frozenset((*parent.active, s.key)): partial(refitted, parent, s, self.library) for s in found})

    def exchange_substitutes(self, best: Fit) -> None:
        """Fit the models in which a candidate that moves the records alike stands in the place of an effect."""
        tried: dict[frozenset[EffectKey], Trial] = {}
        for rival in substitutes(best, self.library):
            active = (*(k for k in best.active if k != rival.place), rival.key)
            tried.setdefault(frozenset(active), partial(fit_near, active, rival.values, self.library))
        self.fit_each(tried)

    def free_shapes(self, fits: Iterable[Fit]) -> None:
        """Set the fixed shapes of each effect of some models free, one effect at a time (see `with_free_shapes`)."""
        tried: dict[frozenset[EffectKey], Trial] = {}
        for fit in fits:
            for key in fit.active:
                if not key.free_shape and self.library.fixed_shapes(key):
                    trial = partial(with_free_shapes, fit, key, self.library)
                    tried.setdefault(frozenset(freed(fit.active, key)), trial)
        self.fit_each(tried)

    def fit_each(self, tried: Mapping[frozenset[EffectKey], Trial]) -> None:
        """Make the fits that are not known yet, side by side; one that diverges whatever its start is left out."""
        new = {active: trial for active, trial in tried.items() if active not in self.fits}
        for active in new:
            self.library.say(f"fitting {shown(sorted(active))}")
        found = self.library.each(unless_diverged, new.values())
        self.fits |= {active: fit for active, fit in zip(new, found, strict=True) if fit and np.isfinite(fit.chi2)}

    def reduced(self, fit: Fit, rest: Active) -> Fit:
        if frozenset(rest) not in self.fits:
            records = self.library.problem(rest, fit.values)
            start = start_of(records, fit.values)
            if not np.isfinite(records.chi2(start)[0]):
                # What was held in check by the effect that is gone may run away: begin with all that is left at rest.
                start = start_of(records, self.fits[frozenset()].values)
            self.fits[frozenset(rest)] = accurate(fit_from(records, rest, [start]), self.library)
        return self.fits[frozenset(rest)]

    def ordered(self, fit: Fit) -> Fit:
        """Return the fit with its effects in the order in which they would be added, the most telling first."""
        order: list[EffectKey] = []
        while len(order) < len(fit.active):
            left = [k for k in fit.active if k not in order]
            each = {k: self.reduced(fit, (*order, k)) if len(order) + 1 < len(fit.active) else fit for k in left}
            order.append(min(left, key=lambda k: each[k].chi2))
        return replace(fit, active=tuple(order))

    def model_with(self, name: str, best: Fit) -> Fit | None:
        """Return the best fit of the same size that holds an effect and differs from the best by no more than it."""
        known = [f for f in self.of_size(len(best.active)) if name in {k.public for k in f.active}]
        near = [f for f in known if len(declared_keys(f.active) - declared_keys(best.active)) <= 1]
        return near[0] if near else None

    def of_size(self, size: int) -> list[Fit]:
        """Return the models with a number of effects by their criterion, best first.

        It takes the effective samples of those with about the least chi2.
        """
        known = [f for active, f in self.fits.items() if len(active) == size]
        least = min((f.chi2 for f in known), default=0.0)
        n_eff = max((f.independent for f in known if f.chi2 <= COMPARABLE * least), default=1.0)
        return sorted(known, key=lambda f: criterion(f, n_eff))


def shown(active: Iterable[EffectKey]) -> str:
    return " + ".join(key.public for key in active)


def promising(smaller: Fit, larger: Fit) -> bool:
    n_eff = max(smaller.independent, larger.independent)
    return bool(n_eff * np.log(smaller.chi2 / larger.chi2) > PROMISING)


def refitted(current: Fit, found: Score, library: Library) -> Fit:
    """Fit the extended model fully, from the best two of the starts of a score that are not next to each other."""
    active = (*current.active, found.key)
    records = library.problem(active)
    chi2 = records.chi2(np.array(found.starts[:N_TRIED]))
    first, second = (found.starts[i] for i in np.resize(np.argsort(chi2, kind="stable")[:2], 2))
    starts = [first, second] if np.max(np.abs(second - first)) > 0.02 else [first]
    return accurate(fit_from(records, active, starts), library)


def fit_near(active: Active, values: Mapping[str, float], library: Library) -> Fit:
    records = library.problem(active, values)
    return accurate(fit_from(records, active, [start_of(records, values)]), library)


def start_of(records: WhiteRecords, values: Mapping[str, float]) -> Array:
    return np.clip(records.shares(free_values(records, values)), 0.0, 1.0)


def accurate(fit: Fit, library: Library) -> Fit:
    """Return the fit, made again with finer steps where it ended where the engine's are too coarse."""
    finer = library.recalibrated(fit.active, fit.values)
    return fit if finer is None else fit_from(finer, fit.active, [fit.z])


# Shares of their range from which all shapes begin; then each alone from the best of so many places along its range:
# the best period of a sampled control is a narrow one.
STARTS, N_PLACES = (0.03, 0.5), 384


def freed(active: Active, key: EffectKey) -> Active:
    return tuple(replace(k, free_shape=True) if k == key else k for k in active)


def with_free_shapes(fit: Fit, key: EffectKey, library: Library) -> Fit:
    """Return the fit with the fixed shapes of one of its effects free, such as the width over which a sign is smoothed.

    A declared shape that is not the machine's leaves a residual that another effect would be taken for.
    """
    active = freed(fit.active, key)
    records = library.problem(active, fit.values)
    known = dict(zip(fit.records.space.names, fit.candidate, strict=True))
    z = records.shares(np.array([known[n] for n in records.space.free_names]))
    free = np.array([n in library.fixed_shapes(key) for n in records.space.free_names])
    starts = [np.where(free, share, z) for share in STARTS]
    # The strength has taken up what it could of the shape's part, so that each shape is tried without it too.
    rest = records.shares(at_null(records, fit.candidate, key)[records.space.free])
    starts += [best_along(records, at, place) for place in map(int, np.flatnonzero(free)) for at in (z, rest)]
    return fit_from(records, active, [np.clip(z, 1e-3, 1.0 - 1e-3), *starts])


def best_along(records: WhiteRecords, z: Array, place: int) -> Array:
    """Return a candidate with one of its free parameters where it does best, the others as they are, (n_free,)."""
    tried = np.tile(z, (N_PLACES, 1))
    tried[:, place] = (np.arange(N_PLACES) + 0.5) / N_PLACES
    return np.asarray(tried[np.argmin(records.chi2(tried))])


def unless_diverged(trial: Callable[[], T]) -> T | None:
    """Return what a fit gives, None where each of its starts diverges or it cannot be composed."""
    try:
        return trial()
    except ArmidError:
        return None
