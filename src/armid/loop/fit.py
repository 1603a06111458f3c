"""A model fitted to the train records, and whether a larger one earns its parameters.

That is judged by significance, by a criterion, and by the prediction of what was left out of the fit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, fdtrc

from armid.errors import ArmidError
from armid.estimation.constants import Product, products
from armid.estimation.design import BOX
from armid.estimation.information import start_changes
from armid.estimation.least_squares import MOST_ROUNDS, SETTLED, descend, held_by_bound, promised_fall
from armid.loop.candidates import Active, EffectKey, calibrated_replays, is_finer, with_finest
from armid.loop.whitening import WhiteRecords
from armid.model import Array, Model
from armid.problem.starts import fits_starts, with_starts

Part = NDArray[np.int64]
# Relative change of the sum of squares at which a fit stops: far below the 1 that means anything in 10,000 samples.
TOLERANCE, ROUGHLY = 1e-7, 1e-3
ONLY_NOISE = 0.01
# An effect is dropped whose strengths would be so far from their nulls by chance.
OPEN = 0.05
# Chance at which noise alone gets an effect added, all candidates together.
FAMILYWISE = 1e-3
# A change of n_eff ln(chi2) that no comparison of two models tells from none.
UNTOLD = 0.5
# A residual of so many times the noise is the model's: then prediction decides and not significance.
DWARFED = 10.0


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold the declared model with some effects at its least-squares estimate.

    active: the effects that were added. records: the least-squares problem. z: free parameters as shares of their
    range, (n_free,). residual: whitened, measured minus simulated, (n_samples,). constants: by how much each differs
    from its declared value, as a share of it; the records hold them so. rough: whether z is near the estimate only.
    """

    active: Active
    records: WhiteRecords
    z: Array
    residual: Array
    constants: Mapping[str, float] = field(default_factory=dict)
    rough: bool = False
    _products: dict[tuple[tuple[str, float], ...], tuple[Product, ...]] = field(default_factory=dict)

    @cached_property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def misfit(self) -> float:
        """Root mean square of the residual in units of the noise, at least 1."""
        return max(1.0, float(np.sqrt(self.chi2 / len(self.residual))))

    @property
    def dwarfs_noise(self) -> bool:
        """Whether it leaves more than ten times the noise."""
        return self.chi2 > DWARFED**2 * len(self.residual)

    @property
    def n_free(self) -> int:
        return len(self.z)

    @property
    def names(self) -> tuple[str, ...]:
        """Public names of the effects."""
        return tuple(key.public for key in self.active)

    @property
    def model(self) -> Model:
        """The compiled model, other candidates at their null included."""
        return self.records.model

    @property
    def x(self) -> Array:
        return self.records.values(self.z)

    @property
    def candidate(self) -> Array:
        return np.asarray(self.records.space.complete(self.x[np.newaxis])[0])

    @property
    def values(self) -> dict[str, float]:
        return dict(zip(self.records.space.free_names, map(float, self.x), strict=True))

    @cached_property
    def independent(self) -> float:
        """How many samples of the residual are independent."""
        return self.records.data.independent(self.residual)

    @property
    def is_noise(self) -> bool:
        """Whether the size of the residual is that of the noise: chi2 per sample not above 1 by chance of 1 %."""
        level, n = self.records.data.levels[0], len(self.residual) - self.n_free
        return level.known and bool(fdtrc(n, level.n_slow, self.chi2 / n) > ONLY_NOISE)

    @cached_property
    def has_arrived(self) -> bool:
        """Whether a further step promises next to nothing of chi2; where that bends sharply, steps only creep."""
        falls = promised_fall(self.jacobian.T @ self.jacobian, self.jacobian.T @ self.residual, self.z)
        return falls <= ROUGHLY * self.chi2

    @property
    def crept(self) -> bool:
        """Whether it holds several named effects and has not arrived: a single one may creep for want of another."""
        return sum(not key.is_empirical for key in self.active) > 1 and not self.has_arrived

    @cached_property
    def jacobian(self) -> Array:
        """Whitened derivatives of the signal by z, (n_samples, n_free); most models of a search are never asked."""
        return self.records.with_all_samples().residual_and_slopes(self.z)[1]

    @cached_property
    def basis(self) -> Array:
        return self._decomposed[0]

    @cached_property
    def answer(self) -> Array:
        """How the free parameters answer to a change of the whitened signal, (n_free, n_samples)."""
        return self._decomposed[1]

    @cached_property
    def _decomposed(self) -> tuple[Array, Array]:
        return decomposed(self.jacobian)

    @cached_property
    def start_slopes(self) -> Array:
        """What one standard deviation of each measured start does to the whitened signal, (n_samples, n_starts).

        Without columns where records start at rest, or where their starts are fitted.
        """
        changes = list(start_changes(self.records.with_all_samples(), self.z))
        return np.column_stack(changes) if changes else np.empty((len(self.residual), 0))

    @property
    def is_at_a_bound(self) -> bool:
        """Whether a bound holds a strength or a shape of one of its effects."""
        held = held_by_bound(self.records.space, self.x)
        return any(bool(held[self.owned_by(key)].any()) for key in self.active)

    def needs(self, key: EffectKey) -> bool:
        """Whether the strengths of one of its effects, all together, are away from their nulls by more than is open.

        A Wald test; a residual that is no noise scatters with its correlation in time, see `WhitenedData.trust`, and
        the estimate with the measured starts.
        """
        space, nulls = self.records.space, [self.model.parameters[n].null for n in self.values]
        places = [i for i, n in enumerate(self.values) if key.owns(n) and nulls[i] is not None]
        null = np.array([nulls[i] for i in places], dtype=np.float64)
        free = np.flatnonzero(space.free)[places]
        away = self.z[places] - (null - space.low[free]) / (space.high[free] - space.low[free])
        weighed = self.jacobian * np.sqrt(self.records.data.trust(self.residual))[:, np.newaxis]
        covariance = np.linalg.inv(weighed.T @ weighed + BOX * np.eye(self.n_free))
        moved = self.answer @ self.start_slopes
        covariance = (covariance + moved @ moved.T)[np.ix_(places, places)]
        return not places or bool(away @ np.linalg.solve(covariance, away) > chdtri(len(places), OPEN))

    def products(self, tolerances: Mapping[str, float]) -> tuple[Product, ...]:
        """Return the constants within tolerances that the records see at the fit, see `products`."""
        known = tuple(tolerances.items())
        if known not in self._products:
            self._products[known] = products(self.records, self.z, tolerances)
        return self._products[known]

    def owned_by(self, key: EffectKey) -> NDArray[np.bool_]:
        return np.array([key.owns(name) for name in self.values], dtype=np.bool_)


