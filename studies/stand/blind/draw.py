"""Draw what a blind campaign's arm is and what it is told to do."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stand.arm import Arm
from stand.blind.case import Case
from stand.blind.suite import Suite
from stand.gyro import Gyro
from stand.manoeuvre import Manoeuvre
from stand.motion import Motion
from stand.refusal import RefusalError
from stand.trajectory import Trajectory, simulate

TOLERANCE = 1e-9
TRIES = 60
FASTEST = 3.4
"""Largest speed of a drawn manoeuvre [rad/s]: 195 deg/s, below the gyro's range of 200."""
PAPERS = Manoeuvre("lower", -48.0, 22.0)
Strokes = Callable[[np.random.Generator], tuple[tuple[Manoeuvre, str], ...]]
"""What draws manoeuvres, each with its role."""


@dataclass(frozen=True)
class Drawn:
    """Hold the truth of a campaign: arm, manoeuvres with role, duration [s], gyro, and the true trajectories."""

    arm: Arm
    strokes: tuple[tuple[Manoeuvre, str], ...]
    duration_s: float
    gyro: Gyro
    trajectories: tuple[Trajectory, ...]


def draw(suite: Suite, case: Case, rng: np.random.Generator, strokes_of: Strokes | None = None) -> Drawn:
    """Draw parameters and manoeuvres until the arm, effects included, makes every stroke inside its travel.

    `strokes_of` draws the manoeuvres; None: as the class of the case wants them. Raises RefusalError when no draw does.
    """
    noise = round(float(rng.uniform(*suite.noise_deg_s)), 4)
    usual = _one_stroke if case.label == "one_stroke" else six_strokes
    gyro = Gyro(noise, 0.001, suite.bandwidth_hz if case.coloured else 0.0)
    for _ in range(TRIES):
        arm = _arm(suite, rng)
        duration = round(float(rng.uniform(*suite.duration_s)), 2)
        strokes = strokes_of(rng) if strokes_of else usual(rng)
        found = [_run(Motion(arm, manoeuvre, case.effects()), duration) for manoeuvre, _ in strokes]
        trajectories = tuple(each for each in found if each is not None)
        if len(trajectories) == len(strokes):
            return Drawn(arm, strokes, duration, gyro, trajectories)
    raise RefusalError(f"no arm and manoeuvres for case {case.index} ({case.label}) were found in {TRIES} draws")


def _arm(suite: Suite, rng: np.random.Generator) -> Arm:
    """Draw the four unknown parameters, away from the edges of their search ranges."""
    drawn: dict[str, Any] = {}
    for name, (low, high) in suite.ranges.items():
        kept = suite.margin * (high - low)
        drawn[name] = float(f"{rng.uniform(low + kept, high - kept):.6g}")
    return replace(Arm(), **drawn)


def six_strokes(rng: np.random.Generator) -> tuple[tuple[Manoeuvre, str], ...]:
    """Draw six manoeuvres: four to train on, two to hold out."""

    def between(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 1)

    short = between(-50.0, -32.0)
    high, low = between(-2.0, 22.0), between(-46.0, -34.0)
    start, target = (low, high) if rng.random() < 0.5 else (high, low)
    return (
        (Manoeuvre("lower", between(-50.0, -44.0), between(17.0, 24.0)), "train"),
        (Manoeuvre("raise", between(15.0, 24.0), between(-50.0, -42.0)), "train"),
        (Manoeuvre("short", short, round(short + between(32.0, 44.0), 1)), "train"),
        (Manoeuvre("empty", between(-50.0, -40.0), between(12.0, 22.0), shell=False), "train"),
        (Manoeuvre("low_supply", between(-46.0, -38.0), between(10.0, 20.0), True, between(23.0, 26.0)), "holdout"),
        (Manoeuvre("other", start, target, bool(rng.random() < 0.6), between(26.0, 28.5)), "holdout"),
    )


def _one_stroke(rng: np.random.Generator) -> tuple[tuple[Manoeuvre, str], ...]:
    """Give the paper's lowering stroke; half of the campaigns hold a repeat of it out."""
    repeat = ((replace(PAPERS, name="again"), "holdout"),)
    return ((PAPERS, "train"), *(repeat if rng.random() < 0.5 else ()))


def _run(motion: Motion, duration: float) -> Trajectory | None:
    """Simulate a stroke; None when it leaves the travel, is too fast for the gyro, or does not get to the closed loop.

    The closed loop must last for 0.2 s of the record.
    """
    try:
        found = simulate(motion, duration, TOLERANCE)
    except RefusalError:
        return None
    reached = found.switch_s is not None and found.switch_s < duration - 0.2
    return found if reached and float(np.abs(found.gyro).max()) < FASTEST else None
