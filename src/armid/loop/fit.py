"""A model fitted to the train records, and whether a larger one earns its parameters.

That is judged by significance, by a criterion, and by the prediction of what was left out of the fit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from armid.errors import ArmidError
from armid.estimation.design import BOX
from armid.inference.model import Fit, fit_from

Part = NDArray[np.int64]
# Chance at which noise alone gets an effect added, all candidates together.
FAMILYWISE = 1e-3


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