def beyond(basis: Array, signals: Array) -> Array:
    """Return what is left of signals, (n_samples,) or (n_samples, n), beyond the reach of an orthonormal basis."""
    return np.asarray(signals - basis @ (basis.T @ signals))


def decomposed(columns: Array) -> tuple[Array, Array]:
    """Return an orthonormal basis of columns, (n_rows, rank), and their pseudoinverse, (n_columns, n_rows).

    Directions below 1e-7 of the largest are rounding.
    """
    scale = np.linalg.norm(columns, axis=0)
    seen = scale > 0.0
    inverse = np.zeros((columns.shape[1], len(columns)))
    if not seen.any():
        return np.empty((len(columns), 0)), inverse
    left, values, right = np.linalg.svd(columns[:, seen] / scale[seen], full_matrices=False)
    good = values > 1e-7 * values[0]
    inverse[seen] = (right[good].T / values[good]) @ left[:, good].T / scale[seen, np.newaxis]
    return np.asarray(left[:, good]), inverse


def fit_from(
    records: WhiteRecords, active: Active, starts: Sequence[Array], rough: bool = False, limit: float = np.inf
) -> Fit:  # fmt: skip
    """Return the best of the least-squares estimates from some starts (shares of the range).

    rough: stop where a step lowers chi2 by less than a thousandth, or where chi2 will not come below the limit.
    The residual is that of all samples, whatever the fit saw.
    Raises ArmidError when every start diverges.
    """
    z = np.empty(0)
    if records.space.free.any():
        tried, tolerance, kept = np.array(starts), ROUGHLY if rough else TOLERANCE, records.data.estimates
        chi2 = records.chi2(tried)
        good = tried[np.isfinite(chi2)]
        if not len(good):
            raise ArmidError("each start of a fit diverged: other bounds are expected")
        make = partial(descend, records, list(good), tolerance, limit=limit)
        z = make() if kept is None else kept.recalled((tried, chi2, tolerance, limit), make)
    return Fit(tuple(active), records, z, records.with_all_samples().residuals(z)[0], rough=rough)


