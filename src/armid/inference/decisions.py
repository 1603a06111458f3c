"""The numbers with which the loop and its inference decide, in one list; and prior beliefs.

How many effects, faults and drifts to expect, and the temperature, stand in `calibration.toml`. The widths of priors
stand where they are used, in `evidence.py` and `kinds/`; so do numerics, layout and budgets of computing.
`estimation/data_checks.py` and `corrections.py` keep the numbers of the data checks.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

# Probability from which a name is claimed. Of claims 97 % are to be true; studies/calibration counts them.
CLAIMED = 0.95
# Probability from which a fault or something unknown enters the verdict: more likely than not.
MENTIONED = 0.5
# Probability from which a name is listed: what is rarer would fill the page, 40 names share the rest.
LISTED = 0.01
# Share of its value within which an interval lies on either side where a parameter is trusted; `--within` changes it.
WITHIN = 0.05
# Held-out error over that of the model before, from which a step is rejected: errors of sound steps scatter by 2 %.
DENIED = 1.02
# Error over noise up to which records are simulated at their noise: the noise of a short rest is known to 10 %.
OVER_NOISE = 1.1
# Probability of a false alarm of the tests for whiteness, all together: one in 200 sound campaigns.
SIGNIFICANCE = 0.005
# Probability that a declared tolerance is wrong: as often a normal constant is off by more than two deviations.
OUT_OF_TOLERANCE = 0.05
# Periods of an effect that repeats with position that the travel must hold: fewer fit anything that bends. Half a
# period of cogging stood for a spring that hardens, with a probability of 1.00.
PERIODS = 5
# Change of a record over its noise (rms) from which it is faulty. A lateness of 0.4 samples moved a record by 0.28, and
# was something unknown while that did not count.
MOVES = 0.25
# Log posterior odds within which models are expanded, and count as rivals for the next record (Madigan, Raftery 1994).
WINDOW = math.log(100.0)
# Log odds from which an addition is fitted where noise alone is left: forecasts err by 2 units of log, and a claim
# needs the other 95 %.
REFITTED = math.log(0.02)
# Log units behind the best model at which a fit is given up, and no rival any more: rough fits err by less.
HOPELESS = 60.0
# Probability from which a second drift is named as well: the complement of a claim.
AS_WELL = 1.0 - CLAIMED
# Held-out error over that of the train records from which it is reported; between records of EMPS it is 1.5, of the
# pendulum 1.6, and ten times went unreported.
NOT_CARRIED = 2.0
# Share of the trained range by which a held-out record leaves it where this is reported as new.
OUTSIDE = 0.1
# Share of the squared error of a held-out record that one changed parameter takes away where it is named, and of all
# that is left beyond noise that lies in one record.
EXPLAINS = 0.9


@dataclass(frozen=True)
class PriorBeliefs:
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
        return math.log(p / (1.0 - p) * self.odds.get(name, 1.0))


@cache
def calibration() -> PriorBeliefs:
    return PriorBeliefs(**tomllib.loads(files("armid.inference").joinpath("calibration.toml").read_text()))
