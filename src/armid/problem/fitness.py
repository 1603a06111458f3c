"""What a fitness is: a number per candidate to minimise, and how the records of a campaign join.

No temporary of the population's size is made. A candidate that holds a NaN or an infinity gets +inf. What is compiled
stands in similarity.py and is imported at the first comparison: fitnesses are named and listed without the compiler.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armid.errors import ArmidError, nearest, nearest_registered
from armid.model import Array, Catalogue

SERIES = ("measured", "simulated")
OF_RECORD = ("interval", "noise")
JOINS = ("duration", "samples", "sum")


@dataclass(frozen=True)
class Fitness:
    """Declare how far a candidate is from a measurement; smaller is better.

    name: as studies spell it.
    function: takes `measured` (n_samples,), `simulated` (n_candidates, n_samples), and where it names them `interval`
        (sample interval [s]) and `noise` (noise rms [signal's unit]) of the record; returns one value per candidate.
    join: how records join: "duration" (mean weighted by duration), "samples" (by number of samples), "sum".
    finish: applied to the joined values, such as a square root; None: nothing.
    weigh: noise rms of a record [signal's unit] -> weight w of its residual, where the finished value is a rising
        function of sum w^2 (x - x')^2 over all samples of all records; None: it has no such form.
    unit: of the finished value; note: what it is, in words. output: the one that it looks at, "" for all, each divided
    by its noise.
    Raises ArmidError for a function that is not a fitness or asks for something unknown, and for an unknown join.
    """

    name: str
    function: Callable[..., Any]
    join: str = "duration"
    finish: Callable[[Array], Array] | None = None
    unit: str = "1"
    note: str = ""
    weigh: Callable[[float], float] | None = None
    output: str = ""
    asks: tuple[str, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.join not in JOINS:
            raise ArmidError(f"fitness '{self.name}' joins records by '{self.join}', {nearest(self.join, JOINS)}")
        object.__setattr__(self, "asks", argument_names(self.name, self.function))

    def __call__(
        self, measured: ArrayLike, simulated: ArrayLike, interval: float | None = None, noise: float | None = None
    ) -> Array:
        """Return the value of each candidate on one record, (n_candidates,), +inf where it has none; not finished yet.

        measured: signal's unit, (n_samples,); simulated: signal's unit, (n_candidates, n_samples).
        interval: [s]; noise: [signal's unit]; needed when the function asks for them.
        Raises ArmidError when one is missing and when the function returns anything but one number per candidate.
        """
        from armid.problem.similarity import as_series, has_failed

        x, rows = as_series(measured, simulated)
        given = {"measured": x, "simulated": rows, "interval": interval, "noise": noise}
        for name in self.asks:
            if given[name] is None:
                raise ArmidError(f"fitness '{self.name}' asks for the {name} of the record, which is not known")
        returned = self.function(**{name: given[name] for name in self.asks})
        try:
            values = np.asarray(returned, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ArmidError(f"fitness '{self.name}' returned a {type(returned).__name__}, expected numbers") from error
        if values.shape != (len(rows),):
            raise ArmidError(f"fitness '{self.name}' returned shape {values.shape}, expected ({len(rows)},)")
        return finite_or_inf(values, has_failed(rows))

    def weight_of(self, noise: float) -> float:
        """Return the weight of a record's residual for a least-squares method.

        noise: rms of the record [signal's unit]. Raises ArmidError when the fitness is not a sum of squares.
        """
        if self.weigh is None:
            raise ArmidError(f"fitness '{self.name}' is not a sum of squares, least squares expects rmse or likelihood")
        return self.weigh(noise)


def fitness_of_name(name: str, known: Mapping[str, Fitness]) -> Fitness:
    """Return the fitness of a name, or of a name and an output: `rmse:hub_angle`."""
    first, _, output = name.partition(":")
    if first not in known:
        raise ArmidError(f"fitness '{first}' is not known: {nearest_registered(first, known)}")
    return replace(known[first], name=name, output=output) if output else known[first]


def argument_names(name: str, function: Callable[..., Any]) -> tuple[str, ...]:
    """Return what a function asks of a record; refuse what a record cannot give.

    An argument with a default is the function's own option, unless its name looks like a misspelt one of a record.
    """
    if not callable(function):
        raise ArmidError(f"fitness '{name}' is {function!r}, expected a function of (measured, simulated)")
    try:
        parameters = inspect.signature(function).parameters
    except ValueError as error:
        raise ArmidError(f"fitness '{name}' does not tell its arguments, expected (measured, simulated)") from error
    known = SERIES + OF_RECORD
    for argument, parameter in parameters.items():
        optional = parameter.default is not parameter.empty
        own = optional and argument not in known and not get_close_matches(argument, known)
        bindable = argument in known and parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
        if not (own or bindable):
            raise ArmidError(f"fitness '{name}' asks for '{argument}', {nearest(argument, known)}")
    for series in SERIES:
        if series not in parameters:
            raise ArmidError(f"fitness '{name}' has no argument '{series}', expected (measured, simulated)")
    return tuple(argument for argument in parameters if argument in known)


def finite_or_inf(values: Array, failed: NDArray[np.bool_]) -> Array:
    good = np.isfinite(values) & ~failed
    return values if good.all() else np.where(good, values, np.inf)


def joined(fitness: Fitness, table: Array, weight: Array) -> Array:
    """Join the values of records, (n_records, n_candidates): one for each candidate, +inf if a record failed."""
    failed = ~np.asarray(np.isfinite(table).all(axis=0))
    known = np.where(failed, 0.0, table) if failed.any() else table
    # no matrix product: its rounding of one candidate may depend on how many others there are
    total = (weight[:, np.newaxis] * known).sum(axis=0)
    mean = total if fitness.join == "sum" else total / weight.sum()
    return finite_or_inf(mean if fitness.finish is None else fitness.finish(mean), failed)


def as_fitness(name: str, obj: Fitness | Callable[..., Any]) -> Fitness:
    return obj if isinstance(obj, Fitness) else Fitness(name, obj, note="a function of the user")


def square_sums(measured: ArrayLike, simulated: ArrayLike) -> Array:
    """Return the sum of (x - x')^2 [signal's unit squared], (n_candidates,)."""
    from armid.problem.similarity import as_series, sums_of_squares

    return np.asarray(sums_of_squares(*as_series(measured, simulated)))


def mean_square(measured: ArrayLike, simulated: ArrayLike) -> Array:
    return square_sums(measured, simulated) / np.size(measured)


def relative_mean_square(measured: ArrayLike, simulated: ArrayLike) -> Array:
    sums, total = square_sums(measured, simulated), float(np.square(measured).sum())
    if total == 0.0:
        raise ArmidError("the measured series is zero throughout, expected an rms above 0 to divide by")
    return sums / total


def chi_square(measured: ArrayLike, simulated: ArrayLike, noise: float) -> Array:
    """Return the sum of (x - x')^2 / noise^2, (n_candidates,): -2 log likelihood for white noise, up to a constant."""
    return inverse_noise(noise) ** 2 * square_sums(measured, simulated)


def inverse_noise(noise: float) -> float:
    if not 0.0 < noise < np.inf:
        raise ArmidError(f"the noise of the record is {noise}, expected an rms above 0 in the signal's unit")
    return 1.0 / noise


def mean_absolute(measured: Array, simulated: Array) -> Array:
    """Return the mean of |x - x'| [signal's unit], (n_candidates,)."""
    return np.asarray(np.abs(simulated - measured).mean(axis=1))


def huber(measured: Array, simulated: Array, noise: float, delta: float = 1.345) -> Array:
    """Return the mean of Huber's loss, (n_candidates,): r^2/2 below delta, linear above, r = (x - x')/noise.

    delta: in units of the noise; 1.345 loses 5 % of the efficiency of least squares under normal noise.
    """
    size = np.abs(simulated - measured) * inverse_noise(noise)
    inner = np.minimum(size, delta)
    return np.asarray((inner * (size - 0.5 * inner)).mean(axis=1))


def spectral_mean_square(measured: Array, simulated: Array) -> Array:
    """Return the mean square difference of amplitude spectra [signal's unit squared], (n_candidates,).

    A spectrum is that of the whole series under Hann's window; a sine has its amplitude there, whatever its phase.
    """
    window = np.hanning(measured.size + 2)[1:-1]
    scale = 2.0 / window.sum()
    own, others = (scale * np.abs(np.fft.rfft(window * series)) for series in (measured, simulated))
    return np.asarray(((own - others) ** 2).mean(axis=1))


def warped_mean_square(measured: Array, simulated: Array, interval: float, reach: float = 0.02) -> Array:
    """Return the least sum of (x - x')^2 over paths of dynamic time warping, per sample, (n_candidates,).

    reach: how far samples may be paired in time [s]. Raises ArmidError without the package dtaidistance.
    """
    from armid.problem.similarity import has_failed

    try:
        from dtaidistance.dtw import distance_fast
    except ImportError as error:
        raise ArmidError('fitness \'dtw\' needs the package dtaidistance, which is not installed: pip install '
                         '"armid[dtw]" is expected') from error  # fmt: skip
    window = 1 + round(reach / interval)
    # a row that is not finite has no path; pruning loses a path along the diagonal to rounding
    rows = [np.inf if failed else distance_fast(measured, row, window=window, use_pruning=False) ** 2
            for row, failed in zip(simulated, has_failed(simulated), strict=True)]  # fmt: skip
    return np.array(rows) / measured.size


def unity(noise: float) -> float:
    return 1.0


def dissimilarity(measured: ArrayLike, simulated: ArrayLike, interval: float, degree: int = 0) -> Array:
    """Return 1 - S of Eq 10 per candidate, +inf for one that is not finite; degree 2: 1 - S2 of Eq 14, in steps."""
    from armid.problem.similarity import similarity

    return 1.0 - similarity(measured, simulated, interval, failed=-np.inf)[degree]


shape_dissimilarity = partial(dissimilarity, degree=2)


def numerical_dissimilarity(measured: ArrayLike, simulated: ArrayLike) -> Array:
    """Return 1 - S1 of Eq 13 per candidate, +inf for one that is not finite; errors as `numerical_similarity`."""
    from armid.problem.similarity import numerical_similarity

    return 1.0 - numerical_similarity(measured, simulated, failed=-np.inf)


# Those whose value is 1 minus a degree that people know.
SIMILARITIES = ("similarity", "numerical_similarity", "shape_similarity")

_FITNESSES = (
    Fitness("similarity", dissimilarity, "duration", note="1 - S, the paper's similarity degree (Eq 10)"),
    Fitness("numerical_similarity", numerical_dissimilarity, "duration", note="1 - S1, its numerical part (Eq 13)"),
    Fitness("shape_similarity", shape_dissimilarity, "duration", note="1 - S2, its shape part (Eq 14), in steps"),
    Fitness("rmse", mean_square, "samples", np.sqrt, "signal", "root of the mean square over all samples", unity),
    Fitness("nrmse", relative_mean_square, "samples", np.sqrt, "1", "rmse with each record divided by its own rms"),
    Fitness("likelihood", chi_square, "sum", None, "1", "sum of (x - x')^2 / noise^2: -2 log likelihood, white noise",
            inverse_noise),
    Fitness("mae", mean_absolute, "samples", None, "signal", "mean absolute error over all samples"),
    Fitness("huber", huber, "samples", None, "1", "Huber's loss: square up to 1.345 times the noise, linear above"),
    Fitness("spectrum", spectral_mean_square, "samples", np.sqrt, "signal", "rmse of amplitude spectra, Hann's window"),
    Fitness("dtw", warped_mean_square, "samples", np.sqrt, "signal",
            "rmse after dynamic time warping by at most 0.02 s (extra: armid[dtw])"),
)  # fmt: skip

FITNESS = Catalogue[Fitness]({fitness.name: fitness for fitness in _FITNESSES})
