"""SYNTHETIC campaigns of library plants, by Runge-Kutta steps of their own: no line of the engine is in them."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armid.record import write_campaign

Array = NDArray[np.float64]
# Seconds, pace of the drive, generator -> columns of a record.
Columns = Callable[[float, float, np.random.Generator], Mapping[str, Array]]
# What a record is made of: seconds, sample interval, pace of the drive, its role.
STROKES = {"a.csv": (4.0, 1.0, "train"), "b.csv": (3.0, 1.7, "train"), "c.csv": (3.5, 0.8, "holdout")}


def motion(rates: Callable[[Array, float], Array], u: Array, interval: float, start: Array) -> Array:
    """Return the states at the samples, (n_samples, n_states); the drive runs straight between samples."""
    states = [np.asarray(start, dtype=float)]
    for now, after in pairwise(u):
        x, half, h = states[-1], 0.5 * (now + after), interval
        k1 = rates(x, now)
        k2 = rates(x + 0.5 * h * k1, half)
        k3 = rates(x + 0.5 * h * k2, half)
        states.append(x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rates(x + h * k3, after)))
    return np.array(states)


def arm(x: Array, u: float, friction: float) -> Array:
    """Rotary arm: inertia 0.04, m g l 0.5, damping 0.02."""
    return np.array([x[1], (u - 0.5 * np.sin(x[0]) - 0.02 * x[1] - friction * np.tanh(x[1] / 0.05)) / 0.04])


def axis(x: Array, u: float, friction: float) -> Array:
    """Linear axis: 1.5 kg."""
    return np.array([x[1], (u - friction * np.tanh(x[1] / 0.01) - 0.3 * friction * x[1]) / 1.5])


def link(x: Array, u: float, friction: float) -> Array:
    """Flexible link: hub 0.06, tip 0.02, stiffness 8, dampings 0.4 and 0.01."""
    couple = 8.0 * x[2] + 0.01 * x[3]
    a = (u - 0.4 * x[1] + couple - friction * np.tanh(x[1] / 0.02)) / 0.06
    return np.array([x[1], a, x[3], -couple / 0.02 - a])


def swing(times: Array, pace: float, size: float) -> Array:
    return size * (0.7 * np.sin(3.0 * pace * times) + 0.4 * np.sin(7.1 * pace * times + 0.5))


def written(folder: Path, toml: str, columns_of: Columns, seed: int) -> Path:
    rng = np.random.default_rng(seed)
    tables = {file: columns_of(seconds, pace, rng) for file, (seconds, pace, _) in STROKES.items()}
    records = "".join(f'[[records]]\nfile = "{file}"\nrole = "{role}"\n' for file, (_, _, role) in STROKES.items())
    return write_campaign(folder, f"{toml}\n{records}", tables)


def write_arm(folder: Path, friction: float = 0.0, outputs: str = "angle", interval: float = 0.01,
              noise: float = 1.0, size: float = 0.6, seed: int = 1) -> Path:  # fmt: skip
    """Write a rotary arm; outputs: "angle", "speed" or "both"; noise: times 0.1 deg and 1 deg/s."""

    def columns(seconds: float, pace: float, rng: np.random.Generator) -> dict[str, Array]:
        times = np.arange(0.0, seconds, interval)
        u = swing(times, pace, size)
        angle, speed = np.rad2deg(motion(lambda x, v: arm(x, v, friction), u, interval, [0.1, 0.0])).T
        found = {"time_s": times, "drive_N_m": u}
        if outputs in ("angle", "both"):
            found["angle_deg"] = angle + rng.normal(0.0, 0.1 * noise, times.size)
        if outputs in ("speed", "both"):
            found["angular_velocity_deg_s"] = speed + rng.normal(0.0, noise, times.size)
        return found

    return written(folder, 'name = "arm"\nplant = "rotary_arm"', columns, seed)


def write_axis(folder: Path, friction: float = 0.0, position: bool = True, interval: float = 0.004,
               noise: float = 1.0, size: float = 4.0, seed: int = 1) -> Path:  # fmt: skip
    """Write a linear axis with its speed and, if wished, its position; noise: times 2 mm/s."""

    def columns(seconds: float, pace: float, rng: np.random.Generator) -> dict[str, Array]:
        times = np.arange(0.0, seconds, interval)
        u = swing(times, pace, size)
        place, speed = motion(lambda x, v: axis(x, v, friction), u, interval, [0.02, 0.0]).T
        found = {"time_s": times, "drive_N": u, "velocity_m_s": speed + rng.normal(0.0, 0.002 * noise, times.size)}
        return found | ({"position_m": place + rng.normal(0.0, 2e-4, times.size)} if position else {})

    return written(folder, 'name = "axis"\nplant = "driven_axis"', columns, seed)


def write_link(folder: Path, friction: float = 0.0, outputs: tuple[str, ...] = ("hub_angle", "deflection"),
               interval: float = 0.008, noise: float = 1.0, size: float = 1.5, seed: int = 1) -> Path:  # fmt: skip
    """Write a flexible link; noise: times 0.1 deg (hub), 0.05 deg (deflection) and 1 deg/s (speeds)."""
    states = {"hub_angle": (0, 0.1), "hub_speed": (1, 1.0), "deflection": (2, 0.05), "deflection_speed": (3, 1.0)}

    def columns(seconds: float, pace: float, rng: np.random.Generator) -> dict[str, Array]:
        times = np.arange(0.0, seconds, interval)
        u = swing(times, pace, size)
        fine = np.interp(np.arange(0.0, times[-1], interval / 8.0), times, u)
        moved = np.rad2deg(motion(lambda x, v: link(x, v, friction), fine, interval / 8.0, np.zeros(4)))[::8]
        moved = np.concatenate([moved, moved[-1:]])[: times.size]
        found = {"time_s": times, "drive_N_m": u}
        for name in outputs:
            place, level = states[name]
            unit = "deg_s" if name.endswith("speed") else "deg"
            found[f"{name}_{unit}"] = moved[:, place] + rng.normal(0.0, level * noise, times.size)
        return found

    return written(folder, 'name = "link"\nplant = "flexible_link"', columns, seed)
