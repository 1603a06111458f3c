"""Make the record that was advised, and a random one in its place, as the same arm would make them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stand.advice.first import Entry, First, drawn_of, entry_of, files_of
from stand.advice.pairs import Proof
from stand.blind.campaign import measure_stroke
from stand.blind.draw import FASTEST, TOLERANCE, Drawn
from stand.manoeuvre import TRAVEL_DEG, Manoeuvre
from stand.motion import Motion
from stand.refusal import RefusalError
from stand.trajectory import SAMPLES_PER_SECOND, Trajectory, simulate

CHOICES = ("advised", "random")
TRIES = 200
APART_DEG, SUPPLY = 15.0, (24.0, 28.0)


@dataclass(frozen=True)
class Asked:
    """Hold what was advised: manoeuvres, the best first, each with the power that was promised."""

    manoeuvres: Sequence[Mapping[str, Any]]
    powers: Sequence[float]


def asked_in(report: Mapping[str, Any], pair: Sequence[str]) -> Asked | None:
    """Give what a report advises to tell a pair apart; None where it is not in doubt about it."""
    advice = [each for each in report["advice"] if set(pair) <= set(each["separates"])]
    if report["verdict"] != "cannot_tell_apart" or not advice:
        return None
    return Asked([each["manoeuvre"] for each in advice], [each["power"] for each in advice])


def make_second(proof: Proof, first: First, asked: Asked, choice: str) -> tuple[dict[str, bytes], Entry]:
    """Make a campaign with one record more, and its entry in the key; the noise of both choices is the same.

    `rank` tells which advice the arm could make, counted from 1, and is None where it could make none of them: then
    the campaign is the first one again.
    """
    drawn, effects = drawn_of(proof, first), first.case().effects()
    found = _advised(drawn, first, asked) if choice == "advised" else _random(drawn, first)
    longer = _with(drawn, found) if found else drawn
    rest = round(proof.suite.rest_s * SAMPLES_PER_SECOND)
    streams = [np.random.default_rng([*first.key, 2]), np.random.default_rng([*first.key, 3])]
    measured = [
        measure_stroke(longer, place, effects, rest, streams[place >= len(drawn.strokes)])
        for place in range(len(longer.strokes))
    ]
    name = f"{first.name}_{choice}"
    told = {"choice": choice, "base": first.name, "rank": found.rank if found else None, "power": asked.powers[0]}
    return files_of(name, longer, measured), entry_of(first, drawn) | told | {"next": found.told if found else None}


@dataclass(frozen=True)
class _Found:
    """Hold a manoeuvre that the arm can make, its trajectory, and which of those it was that were looked at."""

    manoeuvre: Manoeuvre
    trajectory: Trajectory
    rank: int

    @property
    def told(self) -> Entry:
        told = self.manoeuvre
        return {
            "start_angle_deg": told.start_deg,
            "target_angle_deg": told.target_deg,
            "shell": told.shell,
            "supply_V": told.supply_volt,
        }


def _advised(drawn: Drawn, first: First, asked: Asked) -> _Found | None:
    for rank, keys in enumerate(asked.manoeuvres, 1):
        told = (float(keys["start_angle_deg"]), float(keys["target_angle_deg"]), bool(keys["shell"]))
        manoeuvre = Manoeuvre("next", *told, float(keys["supply_V"]))
        trajectory = _made(drawn, first, manoeuvre)
        if trajectory:
            return _Found(manoeuvre, trajectory, rank)
    return None


def _random(drawn: Drawn, first: First) -> _Found | None:
    """Draw manoeuvres over the travel, both loads and the supply until the arm can make one."""
    rng = np.random.default_rng([*first.key, 4])
    for rank in range(1, 1 + TRIES):
        start, target = (round(float(angle), 1) for angle in rng.uniform(*TRAVEL_DEG, 2))
        shell, supply = bool(rng.random() < 0.5), round(float(rng.uniform(*SUPPLY)), 1)
        if abs(target - start) < APART_DEG:
            continue
        manoeuvre = Manoeuvre("next", start, target, shell, supply)
        trajectory = _made(drawn, first, manoeuvre)
        if trajectory:
            return _Found(manoeuvre, trajectory, rank)
    return None


def _made(drawn: Drawn, first: First, manoeuvre: Manoeuvre) -> Trajectory | None:
    """Simulate a stroke; None where the arm would leave its travel or outrun the gyro."""
    try:
        found = simulate(Motion(drawn.arm, manoeuvre, first.case().effects()), drawn.duration_s, TOLERANCE)
    except RefusalError:
        return None
    return found if float(np.abs(found.gyro).max()) < FASTEST else None


def _with(drawn: Drawn, found: _Found) -> Drawn:
    """Add a stroke to train on."""
    strokes = (*drawn.strokes, (found.manoeuvre, "train"))
    return replace(drawn, strokes=strokes, trajectories=(*drawn.trajectories, found.trajectory))
