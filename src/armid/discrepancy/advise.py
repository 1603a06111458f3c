"""Which manoeuvre would tell rival models apart: the record to make next when the ones there are cannot."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from armid.discrepancy.foresee import Forecast, Rival, Whitening, chance, forecasts_of
from armid.discrepancy.rehearse import rehearse
from armid.discrepancy.side_by_side import side_by_side
from armid.identifiability import WeightedRecords
from armid.identifiability.manoeuvres import Feasible, Key, manoeuvre_grid
from armid.model import ArmidError
from armid.simulation import probes

Array = NDArray[np.float64]
Pair = tuple[int, int]
# Difference of the criterion from which on the loop takes one model for better than another.
THRESHOLD = 6.0
# Draws of what the parameters may be: in the linear forecast, and of each rival in a rehearsal.
N_DRAWS, N_REHEARSED_DRAWS = 512, 4
# So many fits a whole rehearsal may take; it decides how many manoeuvres are rehearsed, but not below the fewest.
MOST_FITS, FEWEST = 160, 4
# Rivals that a manoeuvre tells apart no more often than this are not said to be separated by it.
OFTEN = 0.5


@dataclass(frozen=True)
class Advice:
    """Advise a manoeuvre.

    manoeuvre: key -> value as campaign.toml would say it. words: the same for people. separates: names of the rivals
    that its record is expected to tell apart. power: chance that the right one of any two of them wins by more than the
    threshold, the lowest of the pairs, whichever of the two is right. delta: distance of their predictions after both
    were fitted again to old and new records, in standard deviations of the noise, of that pair.
    """

    manoeuvre: Mapping[str, Key]
    words: str
    separates: tuple[str, ...]
    power: float
    delta: float


def advise(
    rivals: Sequence[Rival],
    white: Whitening | None = None,
    grid: Sequence[Feasible] | None = None,
    speed_limit: float | None = None,
    threshold: float = THRESHOLD,
    threads: int = 1,
) -> tuple[Advice, ...]:
    """Rank feasible manoeuvres by how well one record of each would tell the rivals apart, the best first.

    All manoeuvres are forecast (linear in the parameters, see `chance`); the best of them are rehearsed: a record is
    simulated from each rival in turn, as uncertain as it is known by now, and all are fitted again (see `rehearse`).
    Only rehearsed manoeuvres are returned, ranked by the mean power over pairs, then by the mean distance.
    rivals: two or more, fitted to the same records. white: turns signals of a new record, (n_signals, n_samples), into
    units of white noise, None: the mean weight of the records. grid: None: `manoeuvre_grid`. speed_limit: of the gyro,
    [unit of the signal]. threshold: difference of the criterion at which one model counts as better.
    threads: among which rivals and manoeuvres are shared.

    Raises ArmidError for fewer than two rivals.
    Source: Box, Hill 1967, doi:10.1080/00401706.1967.10490441; Atkinson, Fedorov 1975, doi:10.1093/biomet/62.1.57.
    """
    if len(rivals) < 2:
        raise ArmidError(f"{len(rivals)} model was given to be told apart from others: at least two are expected")
    first = rivals[0].records
    filtered = white or mean_weight(first)
    told = grid or manoeuvre_grid(first.replays[0].model, [r.record for r in first.replays])
    promising = foreseen_best(rivals, told, filtered, speed_limit, threshold, threads)
    draws = normal_draws(max(len(r.z) for r in rivals), N_REHEARSED_DRAWS)
    powers = side_by_side(lambda f: rehearsed_powers(rivals, f, filtered, draws, threshold), promising, threads)
    ranked = sorted(zip(promising, powers, strict=True), key=lambda pair: rank(pair[1]), reverse=True)
    return tuple(advice_of(rivals, feasible, found) for feasible, found in ranked)


def mean_weight(records: WeightedRecords) -> Whitening:
    """Return the whitening of a record like the others: the weight of their mean square."""
    weight = float(np.mean(np.square(1.0 / np.array(records.weights))) ** -0.5)
    return lambda signals: weight * signals


def normal_draws(n_dimensions: int, n_draws: int) -> Array:
    """Return evenly spread standard normal draws, (n_draws, n_dimensions): the same at every call."""
    return np.asarray(norm.ppf(probes(np.zeros(n_dimensions), np.ones(n_dimensions), n_draws)))


def foreseen_best(
    rivals: Sequence[Rival], grid: Sequence[Feasible], white: Whitening, speed_limit: float | None, threshold: float,
    threads: int,
) -> list[Feasible]:
    """Return the manoeuvres that are worth a rehearsal, by the linear forecast, the best first."""
    forecasts = side_by_side(lambda rival: forecasts_of(rival, grid, white, speed_limit), rivals, threads)
    draws = normal_draws(1 + sum(len(r.z) for r in rivals), N_DRAWS)
    possible = [f for f in grid if all(f in known for known in forecasts)]
    ranks = {f: rank(foreseen_powers(rivals, [k[f] for k in forecasts], draws, threshold)) for f in possible}
    most = max(MOST_FITS // (len(rivals) ** 2 * N_REHEARSED_DRAWS), FEWEST)
    return sorted(possible, key=lambda f: ranks[f], reverse=True)[:most]


def rank(powers: Mapping[Pair, tuple[float, float]]) -> tuple[float, float]:
    """Return what manoeuvres are ranked by: mean power in steps of a hundredth, then mean distance."""
    power, delta = (float(np.mean([p[k] for p in powers.values()])) for k in (0, 1))
    return round(power, 2), delta


def foreseen_powers(
    rivals: Sequence[Rival], forecasts: Sequence[Forecast], draws: Array, threshold: float
) -> dict[Pair, tuple[float, float]]:
    """Return (power, delta) of each pair of rivals for one manoeuvre, by the linear forecast."""
    found = {}
    for a, b in combinations(range(len(rivals)), 2):
        old = rivals[b].criterion - rivals[a].criterion
        one = chance(forecasts[a], forecasts[b], old, draws, threshold)
        other = chance(forecasts[b], forecasts[a], -old, draws, threshold)
        found[a, b] = (0.5 * (one[0] + other[0]), float(np.sqrt(0.5 * (one[1] + other[1]))))
    return found


def rehearsed_powers(
    rivals: Sequence[Rival], feasible: Feasible, white: Whitening, draws: Array, threshold: float
) -> dict[Pair, tuple[float, float]]:
    """Return (power, delta) of each pair of rivals for one manoeuvre, by simulated records and fits."""
    tried = [rehearse(rivals, i, feasible, white, draws, threshold) for i in range(len(rivals))]
    chances, distances = (np.array([t[k] for t in tried]) for k in (0, 1))
    return {
        (a, b): (float(0.5 * (chances[a, b] + chances[b, a])), float(0.5 * (distances[a, b] + distances[b, a])))
        for a, b in combinations(range(len(rivals)), 2)
    }


def advice_of(rivals: Sequence[Rival], feasible: Feasible, powers: Mapping[Pair, tuple[float, float]]) -> Advice:
    """Return the advice for one manoeuvre: the largest set of rivals that it often tells apart, or the best pair."""
    for size in range(len(rivals), 1, -1):
        weakest = {s: min(powers[pair] for pair in combinations(s, 2)) for s in combinations(range(len(rivals)), size)}
        best = max(weakest, key=lambda s: weakest[s])
        if weakest[best][0] >= OFTEN:
            break
    return Advice(dict(feasible.keys), feasible.name, tuple(rivals[i].name for i in best), *weakest[best])
