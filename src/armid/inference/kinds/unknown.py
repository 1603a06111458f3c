"""A signal without a form at a port: a Gaussian process in time, or over one variable of the motion.

What no effect of the library explains has a covariance of its own (Kennedy, O'Hagan 2001,
doi:10.1111/1467-9868.00294): intervals count it, and no name is read off what it covers.
"""

from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from scipy.linalg import block_diag

from armid.inference.decisions import calibration
from armid.inference.evidence import Expansion, Forecast
from armid.inference.kinds.hypothesis import Hypothesis, Proposal
from armid.inference.kinds.missing_signal import Segment, segments_about
from armid.inference.library import Library
from armid.inference.model import Fit, fit_from, unless_diverged
from armid.inference.unknowns import Freed, freed
from armid.inference.whitening import WhiteRecords
from armid.model import Array
from armid.problem.cover import Cover

# Prior deviations: rms by which the signal moves all records, in units of the noise.
SCALES_OF_SIGNAL = np.array([0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0])
# Lengths over which the signal forgets, as shares of the median duration of a piece; of a curve, of its range.
LENGTHS, LENGTH_OF_CURVE = (0.07, 0.2), 0.25
OVER_TIME = "time"
# Columns of a curve, knots under it, and the most columns of one piece in time.
N_CURVE, N_KNOTS, MOST_IN_TIME = 6, 10, 20


@dataclass(frozen=True, eq=False)
class Signals:
    """Hold the columns of every signal without a form about one fit: (port, variable) -> (n_samples, n)."""

    columns: dict[tuple[str, str], Array]


@lru_cache(maxsize=4)
def signals_without_form(fit: Fit, library: Library, port: str = "") -> Signals:
    """Return the columns of signals at a port, "" for all, scaled so that each moves all records by the noise rms.

    Each port costs a simulation for every knot of every piece.
    """
    records, n = fit.records, len(fit.residual)
    segments = segments_about(records, fit.values, library, port)
    if sum(len(s.residual) for s in segments) != n:
        return Signals({})
    level = np.repeat([level.rms for level in records.data.levels], [sum(lengths) for lengths in records.data.lengths])
    order = places_of(segments, fit)

    def white(column: Array) -> Array:
        placed = np.empty_like(column)
        placed[order] = column
        parts = records.data.by_record((placed * level[:, np.newaxis]).T)
        return replace(records.data, cover=None).white(parts).T

    columns: dict[tuple[str, str], Array] = {}
    duration = float(np.median([s.knots[-1] - s.knots[0] for s in segments]))
    for place in segments[0].gains:
        for share in LENGTHS:
            columns[place, f"{OVER_TIME} ({share:g} of a record)"] = white(block_diag(*(
                s.gains[place] @ process(s.knots, share * duration, MOST_IN_TIME) for s in segments)))  # fmt: skip
        for variable in segments[0].variables:
            for factor in segments[0].factors:
                if variable not in (factor, OVER_TIME):
                    name = variable if factor == "1" else f"{variable} x {factor}"
                    columns[place, name] = white(over_variable(segments, place, variable, factor))
    sizes = {key: float(np.sqrt(np.sum(column**2) / n)) for key, column in columns.items()}
    return Signals({key: column / sizes[key] for key, column in columns.items()
                    if np.isfinite(sizes[key]) and sizes[key] > 0.0})  # fmt: skip


def places_of(segments: list[Segment], fit: Fit) -> Array:
    """Return where the samples of the segments, outputs of a piece one behind the other, stand in the residual."""
    data = fit.records.data
    start = {replay: int(edge) for replay, edge in zip(fit.records.replays, data.edges, strict=False)}
    places = []
    for segment in segments:
        for replay in segment.replays:
            first = start[replay] + sum(replay.record.lengths[: segment.index])
            places.append(first + np.arange(replay.record.lengths[segment.index]))
    return np.concatenate(places)


