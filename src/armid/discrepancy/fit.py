"""A model fitted to the evidence."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from armid.discrepancy.evidence import WhiteRecords
from armid.identifiability.refine import fit as least_squares_fit
from armid.model import ArmidError
from armid.simulation import probes

Array = NDArray[np.float64]
# Relative change of the sum of squares at which a fit stops: far below the 1 that means anything in 10,000 samples.
TOLERANCE = 1e-7
N_SPREAD, N_STARTS = 512, 4
ONLY_NOISE = 0.01


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold the declared model with some effects at its least-squares estimate.

    active: names of the effects that were added. records: the least-squares problem. z: free parameters as shares of
    their range, (n_free,). residual: whitened, measured minus simulated, (n_samples,). jacobian: whitened derivatives
    of the signal by z, (n_samples, n_free).
    """

    active: tuple[str, ...]
    records: WhiteRecords
    z: Array
    residual: Array
    jacobian: Array

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residual."""
        return float(self.residual @ self.residual)

    @property
    def n_free(self) -> int:
        """Number of parameters that were fitted."""
        return len(self.z)

    @property
    def x(self) -> Array:
        """Free parameters, SI, (n_free,)."""
        return self.records.values(self.z)

    @property
    def candidate(self) -> Array:
        """Return the whole candidate of the problem's model, SI."""
        return np.asarray(self.records.space.complete(self.x[np.newaxis])[0])

    @property
    def values(self) -> dict[str, float]:
        """Name -> value of the free parameters, SI."""
        return dict(zip(self.records.space.free_names, map(float, self.x), strict=True))

    @cached_property
    def independent(self) -> float:
        """How many samples of the residual are independent."""
        return self.records.evidence.independent(self.residual)

    @property
    def is_noise(self) -> bool:
        """Whether the size of the residual is that of the noise: chi2 per sample not above 1 by chance of 1 %."""
        level, n = self.records.evidence.levels[0], len(self.residual) - self.n_free
        return level.known and bool(f_distribution.sf(self.chi2 / n, n, level.n_slow) > ONLY_NOISE)

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis of what the free parameters can absorb, (n_samples, rank)."""
        return span(self.jacobian)

    def column_names(self) -> list[str]:
        """Return which key each free parameter belongs to, the name of the parameter where it is the plant's own."""
        return [n.partition(".")[0] for n in self.values]


def span(columns: Array) -> Array:
    """Return an orthonormal basis of columns; directions below 1e-7 of the largest are rounding."""
    scale = np.linalg.norm(columns, axis=0)
    good = columns[:, scale > 0.0] / scale[scale > 0.0]
    if not good.shape[1]:
        return np.empty((len(columns), 0))
    left, values, _ = np.linalg.svd(good, full_matrices=False)
    return np.asarray(left[:, values > 1e-7 * values[0]])


def fit_from(records: WhiteRecords, active: Sequence[str], starts: Sequence[Array]) -> Fit:
    """Return the best of the least-squares estimates from some starts (shares of the range).

    Raises ArmidError when every start diverges.
    """
    if not records.space.free.any():
        return evaluated(records, active, np.empty(0))
    good = [z for z in starts if np.isfinite(records.residual(z)).all()]
    if not good:
        raise ArmidError("each start of a fit diverged: other bounds are expected")
    found = [least_squares_fit(records, z, TOLERANCE) for z in good]
    best = found[0] if len(found) == 1 else found[int(np.argmin(records.chi2(np.array(found))))]
    return evaluated(records, active, best)


def evaluated(records: WhiteRecords, active: Sequence[str], z: Array) -> Fit:
    """Return residual and slopes at free parameters, on all samples, whatever the fit saw."""
    whole = records if records.evidence.kept.all() else records.whole()
    residual, slopes = whole.residual_and_slopes(z)
    return Fit(tuple(active), records, z, -residual, slopes)


def fit_globally(records: WhiteRecords, active: Sequence[str]) -> Fit:
    """Return the least-squares estimate without a start.

    Deterministic: 512 candidates of a Kronecker sequence over the box, fits from the four best of them.

    Raises ArmidError when every candidate diverges.
    """
    n = int(records.space.free.sum())
    if n == 0:
        return evaluated(records, active, np.empty(0))
    spread = probes(np.zeros(n), np.ones(n), N_SPREAD)
    order = np.argsort(records.chi2(spread), kind="stable")[:N_STARTS]
    return fit_from(records, active, [spread[i] for i in order])
