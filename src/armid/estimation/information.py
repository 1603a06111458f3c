"""How well records pin down parameters: sensitivities, Fisher information, intervals, correlations."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armid.engine import simulate
from armid.estimation.least_squares import LEAST, LeastSquaresProblem, WeightedRecords, step_in_box
from armid.estimation.noise_model import Level, level_of, level_weights
from armid.model import Array
from armid.problem.problem import Replay, by_record
from armid.problem.space import Space

NORMAL_95 = 1.959963984540054
# Directions whose information is below this share of the strongest is rounding.
SINGULAR = 1e-13
# Parameters of a larger correlation than this are hardly separated.
CORRELATED = 0.95


@dataclass(frozen=True)
class Information:
    """What the records say about the free parameters at one candidate.

    deviation: standard deviation of each, SI, (n_free,), infinite where the records do not determine it. correlation:
    of the estimates, (n_free, n_free), NaN where not determined. step: how far a least-squares step inside the box
    would move each parameter, in standard deviations: far above 1 where a search has not come to the minimum. fisher:
    information matrix of the parameters in shares of their range, weighed with 1 where a record has no noise.
    """

    names: tuple[str, ...]
    deviation: Array
    correlation: Array
    levels: tuple[Level, ...]
    step: Array
    fisher: Array

    @property
    def half_width(self) -> Array:
        """Half of the 95 % interval, SI."""
        return NORMAL_95 * self.deviation


def information_at(
    replays: tuple[Replay, ...], space: Space, x: Array, levels: tuple[Level, ...] | None = None,
    weights: Sequence[float] | None = None,
) -> Information:  # fmt: skip
    """Return intervals and correlations at a candidate, from the sensitivities and the measured noise.

    Fisher information F = sum over records of f J^T J / level^2 with f the share of samples that are independent;
    covariance = F^-1 (the Cramer-Rao bound of an unbiased estimate). The level is the noise, or the residual where that
    is far above it. A record without noise and without residual gives an interval of width 0. Where records start from
    a measured state, what its noise does to the estimate is added (see `start_changes`).

    Parameters
    ----------
    replays, space
        The records, ready to be simulated, and the box.
    x : array, SI, (n_free,)
        Free parameters.
    levels : tuple of Level
        One for each record; None: as measured, see `level_of`.
    weights : sequence of float
        What the residual of each record weighs in the sum of squares that was minimised, where that is not its level:
        with W their squares and G = J^T W J the covariance is then G^-1 J^T W S W J G^-1, S that of the noise.

    Returns
    -------
    Information
    """
    levels = tuple(level_of(r, space, x) for r in replays) if levels is None else levels
    noise_free = any(level.rms == 0.0 for level in levels)
    records = WeightedRecords(replays, space, (1.0,) * len(replays) if noise_free else level_weights(levels))
    ratios = np.ones(len(replays)) if weights is None or noise_free else np.divide(weights, level_weights(levels))
    others = np.ptp(ratios) > 1e-9 * ratios.max()
    squares = np.repeat((ratios / ratios.max()) ** 2, [r.record.n_samples for r in replays]) if others else None
    information = replace(information_of(records, records.shares(x), weighed=squares), levels=levels)
    if not noise_free:
        return information
    shown = np.where(np.isfinite(information.deviation), 0.0, information.deviation)
    return replace(information, deviation=shown, step=np.zeros(len(x)))


def information_of(
    records: LeastSquaresProblem, z: Array, trust: Array | None = None, doubts: Array | None = None,
    weighed: Array | None = None,
) -> Information:  # fmt: skip
    """Return intervals and correlations at a candidate, in shares of the range, from the weights of a problem.

    trust: 1 for each sample whose residual is noise, below it where the residual is larger, (n_samples,). doubts: what
    one standard deviation of each further unknown does to the weighted signal, (n_samples, n_doubts); the estimate is
    then one of all together. weighed: what each square weighs in the estimate, times its weight here, (n_samples,);
    None: all alike.
    """
    residual, jacobian = records.residual_and_slopes(z)
    rows = np.ones(len(residual)) if trust is None else np.sqrt(trust)
    residual, jacobian = rows * residual, rows[:, np.newaxis] * jacobian
    total = jacobian.T @ jacobian
    if doubts is not None and doubts.shape[1]:
        others = rows[:, np.newaxis] * doubts
        mixed = others.T @ jacobian
        total = total - mixed.T @ np.linalg.solve(np.eye(others.shape[1]) + others.T @ others, mixed)
    # towards the estimate; of weights that are not those of the noise, doubts are not asked
    towards = jacobian if weighed is None else weighed[:, np.newaxis] * jacobian
    own = total if weighed is None else towards.T @ jacobian
    covariance = inverse(own)
    known = np.isfinite(covariance)
    determined = np.where(known, covariance, 0.0)
    if weighed is not None:
        covariance = np.where(known, determined @ (towards.T @ towards) @ determined, covariance)
    # what the box holds is held, and the others make up for that
    step = step_in_box(own, towards.T @ residual, z, LEAST) - z
    started = np.array([towards.T @ (rows * change) for change in start_changes(records, z)])
    started = started.reshape(len(started), len(z))
    covariance = covariance + determined @ (started.T @ started) @ determined
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(deviation, deviation)
        steps = step / deviation
    correlation[~np.isfinite(correlation)] = np.nan
    return Information(records.space.free_names, deviation * records.span, correlation, (), steps, total)


def sensitivities(replay: Replay, space: Space, x: Array) -> Array:
    """Return d signal / d parameter x range in the windows of a record.

    Central differences with steps of 1e-4 of the range, moved inside the box where they would leave it; all perturbed
    candidates run as one population.

    Parameters
    ----------
    replay, space
        The record, ready to be simulated, and the box.
    x : array, SI, (n_free,)
        Free parameters.

    Returns
    -------
    array, signal's unit, (n_samples, n_free)
    """
    records = WeightedRecords((replay,), space, (1.0,))
    return records.residual_and_slopes(records.shares(x))[1]


def start_changes(records: LeastSquaresProblem, z: Array, bent: bool = False) -> Iterator[Array]:
    """Yield what one standard deviation of each measured start constant does to the weighted signal, (n_samples,).

    bent: yield half the second difference after each slope. Near an unstable rest the slope alone is too small a
    doubt (Julier, Uhlmann 2004, doi:10.1109/JPROC.2003.823141).
    """
    candidate = records.whole(z[np.newaxis])
    for ready, outputs in by_record(records.replays).items():
        for index, (piece, calibration) in enumerate(zip(ready.record.pieces, ready.calibrations, strict=True)):
            for name, deviation in ({} if piece.shown_start else piece.start_deviation).items():
                start = piece.manoeuvre.constants.get(name, 0.0)
                moves = (deviation, -deviation, 0.0) if bent else (deviation, -deviation)
                above, below, *at = (
                    simulate(ready.model, piece.with_constants({name: start + move}).manoeuvre, candidate,
                             calibration.schedule).outputs[:, 0] for move in moves
                )  # fmt: skip
                yield change_of_piece(records, outputs, index, 0.5 * (above - below))
                for same in at:
                    yield change_of_piece(records, outputs, index, 0.5 * (above + below) - same)


def change_of_piece(
    records: LeastSquaresProblem, outputs: Sequence[Replay], index: int, response: Array
) -> Array:  # fmt: skip
    """Return the change of the weighted signal where one piece of one record changes, (n_samples,).

    outputs: of that record. index: of the piece. response: change of its outputs, (n_outputs, n_times).
    """
    changes = [np.zeros(r.record.n_samples) for r in records.replays]
    for change, r in zip(changes, records.replays, strict=True):
        if r in outputs:
            first = sum(r.record.lengths[:index])
            change[first : first + r.record.lengths[index]] = response[r.place, r.record.samples[index]]
    return records.weighted(changes)


def inverse(matrix: Array) -> Array:
    scaled, seen = normalised(matrix)
    result = np.full(matrix.shape, np.nan)
    np.fill_diagonal(result, np.inf)
    if not seen.any():
        return result
    values, vectors = np.linalg.eigh(scaled)
    good = values > SINGULAR * values.max()
    part = (vectors[:, good] / values[good]) @ vectors[:, good].T
    lost = (vectors[:, ~good] ** 2).sum(axis=1) > 1e-6
    scale = np.sqrt(np.diag(matrix)[seen])
    part /= np.outer(scale, scale)
    part[lost, :], part[:, lost] = np.nan, np.nan
    part[lost, lost] = np.inf
    result[np.ix_(seen, seen)] = part
    return result


def normalised(matrix: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the information matrix of the parameters that are seen, its diagonal scaled to 1, and which they are."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    seen = np.isfinite(scale) & (scale > 0.0)
    return np.asarray(matrix[np.ix_(seen, seen)] / np.outer(scale[seen], scale[seen])), seen


def collinear(information: Information) -> list[tuple[str, str, float]]:
    """Return the pairs of parameters that the records hardly separate, strongest first: names and correlation."""
    names, correlation = information.names, information.correlation
    pairs = [(names[i], names[j], float(correlation[i, j])) for i in range(len(names)) for j in range(i)]
    return sorted((pair for pair in pairs if abs(pair[2]) > CORRELATED), key=lambda pair: -abs(pair[2]))