def process(times: Array, length: float, most: int) -> Array:
    """Return the leading columns of a smooth Gaussian process at some times, (n_times, n)."""
    kernel = np.exp(-0.5 * ((times[:, np.newaxis] - times) / length) ** 2)
    values, vectors = np.linalg.eigh(kernel)
    n = min(most, int(1.6 * (times[-1] - times[0]) / length) + 4, len(times))
    return np.asarray(vectors[:, -n:] * np.sqrt(np.maximum(values[-n:], 0.0)))


def over_variable(segments: list[Segment], port: str, variable: str, factor: str) -> Array:
    """Return the columns of a curve over a variable of the motion, (n_samples, n)."""
    values = np.concatenate([s.variables[variable] for s in segments])
    low, high = float(values.min()), float(values.max())
    curve = process(np.linspace(0.0, 1.0, N_KNOTS), LENGTH_OF_CURVE, N_CURVE)
    columns = []
    for s in segments:
        place = np.clip((s.variables[variable] - low) / (high - low), 0.0, 1.0) * (N_KNOTS - 1)
        hats = np.maximum(0.0, 1.0 - np.abs(place[:, np.newaxis] - np.arange(N_KNOTS)))
        columns.append(s.gains[port] @ (hats * s.factors[factor][:, np.newaxis]) @ curve)
    return np.concatenate(columns)


def propose(fit: Fit, library: Library) -> list[Proposal]:
    """Return a signal without a form at each port, in time and over each variable."""
    if fit.records.data.cover is not None:
        return []
    known = signals_without_form(fit, library).columns
    return [
        Proposal(Hypothesis("unknown", port, variable, calibration().log_odds("unknown", len(known)), (port, variable)),
                 column.T, SCALES_OF_SIGNAL, np.zeros(1), partial(refit, library, (port, variable)), joint=True)
        for (port, variable), column in known.items()
    ]  # fmt: skip


def refit(
    library: Library, which: tuple[str, str], fit: Fit, about: Expansion, ahead: Forecast, limit: float
) -> Fit | None:
    """Return the model with a signal without a form: fitted with its covariance, taken about its own estimate.

    None where it diverges, or where even so more than a limit is left.
    """
    again, scale = fit, ahead.best(1)[0][1]
    for port in ("", which[0]):
        columns = signals_without_form(without_cover(again), library, port).columns.get(which)
        if columns is None:
            return None
        cover = Cover.of(scale * columns)
        problem = with_cover(again, cover)
        tried = unless_diverged(lambda: fitted(problem, fit.others, about.scale.weight))  # noqa: B023
        if tried is None or tried.chi2 > limit:
            return None
        again = tried
    # The likeliest variable is a guess, and by a wrong one a model with wrong parameters can leave noise alone: its
    # variance once more, spread evenly over the curves of all variables at all ports.
    known = signals_without_form(fit, library).columns
    curves = [column for (_, variable), column in known.items() if not variable.startswith(OVER_TIME)]
    if not curves:
        return again
    return with_cover(again, cover.with_elsewhere(scale / np.sqrt(len(curves)) * np.hstack(curves)))


def without_cover(fit: Fit) -> Fit:
    """Return a fit whose records have no covariance but the noise's; itself where they have none."""
    return fit if fit.records.data.cover is None else with_cover(fit, None)


def with_cover(fit: Fit, cover: Cover | None) -> Fit:
    """Return a fit whose records have another covariance, not fitted to it yet."""

    def covered(records: WhiteRecords) -> WhiteRecords:
        return replace(records, data=replace(records.data, cover=cover))

    return replace(fit, records=covered(fit.records), base=None if fit.base is None else covered(fit.base))


def fitted(fit: Fit, others: tuple[Freed, ...], weight: float) -> Fit:
    """Return a fit brought to its estimate, its further unknowns free: under a covariance they do something else.

    others: with columns that no covariance has changed.
    """
    cover = fit.records.data.cover
    if fit.base is None or cover is None:
        return fit_from(fit.records, fit.active, [fit.z])
    changed = tuple(replace(now, column=cover.white(f.column)) for now, f in zip(fit.others, others, strict=True))
    return freed(replace(fit, others=changed), fit.base, [f.unknown for f in others], weight)
