"""Records made ready to be simulated many times, each on a schedule that a screening of candidates can pay."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.evidence import WhiteRecords
from armid.model import Manoeuvre, Model
from armid.problem import Replay, Space
from armid.record import Record
from armid.simulation import STANDARD, Calibration, Schedule, probes, simulate
from armid.simulation.calibrate import ALLOWED, MARGIN, difference, switch_weights

Array = NDArray[np.float64]
N_PROBES = 16
NEAR = 2.0
SUBSTEPS = (1, 2, 4, 8)


def made_ready(
    records: Sequence[Record], model: Model, space: Space, near: Mapping[str, float]
) -> tuple[Replay, ...]:
    """Make records ready to be simulated, on the engine's standard accuracy: the evidence's noise hides its error.

    near: values about which it is calibrated.
    """
    spread = space.complete(probes(*neighbourhood(space, near), N_PROBES))
    known: dict[object, Calibration] = {}
    ready = []
    for record in records:
        pieces = tuple(p.until_window_end() for p in record.pieces)
        keys = [p.manoeuvre.likeness() for p in pieces]
        for key, piece in zip(keys, pieces, strict=True):
            if key not in known:
                known[key] = quickly_calibrated(model, piece.manoeuvre, spread)
        ready.append(Replay(record, model, pieces, tuple(known[key] for key in keys)))
    return tuple(ready)


def joined(alone: Sequence[WhiteRecords | None], model: Model) -> tuple[Replay, ...] | None:
    """Return records on the finest of the schedules that were found for each of several candidates alone.

    None where one of them was not tried alone, or with another model. A fit looks again where it ends.
    """
    known = [a.replays for a in alone if a is not None and a.replays[0].model is model]
    if len(known) < max(len(alone), 2):
        return None
    return tuple(with_finest(same) for same in zip(*known, strict=True))


def with_finest(replays: Sequence[Replay]) -> Replay:
    """Return a record with the finest of the schedules of each piece."""
    each = zip(*(r.calibrations for r in replays), strict=True)
    finest = tuple(max(c, key=lambda one: one.schedule.substeps) for c in each)
    first = replays[0]
    return Replay(first.record, first.model, first.pieces, finest)


def neighbourhood(space: Space, near: Mapping[str, float]) -> tuple[Array, Array]:
    """Return bounds of the free parameters, those with a known value within a factor of 2 of it."""
    low, high = space.low[space.free].copy(), space.high[space.free].copy()
    for i, name in enumerate(space.free_names):
        if name in near:
            ends = sorted((near[name] / NEAR, near[name] * NEAR))
            low[i], high[i] = max(low[i], ends[0]), min(high[i], ends[1])
    return low, np.maximum(high, low)


def quickly_calibrated(model: Model, manoeuvre: Manoeuvre, spread: Array) -> Calibration:
    """Return the coarsest of few schedules whose error on the candidates stays within half of the standard one.

    `calibrate` would go on to steps that a screening of candidates cannot pay (a ripple so fine that the motion is a
    matter of chance asks for 128 in a sample), and would look for steps over several samples.
    """
    allowed = ALLOWED[STANDARD] * model.plant.scales.speed
    runs = {n: simulate(model, manoeuvre, spread, Schedule(n)) for n in SUBSTEPS[:2]}
    for n in SUBSTEPS:
        runs[2 * n] = runs.get(2 * n) or simulate(model, manoeuvre, spread, Schedule(2 * n))
        error = difference(runs[n], runs[2 * n]) * 16 / 15
        if error <= MARGIN * allowed and not (runs[n].failed & ~runs[2 * n].failed).any():
            break
    return Calibration(Schedule(n, weights=switch_weights(spread, runs[n])), error, bool(error <= allowed))
