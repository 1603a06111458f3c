"""Draw a blind campaign's arm and what it is told to do; reckon what its effects do, by the stand alone."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from stand import RefusalError
from stand.arm import GRAVITY, Arm, Manoeuvre
from stand.blind.suite import Case, Suite
from stand.gyro import Gyro, rms
from stand.motion import SAMPLES_PER_SECOND, Motion, Trajectory, simulate

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


def draw(suite: Suite, case: Case, rng: np.random.Generator, strokes_of: Strokes) -> Drawn:
    """Draw parameters and manoeuvres until the arm, effects included, makes every stroke inside its travel.

    `strokes_of` draws the manoeuvres. Raises RefusalError when no draw does.
    """
    noise = round(float(rng.uniform(*suite.noise_deg_s)), 4)
    gyro = Gyro(noise, 0.001, suite.bandwidth_hz if case.coloured else 0.0)
    for _ in range(TRIES):
        arm = draw_arm(suite, rng)
        duration = round(float(rng.uniform(*suite.duration_s)), 2)
        strokes = strokes_of(rng)
        found = [run(Motion(arm, manoeuvre, case.effects()), duration) for manoeuvre, _ in strokes]
        trajectories = tuple(each for each in found if each is not None)
        if len(trajectories) == len(strokes):
            return Drawn(arm, strokes, duration, gyro, trajectories)
    raise RefusalError(f"no arm and manoeuvres for case {case.index} ({case.label}) were found in {TRIES} draws")


def draw_arm(suite: Suite, rng: np.random.Generator) -> Arm:
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


def one_stroke(rng: np.random.Generator) -> tuple[tuple[Manoeuvre, str], ...]:
    """Give the paper's lowering stroke; half of the campaigns hold a repeat of it out."""
    repeat = ((replace(PAPERS, name="again"), "holdout"),)
    return ((PAPERS, "train"), *(repeat if rng.random() < 0.5 else ()))


def run(motion: Motion, duration: float, must_close: bool = True) -> Trajectory | None:
    """Simulate a stroke; None when it leaves the travel or is too fast for the gyro.

    None as well, when it must close its loop, and closed loop does not last for 0.2 s of the record.
    """
    try:
        found = simulate(motion, duration, TOLERANCE)
    except RefusalError:
        return None
    closes = found.switch_s is not None and found.switch_s < duration - 0.2
    return found if float(np.abs(found.gyro).max()) < FASTEST and (closes or not must_close) else None


FloatArray = npt.NDArray[np.float64]


def declared_speeds(pairs: Sequence[tuple[Arm, Manoeuvre]], n_samples: int) -> FloatArray:
    """Simulate the declared arm, with no stops at the ends of its travel; speeds at 1 kHz, (n_lanes, n_samples).

    Each pair of an arm and a manoeuvre is a lane; the arms may differ in p0, k, eta3 and n alone. Steps of Runge and
    Kutta's fourth order, 1 ms long, of which the one over the switch E is taken in two; good to 5e-4 rad/s at the
    worst sample and 3e-5 rad/s rms, a hundredth of the noise.
    """
    arms, strokes = zip(*pairs, strict=True)
    arm, loads = arms[0], [arm.load(stroke.shell) for arm, stroke in pairs]
    p0, n = (np.array([getattr(a, name) for a in arms]) for name in ("p0", "n"))
    told = np.array([(stroke.start, stroke.target, stroke.supply_volt) for stroke in strokes])
    start, target, supply = np.ascontiguousarray(told.T)
    damping = np.array([a.speed_gain * a.k for a in arms])
    inertia = np.array([a.inertia(stroke.shell) for a, stroke in pairs])
    moment = np.array([load.mass * GRAVITY * load.lever for load in loads])
    drive = np.array([2.0 * a.torque_constant * a.excitation * a.ratio_motor * a.eta1 * a.eta2 * a.eta3 for a in arms])

    def rates(state: FloatArray, closed: FloatArray) -> FloatArray:
        """Give d(angle, speed, current)/dt, (3, n_lanes), by paper Eqs 1-7; `closed` tells which lanes are past E."""
        angle, speed, current = state
        squeezed = arm.piston_area * arm.piston_lever * (angle - arm.travel[0]) / arm.gas_volume
        pressure = p0 * np.maximum(1.0 - squeezed, 1e-3) ** -n
        torque = drive * np.abs(current) * current - arm.piston_lever * arm.piston_area * pressure
        torque += moment * np.cos(angle + arm.gravity_angle)
        demand = arm.position_gain * (target - angle) - damping * speed
        asked = np.clip(np.abs(demand) - arm.threshold, 0.0, supply) * np.sign(demand)
        voltage = np.where(closed, asked, supply * np.sign(target - start))
        emf = arm.emf_constant * arm.excitation * arm.ratio_motor * np.abs(current) * speed
        return np.array((speed, torque / inertia, (voltage - arm.resistance * current - emf) / arm.inductance))

    def step(state: FloatArray, closed: FloatArray, length: FloatArray) -> FloatArray:
        first = rates(state, closed)
        second = rates(state + 0.5 * length * first, closed)
        third = rates(state + 0.5 * length * second, closed)
        fourth = rates(state + length * third, closed)
        return state + length / 6.0 * (first + 2.0 * (second + third) + fourth)

    def to_switch(state: FloatArray) -> FloatArray:
        return np.abs(target - state[0]) - arm.switch_distance

    state = np.array((start, np.zeros_like(start), np.zeros_like(start)))
    closed, whole = to_switch(state) <= 0.0, np.full_like(start, 1.0 / SAMPLES_PER_SECOND)
    speeds = np.zeros((n_samples, start.size))
    for sample in range(1, n_samples):
        after = step(state, closed, whole)
        crossed = ~closed & (to_switch(after) <= 0.0)
        if crossed.any():
            before = to_switch(state)
            share = np.where(crossed, before / np.where(crossed, before - to_switch(after), 1.0), 1.0)
            halfway = step(state, closed, share * whole)
            closed = closed | crossed
            after = step(halfway, closed, (1.0 - share) * whole)
        state = after
        speeds[sample] = state[1]
    return speeds.T


