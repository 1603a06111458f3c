"""The signal that is missing at a port, recovered without a form (regularised unknown-input estimate)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.stretch import Stretch

Array = NDArray[np.float64]
STRENGTHS = 10.0 ** np.arange(-8.0, 6.0, 0.5)
# Beside the squared second differences (up to 16): keeps straight lines from being free.
LITTLE = 1e-6
# Smaller eigenvalues of the normal equations, relative to the largest, are rounding.
ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class MissingSignal:
    """Hold what must be added at a port to bring the residual down.

    signals: one for each stretch, [unit of the port], at its knots. share: share of the squared residual, beyond what
    the free parameters can absorb, that it removes. strength: of the smoothing, chosen by generalised cross-validation.
    """

    port: str
    signals: tuple[Array, ...]
    share: float
    strength: float


def missing_signal(whole: Sequence[Stretch], port: str) -> MissingSignal:
    """Recover the missing signal at a port.

    minimise sum |P (r - G c)|^2 + s sum |D c|^2 over the knots' values c of all stretches; P projects off the
    sensitivities to the free parameters of all stretches together, D takes second differences; s by generalised
    cross-validation (Golub, Heath, Wahba 1979, doi:10.1080/00401706.1979.10489751).
    """
    basis = parameter_basis(whole)
    residual = np.concatenate([s.residual for s in whole])
    columns = block_diagonal([s.gains[port] for s in whole])
    r, g = without(basis, residual), without(basis, columns)
    scale = np.sqrt(np.mean(np.sum(g**2, axis=0))) or 1.0
    rough = block_diagonal([np.diff(np.eye(len(s.knots)), 2, axis=0) for s in whole])
    strength, signal = smoothest(g.T @ g / scale**2, g.T @ r / scale, rough, float(r @ r), len(r))
    rest = r - g @ signal / scale
    edges = np.cumsum([len(s.knots) for s in whole])[:-1]
    share = 1.0 - float(rest @ rest) / float(r @ r)
    return MissingSignal(port, tuple(np.split(signal / scale, edges)), share, strength)


def smoothest(normal: Array, slope: Array, rough: Array, total: float, n: int) -> tuple[float, Array]:
    """Return strength and solution with the least generalised cross-validation score, n |rest|^2 / (n - freedom)^2.

    normal, slope: G^T G and G^T r of the residual's least-squares problem; total: |r|^2; n: samples.
    In c = L^-T b with L L^T = D^T D + a little, the smoothing is plain ridge: one decomposition serves all strengths.
    """
    lower = np.linalg.cholesky(rough.T @ rough + LITTLE * np.eye(rough.shape[1]))
    inner = np.linalg.solve(lower, np.linalg.solve(lower, normal).T)
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    seen = values > ROUNDING * values[-1]
    values, vectors = values[seen], vectors[:, seen]
    along = vectors.T @ np.linalg.solve(lower, slope)
    squares = along**2 / values
    outside = max(total - float(squares.sum()), 0.0)
    scores = []
    for strength in STRENGTHS:
        kept = values / (values + strength)
        rest = outside + float(np.sum((1.0 - kept) ** 2 * squares))
        scores.append(n * rest / (n - min(float(kept.sum()), 0.9 * n)) ** 2)
    strength = float(STRENGTHS[int(np.argmin(scores))])
    return strength, np.linalg.solve(lower.T, vectors @ (along / (values + strength)))


def parameter_basis(whole: Sequence[Stretch]) -> Array:
    """Return an orthonormal basis of what the free parameters can do to all stretches, (n_samples, n_free)."""
    jacobian = np.concatenate([s.jacobian for s in whole])
    if not jacobian.shape[1]:
        return jacobian
    left, values, _ = np.linalg.svd(jacobian, full_matrices=False)
    return np.asarray(left[:, values > 1e-12 * values[0]]) if values[0] > 0.0 else jacobian[:, :0]


def without(basis: Array, columns: Array) -> Array:
    """Return columns with their part along an orthonormal basis taken away."""
    return np.asarray(columns - basis @ (basis.T @ columns))


def block_diagonal(blocks: Sequence[Array]) -> Array:
    """Return blocks along the diagonal of one matrix."""
    from scipy.linalg import block_diag  # noqa: PLC0415 - takes time to import

    return np.asarray(block_diag(*blocks))
