"""What a model would do in manoeuvres that nobody has made yet, and which of them the machine could make."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armid.identifiability.manoeuvres import Feasible
from armid.identifiability.travel import key_travel
from armid.model import Model
from armid.problem.replay import Replay
from armid.simulation import Schedule, simulate
from armid.simulation.simulate import Simulation

Array = NDArray[np.float64]
# How much finer than the records asked for time is cut: a manoeuvre that nobody calibrated may be stiffer.
FINER = 2
# A speed below this part of the fastest record's rms is no motion.
MOVES = 0.05
# States of a machine that is driven by inputs may range this much wider than in its records.
WIDER = 1.05


def fine_schedule(replays: Sequence[Replay]) -> Schedule:
    """Return one schedule for whatever manoeuvre: twice as fine as the finest that the records asked for."""
    return Schedule(FINER * max(c.schedule.substeps for r in replays for c in r.calibrations))


class Motions:
    """Simulate manoeuvres and pass over those that the machine could not make.

    replays: of the train records, they say how finely to cut time and, for a machine driven by inputs, how far it may
    move. candidate: whole, SI, the one that must stay feasible. speed_limit: [unit of the signal], the gyro's range.
    """

    def __init__(self, replays: Sequence[Replay], candidate: Array, speed_limit: float | None = None) -> None:
        self.model: Model = replays[0].model
        self.schedule = fine_schedule(replays)
        self.candidate = candidate
        self.speed_limit = np.inf if speed_limit is None else speed_limit
        self.slowest = MOVES * max(float(np.sqrt(np.mean(r.measured**2))) for r in replays)
        self.travel = key_travel(self.model.plant)
        self.extents = extents(replays, candidate, self.schedule) if self.model.plant.inputs else {}

    def signals(self, grid: Iterable[Feasible], candidates: Array) -> Iterator[tuple[Feasible, Array]]:
        """Yield each manoeuvre that can be made with the signals of candidates in its window.

        candidates: whole, SI, shape (n_candidates, n_parameters). Signals: shape (n_candidates, n_samples).
        """
        population = np.concatenate([self.candidate[np.newaxis], candidates])
        for feasible in grid:
            run = simulate(self.model, feasible.manoeuvre, population, self.schedule, states=True)
            if self.can_be_made(run):
                yield feasible, run.output[1:, feasible.window]

    def can_be_made(self, run: Simulation) -> bool:
        """Tell whether the first candidate moves, within the travel, the gyro's range and what was recorded."""
        if run.failed.any():
            return False
        speed, states = run.output[0], {name: values[0] for name, values in run.states.items()}
        moves = bool(np.sqrt(np.mean(speed**2)) >= self.slowest) and bool(np.abs(speed).max() <= self.speed_limit)
        inside = all(low <= states[name].min() and states[name].max() <= high
                     for name, (low, high) in self.travel.items())  # fmt: skip
        return moves and inside and all(np.ptp(states[name]) <= wide for name, wide in self.extents.items())


def extents(replays: Sequence[Replay], candidate: Array, schedule: Schedule) -> dict[str, float]:
    """Return state -> how wide it may range: a little more than in the records, for states that files show."""
    columns = [name for name, state in replays[0].model.states.items() if state.column]
    widest = dict.fromkeys(columns, 0.0)
    for replay in replays:
        for piece in replay.pieces:
            whole = replace(schedule, plan=None)
            run = simulate(replay.model, piece.manoeuvre, candidate[np.newaxis], whole, states=True)
            for name in columns:
                widest[name] = max(widest[name], WIDER * float(np.ptp(run.states[name])))
    return widest
