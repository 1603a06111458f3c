"""Examine what the train records of a campaign say about the parameters, and what one more would."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError, nearest
from armid.estimation.constants import columns_of, common_factors, products
from armid.estimation.design import SHRINKAGE, VOLUME, WORST, Motions, Offer, expected_levels, manoeuvre_grid, offers
from armid.estimation.information import (
    SINGULAR,
    Information,
    Profile,
    covariance_by_inputs,
    information_at,
    information_of,
    normalised,
    profiles,
)
from armid.estimation.least_squares import (
    WeightedRecords,
    estimate,
    held_by_bound,
    weighted_records,
    with_fitted_starts,
)
from armid.estimation.noise_model import Level, level_weights, levels_of
from armid.model import Array, Model
from armid.problem.problem import Replay, replays
from armid.problem.space import Space
from armid.problem.starts import with_starts
from armid.record import Campaign
from armid.report.result import IDENTIFIABILITY, Kind, Result

RANKINGS = (VOLUME, WORST, SHRINKAGE)
# Of a noise that is given: the rounding of a speed is larger.
LEAST_EXAMINED = 1e-15
Members = tuple[int, ...]
# From here on a group is reported; Brun et al. call indices above 10 to 15 poorly identifiable.
CRITICAL = 10.0
# A group explains the collinearity of a larger set when its index reaches this share of the set's.
EXPLAINS_HALF = 0.5
# Above this number of parameters only groups of up to so many members are tried, or all of them.
MOST_TRIED, LARGEST_TRIED = 12, 4


@dataclass(frozen=True, eq=False)
class Group:
    """Parameters that the records cannot tell apart.

    index: collinearity index; a change of one is made up for by the others to within 1/index. direction: how they move
    together, as shares of their ranges, its largest component 1.
    """

    names: tuple[str, ...]
    index: float
    direction: Array


def groups(fisher: Array, names: tuple[str, ...]) -> tuple[Group, ...]:
    """Return the groups of parameters that move together, the worst first.

    The smallest set whose index reaches half of that of all parameters is the first group; then the member that does
    most harm is taken as known, and the rest is looked at again, until its index is below 10. fisher: in shares
    of the range; a parameter that is not seen at all has a zero row and is in no group.
    """
    scaled, seen = normalised(fisher)
    visible = tuple(n for n, s in zip(names, seen, strict=True) if s)
    scale = np.sqrt(np.diag(fisher)[seen])
    left, groups = tuple(range(len(visible))), []
    while (index := index_of(scaled, left)) >= CRITICAL:
        members = smallest(scaled, left, max(CRITICAL, EXPLAINS_HALF * index))
        _, vectors = np.linalg.eigh(scaled[np.ix_(members, members)])
        moves = vectors[:, 0] / scale[list(members)]
        moves = moves / moves[int(np.argmax(np.abs(moves)))]
        groups.append(Group(tuple(visible[i] for i in members), index_of(scaled, members), moves))
        left = min((tuple(i for i in left if i != m) for m in members), key=lambda rest: index_of(scaled, rest))
    return tuple(groups)


def collinearity_index(fisher: Array) -> float:
    """Return 1/sqrt(smallest eigenvalue) of the information matrix scaled to a diagonal of 1.

    1 for parameters whose sensitivities are orthogonal, 3e6 (rounding) where one repeats others. Source: Brun,
    Reichert, Kuensch 2001, doi:10.1029/2000WR900350, Eq 14.
    """
    scaled, _ = normalised(fisher)
    if len(scaled) < 2:
        return 1.0
    return float(1.0 / np.sqrt(max(float(np.linalg.eigvalsh(scaled)[0]), SINGULAR)))


def index_of(scaled: Array, members: Members) -> float:
    return collinearity_index(scaled[np.ix_(members, members)])


def smallest(scaled: Array, among: Members, index: float) -> Members:
    """Return the smallest set, and of its size the worst, that reaches an index; all where none smaller does."""
    for size in range(2, (len(among) if len(among) <= MOST_TRIED else LARGEST_TRIED) + 1):
        worst = max(combinations(among, size), key=lambda members: index_of(scaled, members))
        if index_of(scaled, worst) >= index:
            return worst
    return among


@dataclass(frozen=True, eq=False, repr=False)
class Examination(Result):
    """What the train records say about the free parameters at one candidate; it prints itself.

    x: SI, (n_free,): the least-squares estimate, or the point that was asked for (given). minimum: the least-squares
    estimate. information: at x, noise of measured inputs counted. combinations: what is known only together with
    constants, in words. wider: standard deviations that count the tolerances of the constants, SI. profiles: one for
    each free parameter, about the minimum. offers: what one more record would buy, the best first.
    """

    kind: ClassVar[Kind] = IDENTIFIABILITY
    campaign: Campaign
    model: Model
    space: Space
    replays: tuple[Replay, ...]
    x: Array
    given: bool
    minimum: Array
    information: Information
    groups: tuple[Group, ...]
    combinations: tuple[str, ...]
    wider: Array
    profiles: tuple[Profile, ...]
    offers: tuple[Offer, ...]
    ranked_by: str

    @property
    def at_bound(self) -> NDArray[np.bool_]:
        """Which free parameters of the minimum sit on a bound."""
        return held_by_bound(self.space, self.minimum)


def examine(
    campaign: Campaign,
    model: Model,
    space: Space,
    x: Array | None = None,
    noise: float | None = None,
    by: str = VOLUME,
    accuracy: str | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Examination:
    """Examine the train records of a campaign; holdout records are not looked at.

    x: free parameters at which sensitivities are taken, SI, (n_free,); None: the least-squares estimate, that of
    `identify`. noise: rms to assume in place of what was measured. by: how offers are ranked, see `Offer`. accuracy:
    "standard" or "fine", of the engine; None: as the noise of each record asks for. progress: called with a
    sentence before each step that takes long.
    """
    if not space.free.any():
        raise ArmidError("no parameter is free: at least one is expected to be examined")
    if by not in RANKINGS:
        raise ArmidError(f"offers are to be ranked by '{by}': {nearest(by, RANKINGS)}")
    if noise is not None and not LEAST_EXAMINED <= noise <= 1.0 / LEAST_EXAMINED:
        raise ArmidError(f"the noise is {noise:g}: a finite number above 0 is expected, {LEAST_EXAMINED:g} to "
                         f"{1.0 / LEAST_EXAMINED:g}")  # fmt: skip
    if x is not None and np.shape(x) != (len(space.free_names),):
        names = ", ".join(space.free_names)
        raise ArmidError(f"the point has the shape {np.shape(x)}: one value for each of {names} is expected")
    train = replays(campaign.train, model, space, accuracy)
    if x is None:
        train = with_fitted_starts(train, space)
        start = estimate(train, space)
    else:
        start = np.asarray(x, dtype=np.float64)
        train = with_starts(train, space.complete(start[np.newaxis])[0])
        low, high = space.low[space.free], space.high[space.free]
        for name, value, a, b in zip(space.free_names, start, low, high, strict=True):
            if not a <= value <= b:
                raise ArmidError(
                    f"{name} is {value:g}, a value from {a:g} to {b:g} is expected: other bounds can be given"
                )
    records = as_scattered(weighted_records(train, space), levels_of(train, space, start, noise))
    if not np.isfinite(records.chi2(records.shares(start))[0]):
        raise ArmidError("the simulation diverges at the point that was given: another point is expected")
    z, curves = profiles(records, records.shares(start), progress)
    minimum = records.values(z)
    at = minimum if x is None else start
    information = information_at(train, space, at, levels_of(train, space, at, noise), records.weights)
    by_inputs = covariance_by_inputs(train, space, at)
    information = information.widened(by_inputs)
    weighed = WeightedRecords(train, space, level_weights(information.levels))
    z_at = weighed.shares(at)
    residual, slopes = weighed.residual_and_slopes(z_at)
    within = products(weighed, z_at, campaign.tolerances)
    relative = slopes * (at / weighed.span)
    alone = information_of(weighed, z_at, None, columns_of(within, len(residual))).deviation
    wider = np.sqrt(alone**2 + np.diag(by_inputs))
    levels = expected_levels(train, information.levels)
    motions = Motions(train, space.complete(at[np.newaxis])[0], campaign.gyro_range)
    grid = manoeuvre_grid(model, [r.record for r in train])
    progress("manoeuvres for the next record")
    bought = offers(motions, grid, space, at, information.fisher, levels, by)
    return Examination(campaign, model, space, train, at, x is not None, minimum, information,
                       groups(information.fisher, space.free_names),
                       common_factors(space.free_names, relative, within) if within else (),
                       wider if within else information.deviation, curves, bought, by)  # fmt: skip


def as_scattered(records: WeightedRecords, levels: Sequence[Level]) -> WeightedRecords:
    """Return records whose chi2 counts effective samples as they scatter, their weights in the same proportions.

    A sum of squares of another level has its minimum at the same place; of all records together its scatter is right.
    """
    weights = np.array(records.weights)
    excess = (weights / level_weights(levels)) ** 2
    scale = np.sqrt(np.average(excess, weights=[r.record.n_samples for r in records.replays]))
    return replace(records, weights=tuple((weights / scale).tolist()))
