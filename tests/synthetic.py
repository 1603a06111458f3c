"""SYNTHETIC campaigns: motions by steps of their own, no line of the engine in them, and the text that names files."""

from itertools import pairwise

import numpy as np

from armid.record import write_campaign


def moved(rates, drive, interval, start, hold="linear", substeps=1):
    """Return the states at the samples, (n_samples, n_states), of dx/dt = rates(x, drive), by Runge-Kutta steps."""
    states, h = [np.asarray(start, dtype=float)], interval / substeps
    for now, after in pairwise(drive):
        x, rise = states[-1], (after - now) / substeps if hold == "linear" else 0.0
        for u in now + rise * np.arange(substeps):
            k1 = rates(x, u)
            k2 = rates(x + 0.5 * h * k1, u + 0.5 * rise)
            k3 = rates(x + 0.5 * h * k2, u + 0.5 * rise)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rates(x + h * k3, u + rise))
        states.append(x)
    return np.array(states)


def wheel(drive, interval, gain, damping):
    """Return speed and angle of dv/dt = gain u - damping v from rest, exact where the drive is held."""
    speed, angle, kept = [0.0], [0.0], np.exp(-damping * interval)
    for u in drive[:-1]:
        speed.append(kept * speed[-1] + gain / damping * (1.0 - kept) * u)
        angle.append(angle[-1] + 0.5 * interval * (speed[-2] + speed[-1]))
    return np.array(speed), np.array(angle)


def write_records(folder, head, tables, holdout=1):
    """Write a campaign of some files, the last of them held out; return its folder."""
    roles = ["train"] * (len(tables) - holdout) + ["holdout"] * holdout
    entries = [f'[[records]]\nfile = "{file}"\nrole = "{role}"\n' for file, role in zip(tables, roles, strict=True)]
    return write_campaign(folder, head + "".join(entries), tables)
