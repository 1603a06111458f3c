"""Look for the effects that the records ask for: one more at a time, a few models of each size kept."""

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import compress
from typing import Any

import numpy as np

from armid.estimation.least_squares import REACH, held_by_bound, spread_starts
from armid.inference.checks import SIGNIFICANCE, is_significant, train_residuals
from armid.inference.library import Active, EffectKey, Library, declared_keys
from armid.inference.model import Fit, fit_from
from armid.inference.refit import (
    accurate,
    far_behind,
    finished,
    finished_near,
    fit_near,
    freed,
    refitted,
    start_of,
    substitutes,
    unless_diverged,
    with_free_shapes,
)
from armid.inference.score_test import Score, is_same, scores
from armid.loop.equivalence import WITHIN
from armid.loop.fit import Comparison, behind, compare, criterion

Trial = Callable[[], Fit]
MOST_EFFECTS = 6
# Up to so many effects are tried together where fewer earn nothing and more than noise is left.
LOOK_AHEAD = 3
# Of one size so many models are extended: a strong second effect can mislead the choice of the first.
BEAM = 3
N_EXCHANGES = 3
# Models of a round that the log tells.
N_LOGGED = 5
# Where no test of what remains is more striking than this, all together, no second effect is looked for: it would need
# more of the residual than the tests would overlook, and looking costs more than everything before. Beyond the sets
# looked at ahead, and one more in which a wrong one is mended, it ends where the tests call it noise, and is brief:
# effects are exchanged once, and only in a set that earns them as it is.
QUIET, THOROUGH = 0.1, LOOK_AHEAD + 1
# Of so many of the best the fixed shapes are set free: a rival must not lose by the width of a sign alone.
N_FREED, FREED_WITHIN = 4, 4.0
# Scores are a linear guess: refit at least and at most so many, and those within a factor of the best.
FEWEST, MOST, FACTOR = 6, 12, 4.0
# So many of them are refitted even where the score says that they cannot do as well as a model that is known.
SURE = 4
# Said of several effects beside which nothing can be told.
CREEPS = "creeps and does not arrive: no further effect can be judged"
# A drop of chi2 that one candidate in thousands reaches on noise: below it nothing is refitted.
WORTH = 8.0
# An addition whose statistic stays below this is not looked at further; one in ten thousand asks for 15.
PROMISING = 12.0
# Where as many times the noise are left, sets are looked at that a single effect does not promise.
FAR_ABOVE_NOISE = 2.0
# One that no noise reaches, whatever is known of its level.
CLEAR = 40.0
# Refits stop early; those are finished whose n ln(chi2) is within this of the best of their size, and so many anyhow.
FAR, N_FINISHED = 50.0, 4
# Where a limit is set, nothing is exchanged in a model that leaves more than this share of what is above it.
LEFT = 0.5
# Models within this factor of the least chi2 are told apart by the criterion; what they leave has about one character.
COMPARABLE = 1.5


@dataclass(frozen=True, eq=False)
class SearchLevel:
    """Hold the models with one number of effects, best first.

    comparison: of the best with the best of the last level that earned its effects, None for the declared model.
    """

    fits: tuple[Fit, ...]
    comparison: Comparison | None = None

    @property
    def best(self) -> Fit:
        return self.fits[0]

    @property
    def refused(self) -> str:
        """Which threshold was not reached, in words; "" where its best is preferred to the smaller ones."""
        return "" if self.comparison is None else self.comparison.why


