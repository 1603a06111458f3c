"""A model fitted to the train records: its estimate, residual and sensitivities."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from armid.errors import ArmidError
from armid.estimation.least_squares import descend, spread_starts
from armid.loop.candidates import Active, EffectKey
from armid.loop.whitening import WhiteRecords
from armid.model import Model

Array = NDArray[np.float64]
# Relative change of the sum of squares at which a fit stops: far below the 1 that means anything in 10,000 samples.
TOLERANCE = 1e-7
ONLY_NOISE = 0.01


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold the declared model with some effects at its least-squares estimate.

    active: the effects that were added. records: the least-squares problem. z: free parameters as shares of their
    range, (n_free,). residual: whitened, measured minus simulated, (n_samples,). jacobian: whitened derivatives of the
    signal by z, (n_samples, n_free).
    """

    active: Active
    records: WhiteRecords
    z: Array
    residual: Array
    jacobian: Array

    @property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def n_free(self) -> int:
        return len(self.z)

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
        return level.known and bool(f_distribution.sf(self.chi2 / n, n, level.n_slow) > ONLY_NOISE)

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


def fit_from(records: WhiteRecords, active: Active, starts: Sequence[Array]) -> Fit:
    """Return the best of the least-squares estimates from some starts (shares of the range).

    Residual and slopes are those of all samples, whatever the fit saw.
    Raises ArmidError when every start diverges.
    """
    z = np.empty(0)
    if records.space.free.any():
        good = [z for z, chi2 in zip(starts, records.chi2(np.array(starts)), strict=True) if np.isfinite(chi2)]
        if not good:
            raise ArmidError("each start of a fit diverged: other bounds are expected")
        z = descend(records, good, TOLERANCE)
    return Fit(tuple(active), records, z, *records.with_all_samples().residual_and_slopes(z))


def fit_globally(records: WhiteRecords, active: Active) -> Fit:
    """Return the least-squares estimate without a start, see `spread_starts`.

    Raises ArmidError when every candidate diverges.
    """
    return fit_from(records, active, spread_starts(records) if records.space.free.any() else ())
