"""A drive of two inertias with four outputs, and records of it that scipy makes: no line of the engine is in them."""

from functools import cache
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from armid.model import Constant, Input, Output, Parameter, Plant, Scales, State
from armid.record import write_campaign

two_inertias = Plant(
    name="two_inertias",
    note="a motor drives a load through an elastic shaft",
    parameters=(
        Parameter("motor", "kg m2", 0.02, 0.3), Parameter("load", "kg m2", 0.02, 0.3),
        Parameter("stiffness", "N m/rad", 5.0, 80.0), Parameter("damping", "N m s/rad", 0.0, 1.0),
    ),
    states=(
        State("q", "rad", lambda v: v, lambda start_motor: start_motor),
        State("v", "rad/s", lambda u, shaft, torque, motor: (u - shaft + torque) / motor,
              lambda start_motor_speed: start_motor_speed),
        State("p", "rad", lambda w: w, lambda start_load: start_load),
        State("w", "rad/s", lambda shaft, load: shaft / load, lambda start_load_speed: start_load_speed),
    ),
    quantities={"shaft": lambda stiffness, damping, q, p, v, w: stiffness * (q - p) + damping * (v - w),
                "recorded_speed": lambda v, output: v + output, "deflection": lambda p, q: p - q,
                "recorded_load": lambda p, load_sensor: p + load_sensor},
    constants=tuple(Constant(name, 0.0, unit) for name, unit in (
        ("start_motor", "rad"), ("start_motor_speed", "rad/s"), ("start_load", "rad"), ("start_load_speed", "rad/s"))),
    inputs=(Input("u", "N m", ("drive_N_m",)),),
    ports={"torque": "N m", "output": "rad/s", "load_sensor": "rad"},
    outputs=(
        Output("motor_speed", "recorded_speed", "rad/s", port="output"),
        Output("load_angle", "recorded_load", "rad", ("load_angle_deg",), port="load_sensor"),
        Output("deflection", "deflection", "rad"), Output("load_speed", "w", "rad/s"),
    ),
    aliases={"omega": "v", "theta": "q", "speed": "v", "position": "q", "load_effort": "shaft"},
    scales=Scales(effort=2.0, speed=5.0),
    from_rest=False,
)  # fmt: skip

TRUTH = {"motor": 0.1, "load": 0.08, "stiffness": 25.0, "damping": 0.12}
INTERVAL, NOISE_SPEED, NOISE_ANGLE = 0.004, 0.02, 0.002


def drive(n_samples, pace):
    times = INTERVAL * np.arange(n_samples)
    return 1.2 * np.sin(2.0 * pace * times) + 0.8 * np.sin(5.3 * pace * times + 0.4)


@cache
def motion(n_samples, pace, start, friction):
    """Return the motion of a record; the integrator is slow, and many tests want the same ones."""
    return oracle(drive(n_samples, pace), np.array(start), friction)


def oracle(u, start, friction=0.0, truth=TRUTH):
    """Return motor and load angle and speed at the samples; friction: Coulomb, of the motor [N m], width 0.025 rad/s.

    start: q, v, p, w. The drive runs straight between samples, so that each interval is integrated by itself.
    """
    j1, j2, k, d = (truth[n] for n in ("motor", "load", "stiffness", "damping"))
    states = [np.asarray(start, dtype=float)]
    for u0, u1 in pairwise(u):

        def rates(t, x, u0=u0, u1=u1):
            q, v, p, w = x
            torque = k * (q - p) + d * (v - w)
            dry = friction * v / np.sqrt(v**2 + 0.025**2)
            return [v, (u0 + (u1 - u0) * t / INTERVAL - torque - dry) / j1, w, torque / j2]

        states.append(solve_ivp(rates, (0.0, INTERVAL), states[-1], rtol=1e-9, atol=1e-11).y[:, -1])
    q, v, p, w = np.array(states).T
    return {"q": q, "v": v, "p": p, "w": w}


def made_columns(seed, n_samples, pace, start, friction=0.0, bias=0.0):
    """Return the columns of a noisy record; bias: of the load's angle [rad]."""
    u, rng = drive(n_samples, pace), np.random.default_rng(seed)
    moved = motion(n_samples, pace, tuple(start), friction)
    angle = moved["p"] + bias + rng.normal(0.0, NOISE_ANGLE, n_samples)
    return {
        "time_s": INTERVAL * np.arange(n_samples), "drive_N_m": u,
        "motor_speed_rad_s": moved["v"] + rng.normal(0.0, NOISE_SPEED, n_samples),
        "load_angle_deg": np.rad2deg(angle),
        "deflection_deg": np.rad2deg(moved["p"] - moved["q"] + rng.normal(0.0, NOISE_ANGLE, n_samples)),
    }  # fmt: skip


def write_drive(folder, friction=0.0, bias=0.0, more=""):
    """Write a campaign: two records to train, the second in motion at its start and with one output; one held out."""
    starts = {"a": np.zeros(4), "b": np.array([0.3, 2.0, 0.25, 1.6]), "c": np.array([-0.2, 1.0, -0.2, 1.2])}
    tables = {
        f"{name}.csv": made_columns(i, 700, pace, starts[name], friction, bias)
        for i, (name, pace) in enumerate((("a", 1.0), ("b", 1.4), ("c", 0.8)))
    }
    del tables["b.csv"]["motor_speed_rad_s"], tables["b.csv"]["deflection_deg"]
    toml = 'name = "drive"\nplant = "two_inertias"\n' + "".join(
        f'[[records]]\nfile = "{name}.csv"\nrole = "{"holdout" if name == "c" else "train"}"\n{more}' for name in "abc"
    )
    return write_campaign(folder, toml, tables)