@dataclass(eq=False)
class Search:
    """Extend models until nothing earns its parameters.

    fits: every model that was fitted, by its effects. scores: of the candidates at each of them. rounds: the log, as
    report.json holds it.
    limit: chi2 to which a model must be able to come, else it is given up. enough: asked of each level that earned its
    effects, whether to look no further. exchanged: models in which substitutes were tried.
    """

    library: Library
    fits: dict[frozenset[EffectKey], Fit] = field(default_factory=dict)
    scores: dict[frozenset[EffectKey], list[Score]] = field(default_factory=dict)
    rounds: list[dict[str, Any]] = field(default_factory=list)
    limit: float = np.inf
    enough: Callable[[SearchLevel], bool] = lambda _: False
    exchanged: set[Active] = field(default_factory=set)

    def start(self) -> Fit:
        if frozenset() not in self.fits:
            records = self.library.problem(())
            starts = spread_starts(records) if records.space.free.any() else ()
            self.fits[frozenset()] = accurate(fit_from(records, (), starts), self.library)
        return self.fits[frozenset()]

    def further(self, level: SearchLevel, limit: float, to_noise: bool = True) -> Fit | None:
        """Return the best model with one effect more, if it fits better, chi2 is below a limit, and noise is left.

        Or of as many effects, if a better one is found on the way. What it predicts of records left out is not asked:
        what is looked for here speaks against the fault of one. to_noise: whether it must leave noise.
        """
        library = self.library.about(level.best.records.replays, level.best.misfit)
        beside = replace(self, library=library, fits=dict(self.fits), rounds=[], limit=limit)
        found = beside.next_level(level, level.best)
        # What was given up above the limit is known for good only where it would be far behind the best of its size.
        least = {n: beside.of_size(n)[0].chi2 for n in {len(active) for active in beside.fits}}
        self.fits |= {active: f for active, f in beside.fits.items()
                      if f.chi2 < limit or not f.rough or least[len(active)] + WITHIN < limit}  # fmt: skip
        alike = self.of_size(len(level.best.active))[0]
        rivals = [alike] if far_behind(level.best, alike) > WITHIN else []
        rivals += [found.best] if found is not None and found.comparison and found.comparison.fits_better else []
        good = [f for f in rivals if f.chi2 <= limit and not (to_noise and is_significant(f))]
        return min(good, key=lambda f: f.chi2, default=None)

    def run(self, most: int = MOST_EFFECTS, known: Sequence[SearchLevel] = ()) -> list[SearchLevel]:
        """Return the levels: the declared model, and all up to the last whose best earned its effects, at most so many.

        An effect may show only beside another one: where more than noise is left, sets of up to three are tried before
        the search ends. known: levels from which it goes on.
        """
        levels = [*known] or [SearchLevel((self.start(),))]
        earned = len(levels)
        self.library = self.library.about(levels[-1].best.records.replays, levels[-1].best.misfit)
        while len(levels) <= most:
            level = self.next_level(levels[-1], levels[earned - 1].best)
            if level is None:
                break
            levels.append(level)
            self.library = self.library.about(level.best.records.replays, level.best.misfit)
            if not level.refused:
                if self.enough(level):
                    earned = len(levels)
                    break
                levels = self.renewed(levels)
                earned = len(levels)
            elif len(levels) > LOOK_AHEAD or not is_significant(level.best):
                break
        return self.renewed(levels)

    def renewed(self, levels: Sequence[SearchLevel]) -> list[SearchLevel]:
        """Return the levels up to the last that earned its effects, each with what was found of its size later.

        An exchange in a larger model may leave a smaller one that is better than all that its own round had tried.
        """
        found, earned = [levels[0]], 1
        for old in levels[1:]:
            level, fits = old, self.of_size(len(old.best.active))
            if far_behind(old.best, fits[0]) > WITHIN:
                level = self.judged(fits, found[earned - 1].best)
                self.note_round(len(fits[0].active), level.refused)
            found.append(level)
            earned = earned if level.refused else len(found)
        return found[:earned]

    def next_level(self, last: SearchLevel, smaller: Fit) -> SearchLevel | None:
        """Return the best models with one effect more, None where no candidate is worth a fit.

        smaller: the model with which they are compared.
        """
        size = len(last.best.active) + 1
        quiet = QUIET if size <= THOROUGH else SIGNIFICANCE
        if last.best.active and (p := train_residuals(last.best).diagnosis.p) > quiet and not self.is_clear(last.best):
            self.note_round(size, f"what is left is noise (chance {p:.2g}; below {quiet:g} the search goes on)")
            return None
        if last.best.crept:
            self.note_round(size, f"the fit of {' + '.join(last.best.names)} {CREEPS}")
            return None
        self.extend(last.best)
        while self.reach_further(size):
            self.extend(last.best)
        if last.best.is_noise and not any(far_behind(last.best, f) > PROMISING for f in self.of_size(size)[:1]):
            self.note_round(size, "the size of what is left is that of the noise, and no candidate lowers it clearly")
            return None
        for parent in parents(last.fits)[1:]:
            self.extend(parent)
        is_promising = any(far_behind(self.of_size(size - 1)[0], f) > PROMISING for f in self.of_size(size)[:1])
        # Where few samples of a residual are independent an effect may not show without the others.
        if not is_promising and not (self.of_size(size) and size < LOOK_AHEAD and last.best.misfit > FAR_ABOVE_NOISE):
            self.note_round(size, f"no candidate lowers n ln(chi2) by more than {PROMISING:g}")
            return None
        if self.of_size(size)[0].chi2 - self.limit > LEFT * (last.best.chi2 - self.limit):
            return None
        if (best := self.of_size(size)[0]).crept:
            self.free_shapes([best])
            best = self.of_size(size)[0]
        if not best.crept and (size <= THOROUGH or not self.judged(self.of_size(size), smaller).refused):
            self.exchange(size, last.best)
        # An exchange may have found a better model of the size before.
        smaller = self.of_size(size - 1)[0] if size - len(smaller.active) == 1 else smaller
        level = self.judged(self.of_size(size), smaller)
        self.note_round(size, level.refused)
        return level

    def exchange(self, size: int, smaller: Fit) -> None:
        """Try others in the place of each effect of the best model of a size, and its shapes free, while that helps.

        smaller: the best that the round before had found.
        """
        for _ in range(N_EXCHANGES if size <= THOROUGH else 1):
            best = self.of_size(size)[0]
            reduced = [self.reduced_again(best, tuple(k for k in best.active if k != key)) for key in best.active]
            less = self.of_size(size - 1)[0]
            is_better = far_behind(smaller, less) > WITHIN
            if is_better and not is_significant(less):
                break
            for parent in reduced:
                self.extend(parent)
            if is_better and less.active not in self.exchanged:
                # What its own round would have done with it.
                self.exchange_substitutes(less)
                self.free_shapes([less])
                for parent in parents(self.of_size(size - 1)):
                    self.extend(parent)
            if self.of_size(size)[0] is best:
                self.exchange_substitutes(best)
                if not is_significant(best):
                    # A rival that does nearly as well may be the right effect beside another that is not.
                    for rival in parents([f for f in self.of_size(size) if behind(f, best) < WITHIN])[1:]:
                        self.exchange_substitutes(rival)
            self.free_shapes(f for f in self.of_size(size)[:N_FREED] if f.chi2 <= FREED_WITHIN * best.chi2)
            now = self.of_size(size)[0]
            if now is best or (size >= THOROUGH and declared_keys(now.active) == declared_keys(best.active)):
                break

    def judged(self, fits: Sequence[Fit], smaller: Fit) -> SearchLevel:
        """Return the models of a size as a level whose best is compared with a smaller model."""
        self.library.say(f"judging {' + '.join(fits[0].names)}")
        n_more = len(fits[0].active) - len(smaller.active)
        new = [s.n_shapes for s in self.scores_at(smaller) if s.key in fits[0].active and s.key not in smaller.active]
        compared = compare(smaller, fits[0], len(self.library.candidates) ** n_more, max(new, default=1), n_more)
        return SearchLevel(tuple(fits), compared)

    def note_round(self, size: int, refused: str) -> None:
        """Note how a round ended: the threshold that refused its best in words, "" where it was taken."""
        fits = self.of_size(size)
        best = {f.names: f.chi2 / len(f.residual) for f in reversed(fits[: 2 * N_LOGGED])}
        leading = [{"effects": list(names), "chi2_per_sample": c} for names, c in reversed(best.items())][:N_LOGGED]
        self.rounds.append({"n_effects": size, "n_tried": len(fits), "refused": refused, "leading": leading})

    def scores_at(self, fit: Fit) -> list[Score]:
        active = frozenset(fit.active)
        if active not in self.scores:
            self.scores[active] = scores(fit, self.library)
        return self.scores[active]

    def extend(self, parent: Fit) -> None:
        """Fit a model with each of the leading candidates added, beyond the first few where it is in reach.

        Of those that do the same one stands for all; `exchange_all` puts the others in its place.
        """
        least = WORTH * max(1.0, parent.chi2 / len(parent.residual))
        worth = [s for s in self.scores_at(parent) if s.drop > least and s.twin is None]
        near = [s for s in worth if s.drop * FACTOR >= worth[0].drop]
        leading = [s for s in worth[: max(FEWEST, min(MOST, len(near)))] if parent.chi2 - REACH * s.drop <= self.limit]
        self.add_each(parent, leading[:SURE])
        limit = min((f.chi2 for f in self.of_size(len(parent.active) + 1)), default=np.inf)
        self.add_each(parent, [s for s in leading[SURE:] if parent.chi2 - REACH * s.drop <= limit])

    def is_clear(self, fit: Fit) -> bool:
        """Tell whether a candidate would lower chi2 by far more than noise lets it, to first order.

        Where noise is coloured and its level known from a short rest, that shows what no test of the residual does.
        """
        drop = max((s.drop for s in self.scores_at(fit)), default=0.0)
        return bool(fit.independent * np.log(fit.chi2 / max(fit.chi2 - drop, 1e-300)) > CLEAR)

    def add_each(self, parent: Fit, found: Iterable[Score]) -> None:
        """Fit a model with each of some candidates added, as far as it may come near the best of its size."""
        best = min(self.of_size(len(parent.active) + 1), key=lambda f: f.chi2, default=None)
        limit = np.inf if best is None else best.chi2 * max(COMPARABLE, min(FACTOR, np.exp(FAR / best.independent)))
        self.fit_each({
            frozenset((*parent.active, s.key)): partial(refitted, parent, s, self.library, min(limit, self.limit))
            for s in found
        })  # fmt: skip

    def reach_further(self, size: int) -> bool:
        """Forget the models of a size with effects that hold one of the best at a range that may be wider."""
        for fit in self.of_size(size)[:N_FREED]:
            held = list(compress(fit.values, held_by_bound(fit.records.space, fit.x)))
            library = self.library.reaching_further(fit.active, held)
            if library is not self.library:
                for key in self.twins_of({self.library.owner(name) for name in held}):
                    names = [f"{key.compiled}.{p.name}" for p in library.candidates[key].parameters]
                    library = library.reaching_further((key,), names)
                moved = {library.owner(name) for name in library.bounds.keys() - self.library.bounds.keys()}
                self.fits = {active: f for active, f in self.fits.items()
                             if len(active) < size or not declared_keys(active) & moved}  # fmt: skip
                self.library = library
                self.scores.clear()
                return True
        return False

    def exchange_substitutes(self, best: Fit) -> None:
        """Fit the models in which a candidate that moves the records alike stands in the place of an effect.

        Where the effect has its shapes free they are so in its place too, else it would lose by the width of a sign.
        """
        tried: dict[frozenset[EffectKey], Trial] = {}
        self.exchanged.add(best.active)
        for rival in substitutes(best, self.library):
            is_free = rival.place.free_shape and bool(self.library.fixed_shapes(rival.key))
            for key in (rival.key, replace(rival.key, free_shape=True))[: 1 + is_free]:
                active = (*(k for k in best.active if k != rival.place), key)
                tried.setdefault(frozenset(active), partial(fit_near, active, rival.values, self.library))
        # A known one may have ended elsewhere, from a start that was further away.
        near = {active for active in tried if active in self.fits and far_behind(self.fits[active], best) < FAR}
        self.fit_each(tried, near)

    def twins_of(self, keys: Set[EffectKey | None]) -> set[EffectKey]:
        """Return the candidates that were left out of the search as they do the same as one of some."""
        return {s.key for found in self.scores.values() for s in found if s.twin is not None and s.twin in keys}

    def exchange_all(self, fit: Fit) -> None:
        """Fit the models in which a substitute stands in the place of an effect, where that is not done yet.

        So it is with what does the same as an effect, and with a model whose shapes were set free at the very end.
        """
        known, mine = {frozenset(declared_keys(active)) for active in self.fits}, declared_keys(fit.active)
        others = (mine - {key} | {twin} for key in mine for twin in self.twins_of({key}) - mine)
        if fit.active not in self.exchanged or any(frozenset(other) not in known for other in others):
            self.exchange_substitutes(fit)

    def free_shapes(self, fits: Iterable[Fit]) -> None:
        """Set the fixed shapes of each effect of some models free, one effect at a time (see `with_free_shapes`)."""
        tried: dict[frozenset[EffectKey], Trial] = {}
        for fit in fits:
            for key in fit.active:
                if not key.free_shape and self.library.fixed_shapes(key):
                    trial = partial(with_free_shapes, fit, key, self.library)
                    tried.setdefault(frozenset(freed(fit.active, key)), trial)
        self.fit_each(tried)

    def fit_each(
        self, tried: Mapping[frozenset[EffectKey], Trial], again: Set[frozenset[EffectKey]] = frozenset()
    ) -> None:
        """Make the fits that are not known, or to be made again, side by side; one that diverges is left out."""
        new = {active: trial for active, trial in tried.items() if active not in self.fits or active in again}
        for active in new:
            self.library.say(f"fitting {' + '.join(key.public for key in sorted(active))}")
        found = self.library.each(unless_diverged, new.values())
        for active, fit in zip(new, found, strict=True):
            self.take_better(active, fit)
        for size in {len(active) for active in new}:
            self.finish(size)

    def finish(self, size: int) -> None:
        """Bring the models near the best of a size to their estimates; the others stay where a few steps led."""
        while True:
            fits = self.of_size(size)
            near = [f for i, f in enumerate(fits) if f.rough and (
                i < N_FINISHED or (far_behind(f, fits[0]) < FAR and f.chi2 < COMPARABLE * fits[0].chi2))]  # fmt: skip
            if not near:
                break
            found = self.library.each(unless_diverged, [partial(finished, f, self.library) for f in near])
            done = ((f, fit or replace(f, rough=False)) for f, fit in zip(near, found, strict=True))
            self.fits |= {frozenset(f.active): fit for f, fit in done}

    def reduced(self, fit: Fit, rest: Active) -> Fit:
        if frozenset(rest) not in self.fits:
            records = self.library.problem(rest, fit.values)
            start = start_of(records, fit.values)
            if not np.isfinite(records.chi2(start)[0]):
                # What was held in check by the effect that is gone may run away: begin with all that is left at rest.
                start = start_of(records, self.fits[frozenset()].values)
            self.fits[frozenset(rest)] = accurate(fit_from(records, rest, [start]), self.library)
        return self.fits[frozenset(rest)]

    def reduced_again(self, fit: Fit, rest: Active) -> Fit:
        """Return the fit without an effect, from where it stands even if it is known: that one may be a local one."""
        known = self.fits.get(frozenset(rest))
        if known is not None and rest:
            self.take_better(frozenset(rest), unless_diverged(partial(finished_near, rest, fit.values, self.library)))
        return self.reduced(fit, rest)

    def take_better(self, active: frozenset[EffectKey], fit: Fit | None) -> None:
        """Keep a fit unless it diverged, or is no better than the one that is known."""
        known = self.fits.get(active)
        if fit is not None and np.isfinite(fit.chi2) and (known is None or fit.chi2 < known.chi2):
            self.fits[active] = fit

    def pruned(self, fit: Fit) -> Fit:
        """Return the fit without the effects that may as well be at their nulls, the others fitted again from there."""
        for key in fit.active:
            if not fit.needs(key):
                return self.pruned(self.reduced_again(fit, tuple(k for k in fit.active if k != key)))
        return fit

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
        known = [f for f in self.of_size(len(best.active)) if name in f.names]
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


def parents(fits: Sequence[Fit]) -> list[Fit]:
    """Return the first models that are not the same to the records, so many as are extended.

    A model with a shape set free is no other, nor is one with an effect that does the same in the place of another.
    """
    found: list[Fit] = []
    for fit in fits:
        keys = declared_keys(fit.active)
        if not any(keys == declared_keys(f.active) or is_same(f.residual, fit.residual) for f in found):
            found.append(fit)
        if len(found) == BEAM:
            break
    return found
