"""Make the records of `campaign/`: a boom that does what plant.py does not declare.

SYNTHETIC: a simulation with scipy that shares no code with armid.

    python studies/your_own_machine/make_records.py FOLDER [SEED]

The truth: friction in proportion to the load of the gear, a speed signal that lags, a supply that sags under the
current, a logger that samples every 5 ms but never exactly then.
"""

import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
TRUTH = {"inertia": 0.8, "motor_constant": 1.6, "boom_moment": 4.0}  # kg m2, N m/A, N m
FRICTION, LAG_S = 0.15, 0.012  # of the load of the gear; time constant of the speed signal
RESISTANCE, IDLE_V, SOURCE_OHM = 2.0, 24.0, 0.35
NOISE_DEG_S, NOISE_V, ENCODER_DEG = 0.8, 0.02, 0.01
INTERVAL_S, JITTER, DURATION_S = 0.005, 0.2, 4.0
SHARP = 0.01  # rad/s over which friction changes its sign


@dataclass(frozen=True)
class Run:
    """Declare one record: its gains [V/rad, V s/rad], its moves (from s, to s, by deg), when the drive goes off [s]."""

    kp: float
    kd: float
    moves: tuple[tuple[float, float, float], ...]
    off_s: float = np.inf
    role: str = "train"


RUNS = {
    "stiff": Run(90.0, 3.0, ((0.2, 0.7, 70.0), (1.4, 1.6, -50.0), (2.4, 3.4, 60.0))),
    "soft": Run(35.0, 1.0, ((0.2, 0.4, 60.0), (1.8, 2.6, -90.0))),
    "limit": Run(120.0, 4.0, ((0.2, 0.45, 100.0), (1.6, 1.9, -140.0), (3.0, 3.3, 60.0))),
    "switched_off": Run(60.0, 2.0, ((0.2, 1.0, 110.0),), off_s=1.6),
    "other_moves": Run(60.0, 2.0, ((0.2, 0.5, -60.0), (1.3, 2.3, 100.0), (2.9, 3.1, -40.0)), role="holdout"),
    "off_while_moving": Run(45.0, 1.5, ((0.2, 0.6, -100.0), (1.5, 2.1, 130.0)), off_s=1.8, role="holdout"),
}


def target(run: Run, time: float | Array) -> Array:
    """Return the commanded position [rad]: smooth moves, each of zero speed and acceleration at both ends."""
    position = np.zeros_like(np.asarray(time, dtype=float))
    for begin, end, by in run.moves:
        z = np.clip((np.asarray(time) - begin) / (end - begin), 0.0, 1.0)
        position = position + np.deg2rad(by) * z**3 * (10.0 - 15.0 * z + 6.0 * z**2)
    return position


def electric(run: Run, time: float | Array, q: Array, v: Array) -> tuple[Array, Array]:
    """Return current [A] and supply voltage [V]: the supply sags under the current that it gives."""
    k = TRUTH["motor_constant"]
    demand = run.kp * (target(run, time) - q) - run.kd * v
    on = np.where(np.asarray(time) < run.off_s, 1.0, 0.0)
    # in the limit the voltage is the supply's: s = U - r |I|, I = +-(s -+ k v)/R
    upper = (IDLE_V - SOURCE_OHM * -k * v / RESISTANCE) / (1.0 + SOURCE_OHM / RESISTANCE)
    lower = -(IDLE_V + SOURCE_OHM * -k * v / RESISTANCE) / (1.0 + SOURCE_OHM / RESISTANCE)
    current = on * (np.clip(demand, lower, upper) - k * v) / RESISTANCE
    return current, IDLE_V - SOURCE_OHM * np.abs(current)


def rates(time: float, y: Array, run: Run) -> list[float]:
    """Return the rates of position, speed and recorded speed."""
    q, v, recorded = y
    drive = TRUTH["motor_constant"] * float(electric(run, time, q, v)[0])
    gravity = -TRUTH["boom_moment"] * np.sin(q)
    friction = FRICTION * abs(drive - gravity) / 2.0 * v / np.hypot(v, SHARP)
    return [v, (drive + gravity - friction) / TRUTH["inertia"], (v - recorded) / LAG_S]


def motion(run: Run, times: Array) -> Array:
    """Return position, speed and recorded speed at the times, (3, n_samples); the solver stops where the drive does."""
    y, parts = np.zeros(3), []
    edges = [times[0], *([run.off_s] if run.off_s < times[-1] else []), times[-1]]
    for begin, end in pairwise(edges):
        own = times[(times >= begin) & (times <= end)] if end == times[-1] else times[(times >= begin) & (times < end)]
        # just before its end a part still has the drive of its beginning
        found = solve_ivp(rates, (begin, np.nextafter(end, 0.0)), y, args=(run,), method="LSODA", rtol=1e-9, atol=1e-10,
                          max_step=2e-3, dense_output=True)  # fmt: skip
        parts.append(found.sol(np.minimum(own, found.t[-1])))
        y = found.y[:, -1]
    return np.concatenate(parts, axis=1)


def record(run: Run, rng: np.random.Generator) -> dict[str, Array]:
    """Return header -> column of one record."""
    n = int(DURATION_S / INTERVAL_S) + 1
    times = INTERVAL_S * np.arange(n)
    times[1:] += JITTER * INTERVAL_S * rng.uniform(-1.0, 1.0, n - 1)
    times = np.round(times, 6)
    if run.off_s < np.inf:
        # the computer that logs also switches, so the log knows when
        run = replace(run, off_s=float(times[np.searchsorted(times, run.off_s)]))
    q, v, recorded = motion(run, times)
    _, supply = electric(run, times, q, v)
    return {
        "time_s": times,
        "angular_velocity_deg_s": np.round(np.rad2deg(recorded) + rng.normal(0.0, NOISE_DEG_S, n), 2),
        "angle_deg": np.round(np.rad2deg(q) / ENCODER_DEG) * ENCODER_DEG,
        "target_deg": np.round(np.rad2deg(target(run, times)), 4),
        "supply_V": np.round(supply + rng.normal(0.0, NOISE_V, n), 2),
        "drive_on": np.where(times < run.off_s, 1.0, 0.0),
    }


def campaign_text() -> str:
    text = "# SYNTHETIC: made by studies/your_own_machine/make_records.py; no machine was measured.\n"
    text += f"# Truth: {', '.join(f'{k} = {v:g}' for k, v in TRUTH.items())}.\n"
    text += f"# Undeclared: friction of {FRICTION:g} times the load of the gear, a speed signal {LAG_S:g} s late.\n"
    text += 'name = "boom"\nplant = "boom"\n'
    for name, run in RUNS.items():
        text += f'\n[[records]]\nfile = "{name}.csv"\nrole = "{run.role}"\n'
        text += f"[records.constants]\nkp = {run.kp}\nkd = {run.kd}\n"
    return text


def main(folder: Path, seed: int = 1) -> None:
    """Write campaign.toml and one CSV file a record; seed: of noise and sampling times."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "campaign.toml").write_text(campaign_text(), encoding="utf-8")
    rng = np.random.default_rng(seed)
    for name, run in RUNS.items():
        columns = record(run, rng)
        rows = zip(*columns.values(), strict=True)
        lines = [",".join(columns), *(",".join(f"{x:.10g}" for x in row) for row in rows)]
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:3]))
