"""Examine what the train records of a campaign say about the parameters, and what one more would."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.errors import ArmidError
from armid.estimation.collinearity import Group, groups
from armid.estimation.design import VOLUME, Motions, Offer, expected_level, manoeuvre_grid, offers
from armid.estimation.information import Information, information_at, level_weights, levels_of
from armid.estimation.least_squares import WeightedRecords, estimate, held_by_bound, refine
from armid.estimation.profile import Profile, profiles
from armid.model import Model
from armid.problem.replay import Replay, replays
from armid.problem.space import Space
from armid.record import Campaign

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Examination:
    """Hold what the train records say about the free parameters at one candidate.

    x: SI, shape (n_free,): the least-squares estimate, or the point that was asked for (given). minimum: the
    least-squares estimate, (n_free,). information: Cramer-Rao deviations, correlations, Fisher matrix at x. groups:
    parameters that move together there. profiles: one for each free parameter, about the minimum. offers: what one more
    record would buy, the best first. ranked_by: by what they are ranked.
    """

    campaign: Campaign
    model: Model
    space: Space
    replays: tuple[Replay, ...]
    x: Array
    given: bool
    minimum: Array
    information: Information
    groups: tuple[Group, ...]
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
) -> Examination:
    """Examine the train records of a campaign; holdout records are not looked at.

    Parameters
    ----------
    campaign, model, space
        The records, the model and the box of its parameters.
    x : array, SI, (n_free,)
        Free parameters at which sensitivities are taken; None: the least-squares estimate, the records weighed by how
        far they scatter about it.
    noise : float, unit of the records
        Rms to assume in place of what was measured.
    by : str
        How offers are ranked, see `Offer`.
    accuracy : {"standard", "fine"}
        Of the engine; None: as the noise of each record asks for.

    Raises
    ------
    ArmidError
        When no parameter is free, x is outside the box, or everything diverges.
    """
    if not space.free.any():
        raise ArmidError("no parameter is free: at least one is expected to be examined")
    train = replays(campaign.train, model, space, accuracy)
    if x is None:
        first = estimate(train, space)
        start = refine(train, space, first, level_weights(levels_of(train, space, first, noise)))
    else:
        start = np.asarray(x, dtype=np.float64)
        low, high = space.low[space.free], space.high[space.free]
        for name, value, a, b in zip(space.free_names, start, low, high, strict=True):
            if not a <= value <= b:
                raise ArmidError(
                    f"{name} is {value:g}, a value from {a:g} to {b:g} is expected: other bounds can be given"
                )
    records = WeightedRecords(train, space, level_weights(levels_of(train, space, start, noise)))
    if not np.isfinite(records.chi2(records.shares(start))[0]):
        raise ArmidError("the simulation diverges at the point that was given: another point is expected")
    z, found = profiles(records, records.shares(start))
    minimum = records.values(z)
    at = minimum if x is None else start
    information = information_at(train, space, at, levels_of(train, space, at, noise))
    motions = Motions(train, space.complete(at[np.newaxis])[0], campaign.gyro_range)
    grid = manoeuvre_grid(model, [r.record for r in train])
    bought = offers(motions, grid, space, at, information.fisher, expected_level(information.levels), by)
    return Examination(campaign, model, space, train, at, x is not None, minimum, information,
                       groups(information.fisher, space.free_names), found, bought, by)  # fmt: skip
