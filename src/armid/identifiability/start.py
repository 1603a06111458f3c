"""What the noise of a measured start does to an estimate."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armid.problem.replay import Replay
from armid.problem.space import Space
from armid.record import Piece
from armid.simulation import Calibration, simulate

Array = NDArray[np.float64]
# The start speed is the end of a straight line through this many seconds [s]: its variance is 4/n of the noise's.
SMOOTHED_OVER, AT_THE_END = 0.020, 4.0


def start_scatter(replay: Replay, space: Space, x: Array, jacobian: Array) -> Array:
    """Return the covariance of J^T (residual) that comes from noise in the start speeds, (n_free, n_free).

    sum over pieces of var(v0) g g^T with g = J^T d signal / d v0; zero for a machine that starts from rest.
    jacobian: of the whole record, shape (n_samples, n_free).
    """
    scatter = np.zeros((len(x), len(x)))
    if replay.model.plant.from_rest:
        return scatter
    row = 0
    for piece, calibration in zip(replay.pieces, replay.calibrations, strict=True):
        g = jacobian[row : row + piece.n_samples].T @ start_sensitivity(replay, piece, calibration, space, x)
        n = max(SMOOTHED_OVER / piece.manoeuvre.interval + 1.0, 4.0)
        scatter += AT_THE_END / n * replay.record.noise.rms**2 * np.outer(g, g)
        row += piece.n_samples
    return scatter


def start_sensitivity(replay: Replay, piece: Piece, calibration: Calibration, space: Space, x: Array) -> Array:
    """Return d signal / d start_speed in the window of a piece (central difference), shape (n_samples,)."""
    move = 1e-4 * replay.model.plant.scales.speed
    signals = []
    for sign in (1.0, -1.0):
        constants = dict(piece.manoeuvre.constants)
        constants["start_speed"] = constants.get("start_speed", 0.0) + sign * move
        manoeuvre = replace(piece.manoeuvre, constants=constants)
        run = simulate(replay.model, manoeuvre, space.complete(x[np.newaxis]), calibration.schedule)
        signals.append(run.output[0, piece.window])
    return np.asarray((signals[0] - signals[1]) / (2.0 * move))
