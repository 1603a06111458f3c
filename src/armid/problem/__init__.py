"""The face towards pymoo: space, meter, problem."""

from armid.problem.meter import Meter
from armid.problem.problem import PENALTY, IdentificationProblem
from armid.problem.replay import Replay, accuracy_for, replay_of, replays
from armid.problem.space import Space, space_of
from armid.problem.termination import MeterTermination

__all__ = [
    "PENALTY", "IdentificationProblem", "Meter", "MeterTermination", "Replay", "Space", "accuracy_for", "replay_of",
    "replays", "space_of",
]  # fmt: skip