def with_standard_accuracy(fit: Fit) -> Fit:
    """Return a fit about its own starts whose records are simulated on the engine's standard accuracy, or finer."""
    records = fit.records
    standard = calibrated_replays([r.record for r in records.replays], fit.model, records.space, fit.values)
    if not is_finer(standard, records.replays):
        return with_own_starts(fit)
    # The pieces are those of the fit, whose constants may be others than the record's; none is simulated coarser.
    pairs = zip(records.replays, standard, strict=True)
    replays = tuple(with_finest(ours, (theirs, ours)) for ours, theirs in pairs)
    again = fit_from(replace(records, replays=replays), fit.active, [fit.z])
    return with_own_starts(replace(again, constants=fit.constants))


def with_own_starts(fit: Fit, roughly: bool = False) -> Fit:
    """Return a fit about the starts that fit it best, where starts of records are fitted (see problem/starts.py).

    roughly: only as far as a comparison of models can tell, see UNTOLD.
    """
    if not fits_starts(fit.records.replays):
        return fit
    for _ in range(MOST_ROUNDS):
        last, records = fit, replace(fit.records, replays=with_starts(fit.records.replays, fit.candidate))
        fit = replace(fit_from(records, fit.active, [fit.z], rough=roughly), constants=fit.constants, rough=False)
        untold = UNTOLD / fit.independent if roughly else 0.0
        if np.all(np.abs(fit.z - last.z) <= SETTLED) or abs(last.chi2 / fit.chi2 - 1.0) <= max(SETTLED, untold):
            break
    return fit


@dataclass(frozen=True)
class Comparison:
    """Say why a model is preferred to a smaller one, or not.

    gain: fall of the criterion. p: chance of the fall of chi2 from noise alone, corrected for the number of candidates
    and of shapes. left_out: sums of squares on left-out parts, before and after; NaN where gain or p decided already.
    """

    gain: float
    p: float
    left_out: tuple[float, float]

    @property
    def fits_better(self) -> bool:
        """Whether it is significant and cheaper by the criterion, whatever it predicts."""
        return self.p < FAMILYWISE and self.gain > 0.0

    @property
    def why(self) -> str:
        """Which threshold was not reached, in words; "" where all were."""
        if self.p >= FAMILYWISE:
            return f"noise alone would do as much with a chance of {self.p:.2g}; less than {FAMILYWISE:g} is asked for"
        if self.gain <= 0.0:
            return f"the criterion rises by {-self.gain:.3g}; it has to fall"
        if self.left_out[1] > self.left_out[0]:
            share = self.left_out[1] / self.left_out[0] - 1.0
            return f"what was left out of the fit is predicted worse, by {share:.2%} of the sum of squares"
        return ""


def criterion(fit: Fit, independent: float) -> float:
    """Return n_eff ln(chi2) + k ln(n_eff), the Bayesian criterion with effective samples; smaller is better.

    independent: n_eff, the independent samples of the residual of the best model compared. Where that is noise, n_eff
    is n and differences are those of chi2 + k ln n; where structure remains, few samples are independent and
    chi2 counts in proportion to what remains: no term is added for ever to a residual that the library cannot explain.
    """
    return float(independent * np.log(fit.chi2) + fit.n_free * np.log(independent))


def behind(fit: Fit, best: Fit) -> float:
    """Return how much worse than that of another model its criterion is."""
    return criterion(fit, best.independent) - criterion(best, best.independent)


def compare(smaller: Fit, larger: Fit, n_candidates: int = 1, n_shapes: int = 1, n_extra: int = 1) -> Comparison:
    """Judge an addition; the left-out parts are fitted again only where the first two conditions hold.

    n_extra: parameters that the addition costs. Shape parameters mean nothing at the null, so they count as a grid of
    n_shapes that was searched, not as degrees of freedom.
    """
    # What an effect yet to be found leaves is slow in the one model and may be fast in the other: the faster counts.
    n_eff = max(smaller.independent, larger.independent)
    ratio = n_eff * np.log(smaller.chi2 / larger.chi2)
    gain = float(criterion(smaller, n_eff) - criterion(larger, n_eff))
    # The noise of slow signals is known from a rest of so many independent samples, hence F and not chi-square.
    known = larger.records.data.n_noise(otherwise=n_eff)
    p = min(1.0, n_candidates * n_shapes * float(fdtrc(n_extra, known, max(ratio, 0.0) / n_extra)))
    return Comparison(gain, p, (np.nan, np.nan) if p >= FAMILYWISE or gain <= 0.0 else left_out(smaller, larger))


