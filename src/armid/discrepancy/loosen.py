"""Set the fixed shapes of an effect free: a rival must not lose by the width of a sign alone."""

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.evidence import WhiteRecords
from armid.discrepancy.fit import Fit, fit_from
from armid.discrepancy.library import Library
from armid.discrepancy.names import loose
from armid.discrepancy.trace import at_null

Array = NDArray[np.float64]
# Shares of their range from which all shapes begin; then each alone from the best of so many places along its range:
# the best period of a sampled control is a narrow one.
STARTS, N_PLACES = (0.03, 0.5), 384


def loosened(fit: Fit, name: str, library: Library) -> Fit:
    """Return the fit with the fixed shapes of one of its effects free, such as the width over which a sign is smoothed.

    A declared shape that is not the machine's leaves a residual that another effect would be taken for.
    """
    active = loose(fit.active, name)
    records = library.problem(active, fit.values)
    known = dict(zip(fit.records.space.names, fit.candidate, strict=True))
    z = records.shares(np.array([known[n] for n in records.space.free_names]))
    free = np.array([n in library.loosened(name) for n in records.space.free_names])
    starts = [np.where(free, share, z) for share in STARTS]
    # The strength has taken up what it could of the shape's part, so that each shape is tried without it too.
    rest = records.shares(at_null(records, fit.candidate, name)[records.space.free])
    starts += [best_along(records, at, place) for place in map(int, np.flatnonzero(free)) for at in (z, rest)]
    return fit_from(records, active, [np.clip(z, 1e-3, 1.0 - 1e-3), *starts])


def best_along(records: WhiteRecords, z: Array, place: int) -> Array:
    """Return a candidate with one of its free parameters where it does best, the others as they are, (n_free,)."""
    tried = np.tile(z, (N_PLACES, 1))
    tried[:, place] = (np.arange(N_PLACES) + 0.5) / N_PLACES
    return np.asarray(tried[np.argmin(records.chi2(tried))])
