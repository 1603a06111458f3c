"""The face towards pymoo: space, meter, problem."""

from armid.problem.meter import Log, Meter
from armid.problem.metered import PENALTY, RESIDUALS, Metered
from armid.problem.problem import IdentificationProblem
from armid.problem.replay import Replay, accuracy_for, replay_of, replays
from armid.problem.residual import residuals
from armid.problem.space import Space, space_of
from armid.problem.termination import MeterTermination

__all__ = [
    "PENALTY", "RESIDUALS", "IdentificationProblem", "Log", "Meter", "MeterTermination", "Metered", "Replay", "Space",
    "accuracy_for", "replay_of", "replays", "residuals", "space_of",
]  # fmt: skip