def left_out(smaller: Fit, larger: Fit) -> tuple[float, float]:
    """Return the sums of squares of two models on each manoeuvre (or block of time), left out of the fits in turn.

    Where the misfit dwarfs the noise, records that are alike are left out together, and the worse grouping counts.
    Infinite where a fit without a part diverges on it.
    """
    groupings = larger.records.data.groupings()[1:] if smaller.dwarfs_noise else []
    found = []
    for parts in (parts_to_judge(smaller, larger), *groupings):
        before, after = (float(sum(left_out_part(fit, part) for part in parts)) for fit in (smaller, larger))
        found.append((before, after))
    return max(found, key=lambda pair: pair[1] / pair[0] if np.isfinite(pair[1]) else np.inf)


def predicted_alike(fits: Sequence[Fit]) -> list[Fit]:
    """Return those models that predict what is left out as well as the best, within a standard error, in any grouping.

    Of each group of records: the difference of the sums of squares of two models; its standard error over the groups.
    """
    kept: list[Fit] = []
    first, *others = fits[0].records.data.groupings()
    if len(first) == 2:  # the rest of two may leave parameters undetermined
        first = [block for part in first for block in fits[0].records.data.blocks(part)]
    for parts in (first, *others):
        table = np.array([[left_out_part(fit, part) for part in parts] for fit in fits])
        behind = table - table[int(np.argmin(table.sum(axis=1)))]
        with np.errstate(invalid="ignore"):
            error = np.sqrt(len(parts)) * np.std(behind, axis=1, ddof=1)
        near = (behind.sum(axis=1) <= error) & np.isfinite(table).all(axis=1)
        kept += [f for f, is_near in zip(fits, near, strict=True) if is_near and f not in kept]
    return kept


def parts_to_judge(smaller: Fit, larger: Fit) -> list[Part]:
    """Return what is left out in turn: whole manoeuvres, of those that the others do not determine blocks of time.

    What the others predict of a manoeuvre says nothing of an effect where the parameters that they leave undetermined
    may change that prediction by more than the effect is to explain.
    """
    data = larger.records.data
    whole = data.parts()
    if data.n_manoeuvres < 2:
        return whole
    judged = [data.blocks(part) if is_undetermined(smaller, larger, part) else [part] for part in whole]
    return [part for parts in judged for part in parts]


def is_undetermined(smaller: Fit, larger: Fit, part: Part) -> bool:
    """Tell whether the rest predicts a part with a larger variance than the mean square that it is to explain there."""
    rest = np.delete(larger.jacobian, part, axis=0)
    information = rest.T @ rest + BOX * np.eye(larger.n_free)
    slopes = larger.jacobian[part]
    spread = float(np.mean(np.einsum("ij,ij->i", slopes, np.linalg.solve(information, slopes.T).T)))
    return spread > float(np.mean(smaller.residual[part] ** 2))


def left_out_part(fit: Fit, part: Part) -> float:
    """Return the sum of squares on one part of a fit to the others.

    Shapes that were set free are held where they are: what is asked of the part is the strength. A shape such as the
    period of a sampled control may rest on one record alone, where the time of its switch jumps.
    """
    space, kept = fit.records.space, []
    for name, value in fit.values.items():
        is_freed = any(k.free_shape and k.owns(name) for k in fit.active)
        kept.append(not is_freed or fit.model.parameters[name].fixed is None)
        space = space if kept[-1] else space.with_fixed(name, value)
    records = replace(fit.records, space=space, data=fit.records.data.without(part))
    try:
        again = fit_from(records, fit.active, [fit.z[np.array(kept, dtype=np.bool_)]])
    except ArmidError:
        return float("inf")
    square = float(np.sum(again.residual[part] ** 2))
    return square if np.isfinite(square) else float("inf")
