"""What the noise of a measured start does to an estimate."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armid.problem.replay import Replay
from armid.problem.space import Space
from armid.record import Piece
from armid.simulation import Calibration, simulate

Array = NDArray[np.float64]


def start_scatter(replay: Replay, space: Space, x: Array, jacobian: Array) -> Array:
    """Return the covariance of J^T (residual) that comes from noise in the measured starts, (n_free, n_free).

    sum over pieces and start constants c of var(c) g g^T with g = J^T d signal / d c; zero for a machine that starts
    from rest. jacobian: of the whole record, shape (n_samples, n_free).
    """
    scatter = np.zeros((len(x), len(x)))
    row = 0
    for piece, calibration in zip(replay.pieces, replay.calibrations, strict=True):
        rows = jacobian[row : row + piece.n_samples].T
        for name, deviation in piece.start_deviation.items():
            g = rows @ start_sensitivity(replay, piece, calibration, space, x, name) * deviation
            scatter += np.outer(g, g)
        row += piece.n_samples
    return scatter


def start_sensitivity(
    replay: Replay, piece: Piece, calibration: Calibration, space: Space, x: Array, name: str
) -> Array:
    """Return d signal / d start constant in the window of a piece (central difference), shape (n_samples,)."""
    # a speed held for a second is the size of a position
    move = 1e-4 * replay.model.plant.scales.speed
    signals = []
    for sign in (1.0, -1.0):
        constants = dict(piece.manoeuvre.constants)
        constants[name] = constants.get(name, 0.0) + sign * move
        manoeuvre = replace(piece.manoeuvre, constants=constants)
        run = simulate(replay.model, manoeuvre, space.complete(x[np.newaxis]), calibration.schedule)
        signals.append(run.output[0, piece.window])
    return np.asarray((signals[0] - signals[1]) / (2.0 * move))
