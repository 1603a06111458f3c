"""SYNTHETIC campaigns of library plants, with friction that none of them declares."""

from functools import cache

import numpy as np

from synthetic import moved, write_records

DEGREE = np.deg2rad(1.0)
# Seconds and pace of the drive of each file; the last one is held out.
STROKES = {"a.csv": (4.0, 1.0), "b.csv": (3.0, 1.7), "c.csv": (3.5, 0.8)}


def arm(x, u, friction):
    """Rotary arm: inertia 0.04, m g l 0.5, damping 0.02."""
    return np.array([x[1], (u - 0.5 * np.sin(x[0]) - 0.02 * x[1] - friction * np.tanh(x[1] / 0.05)) / 0.04])


def axis(x, u, friction):
    """Linear axis: 1.5 kg."""
    return np.array([x[1], (u - friction * np.tanh(x[1] / 0.01) - 0.3 * friction * x[1]) / 1.5])


def link(x, u, friction):
    """Flexible link: hub 0.06, tip 0.02, stiffness 8, dampings 0.4 and 0.01."""
    couple = 8.0 * x[2] + 0.01 * x[3]
    a = (u - 0.4 * x[1] + couple - friction * np.tanh(x[1] / 0.02)) / 0.06
    return np.array([x[1], a, x[3], -couple / 0.02 - a])


RATES = {"rotary_arm": arm, "driven_axis": axis, "flexible_link": link}


@cache
def motion(name, file, friction, interval, size, start):
    """Return times, drive and states of a file: many tests want the same ones."""
    seconds, pace = STROKES[file]
    times = np.arange(0.0, seconds, interval)
    u = size * (0.7 * np.sin(3.0 * pace * times) + 0.4 * np.sin(7.1 * pace * times + 0.5))
    rates, substeps = RATES[name], 8 if name == "flexible_link" else 1
    return times, u, moved(lambda x, v: rates(x, v, friction), u, interval, start, substeps=substeps)


def written(folder, name, friction, interval, start, drive, columns):
    """Write a campaign. drive: its column and size; columns: header -> state, its size in SI, its noise in its unit."""
    tables, rng = {}, np.random.default_rng(1)
    for file in STROKES:
        times, u, states = motion(name, file, friction, interval, drive[1], start)
        tables[file] = {"time_s": times, drive[0]: u}
        for header, (place, size, noise) in columns.items():
            tables[file][header] = states[:, place] / size + rng.normal(0.0, noise, times.size)
    return write_records(folder, f'name = "made"\nplant = "{name}"\n', tables)


def write_arm(folder, friction=0.0, outputs="angle", interval=0.01, noise=1.0, size=0.6):
    """Write a rotary arm; outputs: "angle", "speed" or "both"; noise: times 0.1 deg and 1 deg/s."""
    columns = {"angle_deg": (0, DEGREE, 0.1 * noise), "angular_velocity_deg_s": (1, DEGREE, noise)}
    columns.pop({"angle": "angular_velocity_deg_s", "speed": "angle_deg"}.get(outputs, ""), None)
    return written(folder, "rotary_arm", friction, interval, (0.1, 0.0), ("drive_N_m", size), columns)


def write_axis(folder, friction=0.0, position=True):
    """Write a linear axis with its speed (noise of 2 mm/s) and, if wished, its position."""
    columns = {"velocity_m_s": (1, 1.0, 0.002)} | ({"position_m": (0, 1.0, 2e-4)} if position else {})
    return written(folder, "driven_axis", friction, 0.004, (0.02, 0.0), ("drive_N", 4.0), columns)


def write_link(folder, friction=0.0, outputs=("hub_angle_deg", "deflection_deg"), noise=1.0):
    """Write a flexible link; noise: times 0.1 deg (hub), 0.05 deg (deflection) and 1 deg/s (speeds)."""
    states = {"hub_angle_deg": (0, 0.1), "hub_speed_deg_s": (1, 1.0), "deflection_deg": (2, 0.05),
              "deflection_speed_deg_s": (3, 1.0)}  # fmt: skip
    columns = {name: (states[name][0], DEGREE, states[name][1] * noise) for name in outputs}
    return written(folder, "flexible_link", friction, 0.008, (0.0,) * 4, ("drive_N_m", 1.5), columns)