Ranges = Mapping[str, tuple[float, float]]
DIFFERENCE = 1e-4
"""Step of the derivatives, as a share of a parameter's search range."""


def misses(arms: Sequence[Arm], manoeuvres: Sequence[Manoeuvre], speeds: FloatArray) -> FloatArray:
    """Give what declared arms depart from speeds [rad/s], (n_arms, n_strokes, n_samples)."""
    found = declared_speeds([(arm, manoeuvre) for arm in arms for manoeuvre in manoeuvres], speeds.shape[1])
    return found.reshape(len(arms), *speeds.shape) - speeds


def fit_declared(manoeuvres: Sequence[Manoeuvre], speeds: FloatArray, truth: Arm, ranges: Ranges) -> Arm:
    """Fit p0, k, eta3, n of the declared model to speeds without noise [rad/s], (n_strokes, n_samples).

    Least squares from the truth on; each parameter runs from 0 to 1 over its search range.
    """
    low = np.array([edges[0] for edges in ranges.values()])
    width = np.array([edges[1] for edges in ranges.values()]) - low

    def arm_at(point: FloatArray) -> Arm:
        return replace(truth, **dict(zip(ranges, (low + point * width).tolist(), strict=True)))

    @lru_cache(maxsize=2)
    def tried(point: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
        """Give misses and their derivatives; both take one pass, since a pass costs little more with more lanes."""
        shifts = DIFFERENCE * np.vstack((np.zeros(width.size), np.eye(width.size), -np.eye(width.size)))
        arms = [arm_at(np.array(point) + shift) for shift in shifts]
        found = misses(arms, manoeuvres, speeds).reshape(len(shifts), -1)
        forward, backward = found[1 : 1 + width.size], found[1 + width.size :]
        return found[0], (forward - backward).T / (2.0 * DIFFERENCE)

    start = (np.array([getattr(truth, name) for name in ranges]) - low) / width
    missed, slopes = (lambda point, i=i: tried(tuple(point.tolist()))[i] for i in (0, 1))
    best = least_squares(missed, start, slopes, bounds=(0.0, 1.0), ftol=1e-4, xtol=1e-4, max_nfev=20)
    return arm_at(best.x)


MATTERS = 1.2
"""Effects matter when they raise the held-out error to this multiple of its noise."""


def weigh(drawn: Drawn, ranges: Ranges, floor: float | None) -> dict[str, Any]:
    """Fit the declared model to the true speeds of the train strokes, and tell what it leaves in each role [rad/s].

    `holdout_ratio` is the held-out error over its noise, `floor`; None without holdout.
    """
    shown = {}
    for role in ("train", "holdout"):
        places = [i for i, (_, each) in enumerate(drawn.strokes) if each == role]
        shown[role] = [drawn.strokes[i][0] for i in places], np.array([drawn.trajectories[i].gyro for i in places])
    arm = fit_declared(*shown["train"], drawn.arm, ranges)
    left = {role: rms(misses([arm], *some)) if some[0] else None for role, some in shown.items()}
    held = left["holdout"]
    ratio = None if held is None or not floor else brief(math.hypot(held, floor) / floor)
    return {
        "left_train": brief(left["train"]), "left_holdout": brief(held), "holdout_ratio": ratio,
        "matters": None if ratio is None else ratio > MATTERS,
    }  # fmt: skip


def brief(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")
