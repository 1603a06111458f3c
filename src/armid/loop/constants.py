"""Could constants within their tolerances do what an effect is to explain? One product of them alone, or all together.

Or is it a parameter or a constant that changes from each record to the next, a trend, as of a machine that warms up?
Before a name is believed, the declared model is fitted with its constants free, each drawn to its declared value by its
tolerance (a ridge). Constants that do as well as an effect stand beside it; those that do better take its place.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from armid.errors import ArmidError
from armid.estimation.constants import NAMED, STEP, Product, columns_of, common_factors, moved_replays
from armid.estimation.information import NORMAL_95
from armid.estimation.least_squares import LeastSquaresProblem, descend
from armid.inference.checks import is_significant, train_residuals
from armid.inference.kinds.drifts import order_of
from armid.inference.kinds.faults import simulated_file, with_measured
from armid.inference.library import ROUGHLY, Library
from armid.inference.model import Fit, beyond, decomposed, fit_from, with_own_starts
from armid.inference.refit import unless_diverged
from armid.inference.score_test import candidate_at
from armid.inference.whitening import WhiteRecords
from armid.loop.equivalence import MOST as TOO_MANY
from armid.loop.equivalence import WITHIN, EffectGroup
from armid.loop.fit import FAMILYWISE, compare
from armid.loop.search import Search
from armid.loop.suspects import FREED, Suspect, is_earned
from armid.model import Array
from armid.record import Record

# So many single products are refitted, of those that take away this share of what is no noise.
MOST, HALF = 6, 0.5
# In tolerances: how far a fit may go, so that no bound bars its way (seen: it crept along one to the last step allowed,
# though the minimum was inside); from where on one constant alone is no answer, and one of many.
FARTHEST, PLAUSIBLE, PLAUSIBLE_OF_MANY = 6.0, 3.0, 4.0
# Relative fall of chi2 in one step at which their fit stops, a constant costs a simulation of its own; and what chi2 a
# sample must be in reach: of noise it is 1.
SETTLED, IN_REACH = 1e-6, 2.0
# Of all constants together those are told that are off by more than this share of their tolerance.
TOLD = 0.5
# A constant has to be known to this part of what it would be off, to tell; of so many that is said.
SURE, MOST_TOLD = 3.0, 3
TOGETHER = f"{NAMED}all"
# A trend is asked of so many files, over at most this share of a parameter's range, or of the value of a constant, in
# so many steps of its fit; it has to take away this share of what is more than noise, to first order.
FEWEST_FOR_TREND, FARTHEST_TREND, N_STEPS, NEARLY = 4, 0.5, 8, 0.8


@dataclass(frozen=True, eq=False)
class ConstantModel:
    """Hold a model fitted with some of its constants free.

    fit: at the constants that were found. off: name of each product -> by how many tolerances. scale: by what factor
    those constants that the records tell of are off more than their tolerances say, at least 1.
    """

    fit: Fit
    off: dict[str, float]
    scale: float

    @property
    def name(self) -> str:
        return next(iter(self.off)) if len(self.off) == 1 else TOGETHER

    @property
    def moved(self) -> tuple[str, ...]:
        """Names of the products, those that hardly moved left out where there are many."""
        least = min(TOLD, *sorted(map(abs, self.off.values()))[-MOST_TOLD:])
        return tuple(n for n, u in self.off.items() if abs(u) >= least)

    @property
    def is_stretched(self) -> bool:
        """Whether a constant is far outside its tolerance."""
        return max(map(abs, self.off.values())) >= PLAUSIBLE

    @property
    def explains(self) -> bool:
        """Whether it leaves noise, and no constant is too far outside its tolerance.

        What noise leaves once in a hundred campaigns asks for no sets of effects yet.
        """
        most = PLAUSIBLE if len(self.off) == 1 else PLAUSIBLE_OF_MANY
        return max(map(abs, self.off.values())) < most and train_residuals(self.fit).diagnosis.p > FAMILYWISE

    @property
    def chi2(self) -> float:
        """Sum of squares, that of the ridge included."""
        return self.fit.chi2 + sum(u * u for u in self.off.values())


@dataclass(frozen=True, eq=False)
class FreedConstants(LeastSquaresProblem):
    """Pose records with some products of constants free as min |r(z, u)|^2 + |u|^2, u in tolerances.

    Candidates are shares of a range: free parameters first, then u between -FARTHEST and FARTHEST.
    """

    records: WhiteRecords = field(kw_only=True)
    chosen: Sequence[Product] = field(kw_only=True)

    @cached_property
    def measured(self) -> Array:
        return np.concatenate([self.records.measured, np.zeros(len(self.chosen))])

    def off(self, Z: Array) -> Array:
        """Return by how many tolerances candidates let constants be off, (n_candidates, n_products)."""
        return FARTHEST * (2.0 * Z[:, -len(self.chosen) :] - 1.0)

    def signals(self, Z: Array) -> Array:
        """Return weighted signals of candidates, then what the ridge weighs; constants are one to a simulation.

        Slopes of constants from where the fit began would save most of these, and stop it short of the minimum: the
        columns nearly cancel.
        """
        found = np.empty((len(Z), len(self.measured)))
        found[:, -len(self.chosen) :] = self.off(Z)
        each, groups = np.unique(self.off(Z), axis=0, return_inverse=True)
        for i, off in enumerate(each):
            rows = np.flatnonzero(groups.ravel() == i)
            signals = self.moved(off).signals(Z[rows, : -len(self.chosen)])
            found[rows, : -len(self.chosen)] = signals
        return found

    def moved(self, off: Array) -> WhiteRecords:
        shares = self.shares_at(off)
        return replace(self.records, replays=moved_replays(self.records.replays, shares))

    def shares_at(self, off: Array) -> dict[str, float]:
        """Return by which share of its value the first member of each product is off."""
        return {p.names[0]: float(u) * p.tolerance for p, u in zip(self.chosen, off, strict=True)}


def freed_constants(base: Fit, chosen: Sequence[Product], limit: float = np.inf) -> ConstantModel:
    """Fit a model with some products of constants free, from where it stands; limit: see `descend`.

    Raises ArmidError where the simulation diverges there.
    """
    posed = FreedConstants((), base.records.space, records=base.records, chosen=chosen)
    start = np.concatenate([base.z, np.full(len(chosen), 0.5)])
    z = descend(posed, [start], SETTLED, limit=min(limit, IN_REACH * len(posed.measured)))
    off = posed.off(z[np.newaxis])[0]
    records, at = posed.moved(off), z[: -len(chosen)]
    fit = Fit(base.active, records, at, records.residuals(at)[0], constants=posed.shares_at(off))
    columns = beyond(base.basis, columns_of(chosen, len(base.residual)))
    told = len(chosen) - np.trace(np.linalg.inv(columns.T @ columns + np.eye(len(chosen))))
    names = (p.public for p in chosen)
    return ConstantModel(
        fit, dict(zip(names, map(float, off), strict=True)), max(1.0, float(np.sqrt(off @ off / told)))
    )


def constant_models(
    base: Fit, found: Sequence[Product], library: Library, limit: float = np.inf
) -> list[ConstantModel]:  # fmt: skip
    """Return a model fitted with single products free, and with all of them, those that explain the records.

    Of single products those are fitted that to first order take away half of what is more than noise.
    limit: chi2 that must be in reach, else a fit is given up.
    """
    if not found:
        return []
    columns = beyond(base.basis, columns_of(found, len(base.residual)))
    drops = (columns.T @ base.residual) ** 2 / (1.0 + np.sum(columns**2, axis=0))
    needed = HALF * (base.chi2 - len(base.residual))
    sets = [[found[i]] for i in np.argsort(-drops, kind="stable")[:MOST] if drops[i] > needed]
    sets += [list(found)] if len(found) > 1 else []
    library.say("fitting the declared model with its constants free within their tolerances")
    models = library.each(unless_diverged, [partial(freed_constants, base, chosen, limit) for chosen in sets])
    return [m for m in models if m is not None and m.explains]


def answer_of_constants(models: Sequence[ConstantModel], named: Fit) -> ConstantModel | None:
    """Return the constants that explain the records as well as a model with effects does, None where none do.

    A single effect that leaves noise and fits clearly better is the answer; sets of effects are not, as enough of them
    imitate everything. Constants are known within tolerances whether or not an effect is there, so that they cost no
    parameters.
    """
    best = min(models, key=lambda m: (len(m.off) > 1, m.chi2), default=None)
    if best is None or len(named.active) != 1 or is_significant(named):
        return best
    return next((m for m in models if m.chi2 < named.chi2 + WITHIN), None)


def is_outdone(constants: ConstantModel, named: Fit, n_candidates: int) -> bool:
    """Tell whether a set of effects leaves noise and does what the constants that explain the records cannot do.

    Noise whose level a short rest tells may hide what they leave; it does not hide how much better a set fits. Of
    constants that are far off it is asked only to fit better.
    """
    n = len(named.active)
    if n < 2 or is_significant(named):
        return False
    if constants.is_stretched:
        return named.chi2 < constants.chi2
    # What is left out of a fit is no test: the constants stay as all records have them.
    return compare(constants.fit, named, n_candidates**n, n_extra=n).fits_better


def constants_beside(models: Sequence[ConstantModel]) -> tuple[str, ...]:
    """Return the names of the constants that explain what an effect does, single products before all."""
    single = [m for m in models if len(m.off) == 1]
    return tuple(dict.fromkeys(n for m in single or models for n in m.moved))


def measurements(models: Sequence[ConstantModel]) -> list[str]:
    """Return which constants to measure, and how well, to tell whether they are what the records show."""
    said = []
    for model in models[:MOST_TOLD]:
        pairs = zip(model.off, model.fit.constants.values(), strict=True)
        shares = {n.removeprefix(NAMED): share for n, share in pairs if n in model.moved}
        largest = sorted(shares.items(), key=lambda pair: -abs(pair[1]))[:MOST_TOLD]
        said += [f"Measure {name} to {abs(share) / SURE:.1%}: off by {share:+.1%}, it would explain these records"
                 f"{'' if len(model.off) == 1 else ' together with others'}." for name, share in largest]  # fmt: skip
    return list(dict.fromkeys(said))


def group_beside(constants: ConstantModel, search: Search) -> EffectGroup:
    """Return the constants with the single effects that do as well, none where they are too many to say anything."""
    fits = [f for f in search.of_size(1) if f.chi2 < constants.chi2 + WITHIN]
    near = tuple(dict.fromkeys(f.active[0].public for f in fits))
    return EffectGroup(constants.name, near if len(near) < TOO_MANY else ())


def known_together(fit: Fit, library: Library) -> tuple[str, ...]:
    """Return in words which parameters of the declared model and constants the records give only together.

    What the free strengths of effects make up for counts as unseen.
    """
    own, strengths = {}, [np.zeros(len(fit.residual))]
    for name, value in fit.values.items():
        owner = library.owner(name)
        if owner is None:
            own[name] = slope(fit, fit.records, name, value)
        elif owner.name.startswith(ROUGHLY):
            own[owner.name.removeprefix(ROUGHLY)] = slope(fit, fit.records, name, 1.0 + value)
        else:
            strengths.append(slope(fit, fit.records, name, value))
    for key in library.candidates:
        if key.name.startswith(ROUGHLY) and key not in fit.active:
            records = library.problem((*fit.active, key), fit.values)
            pairs = zip(records.replays, fit.records.replays, strict=True)
            there = replace(records, replays=tuple(replace(r, pieces=at.pieces) for r, at in pairs))
            own[key.name.removeprefix(ROUGHLY)] = slope(fit, there, f"{key.compiled}.error", 1.0)
    if not own:
        return ()
    basis, _ = decomposed(np.column_stack(strengths))
    found = [replace(p, slope=beyond(basis, p.slope)) for p in fit.products(library.tolerances)]
    return common_factors(tuple(own), beyond(basis, np.column_stack([*own.values()])), found)


def slope(fit: Fit, records: WhiteRecords, name: str, size: float) -> Array:
    """Return the change of the whitened signal by a parameter, its size taken as 1, about a fit, (n_samples,)."""
    both = np.tile(candidate_at(records, fit.values), (2, 1))
    both[:, records.space.index(name)] += np.array([STEP, -STEP]) * size
    upper, lower = replace(records, data=fit.records.data).whole_signals(both)
    return np.asarray((upper - lower) / (2.0 * STEP))


@dataclass(frozen=True, eq=False)
class Trend:
    """Hold a model with a parameter, or a product of constants, that changes in proportion to the order of the files.

    fit: to the records without the trend, as in the middle of the campaign. moves: see `trends_of`. value: by how much
    it is larger in the last file than in the first, a share of the range or of the constant. chi2: as of `Mended`.
    """

    fit: Fit
    moves: int | Product
    value: float
    deviation: float
    chi2: float

    def name(self, library: Library) -> str:
        if isinstance(self.moves, Product):
            return self.moves.public
        name = self.fit.records.space.free_names[self.moves]
        owner = library.owner(name)
        return name if owner is None else f"{owner.public}.{name.partition('.')[2]}"

    def suspect(self, others: Sequence["Trend"], library: Library) -> Suspect:
        """Return what is told of it; others: whose trend does as well."""
        records, unit, size = self.fit.records, "1", 1.0
        if not isinstance(self.moves, Product):
            free = records.space.free_names[self.moves]
            unit, size = records.model.parameters[free].unit, float(records.span[self.moves])
        last, half = records.data.records[-1], NORMAL_95 * self.deviation
        names = ", ".join(t.name(library) for t in (self, *others))
        return Suspect(last.file, last.role, "trend", FREED, size * self.value, unit, size * (self.value - half),
                       size * (self.value + half), parameter=names)  # fmt: skip

    @property
    def column(self) -> Array:
        """What the largest plausible trend does to the whitened signal, (n_samples,)."""
        return FARTHEST_TREND * slope_of(self.fit, self.moves) * order_of(self.fit.records)

    def undone(self, train: Sequence[Record]) -> tuple[Record, ...]:
        measured = iter([[p.measured for p in r.pieces] for r in self.fit.records.replays])
        found = []
        for record in train:
            each = []
            for one in record.each:
                pieces = [replace(p, measured=np.concatenate([x, p.measured[len(x) :]]))
                          for p, x in zip(one.pieces, next(measured), strict=True)]  # fmt: skip
                each.append(replace(one, pieces=tuple(pieces)))
            found.append(replace(each[0], others=tuple(each[1:])))
        return tuple(found)


def trends_of(fit: Fit, library: Library) -> list[Trend]:
    """Return a model with a trend of one of its parameters, or of constants, those that leave noise, the best first.

    What moves is the place of a free parameter, or a product of constants.
    """
    if len({r.file for r in fit.records.data.records}) < FEWEST_FOR_TREND:
        return []
    base, worth = order_of(fit.records), NEARLY * (fit.chi2 - len(fit.residual))
    tried: list[tuple[float, int | Product]] = []
    for moves in (*range(fit.n_free), *fit.products(library.tolerances)):
        column = beyond(fit.basis, slope_of(fit, moves) * base)
        square = float(column @ column) + FARTHEST_TREND**-2.0
        tried.append((float(column @ fit.residual) ** 2 / square, moves))
    sized = [moves for drop, moves in sorted(tried, key=lambda t: -t[0]) if drop > worth][:MOST]
    found = library.each(lambda moves: unless_diverged(lambda: with_trend(fit, moves)), sized)
    good = [t for t in found if t is not None and is_earned(fit, t.fit, t.chi2, len(tried))
            and not is_significant(t.fit)]  # fmt: skip
    return sorted(good, key=lambda t: t.chi2)


def slope_of(fit: Fit, moves: int | Product) -> Array:
    return moves.slope if isinstance(moves, Product) else np.asarray(fit.jacobian[:, moves])


def with_trend(start: Fit, moves: int | Product) -> Trend:
    """Fit a model and a trend together, by Gauss-Newton steps.

    Raises ArmidError where the simulation diverges, and for a trend beyond reason.
    """
    base, fit, value, square = start.records, start, 0.0, 1.0
    for step_number in range(N_STEPS):
        column = beyond(fit.basis, slope_of(fit, moves) * order_of(base))
        square = float(column @ column) + FARTHEST_TREND**-2.0
        step = (float(column @ fit.residual) - value / FARTHEST_TREND**2) / square
        value += step
        if abs(value) > FARTHEST_TREND or (step_number > 1 and fit.chi2 > IN_REACH * len(fit.residual)):
            raise ArmidError("a trend beyond reason, or far from noise, is none")
        fit = with_own_starts(fit_from(without_trend(base, fit.z, moves, value), start.active, [fit.z]))
        if abs(step) * np.sqrt(square) < 0.1:
            break
    return Trend(fit, moves, value, square**-0.5, fit.chi2 + (value / FARTHEST_TREND) ** 2)


def without_trend(base: WhiteRecords, z: Array, moves: int | Product, value: float) -> WhiteRecords:
    """Return a problem whose records were measured as in the middle of the campaign, by what the model says of it."""
    files, found = list(dict.fromkeys(r.file for r in base.data.records)), base
    for place, file in enumerate(files):
        index = next(i for i, r in enumerate(base.data.records) if r.file == file)
        share, there, at = value * (place / (len(files) - 1.0) - 0.5), base, z
        if isinstance(moves, Product):
            there = replace(base, replays=moved_replays(base.replays, {moves.names[0]: share}))
        else:
            at = np.where(np.arange(len(z)) == moves, z + share, z)
        pairs = zip(simulated_file(base, index, z), simulated_file(there, index, at), strict=True)
        found = with_measured(found, index, [x - y for x, y in pairs])
    return found
