"""What is believed before the records are read: `calibration.toml`, as the inference uses it."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np


@dataclass(frozen=True)
class Calibration:
    """Hold prior beliefs.

    temperature: log evidence is divided by it. expected: kind of hypothesis -> how many of it a campaign has.
    odds: name of an effect -> how many times the odds of other effects.
    """

    temperature: float
    expected: Mapping[str, float]
    odds: Mapping[str, float]

    def log_odds(self, kind: str, n: int, name: str = "") -> float:
        """Return the log prior odds of one of n hypotheses of a kind."""
        p = min(self.expected[kind] / max(n, 1), 0.5)
        return float(np.log(p / (1.0 - p) * self.odds.get(name, 1.0)))


@cache
def calibration() -> Calibration:
    return Calibration(**tomllib.loads(files("armid.inference").joinpath("calibration.toml").read_text()))
