"""The slow integrator by which contracts judge the engine is right itself."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armid.contract.trials import simulate_plainly
from armid.model import EFFECTS, PLANTS, Effect, Guard, Manoeuvre, Model, Parameter, State

REFERENCE = Path(__file__).parents[1] / "reference"
TIMES = 0.01 * np.arange(151)


@pytest.mark.parametrize("number", [0, 1, 6])
def test_agrees_with_reference_trajectories(number: int) -> None:
    with (REFERENCE / "index.csv").open(encoding="utf-8") as index:
        row = list(csv.DictReader(index))[number]
    expected = np.loadtxt(REFERENCE / row["file"], delimiter=",", skiprows=1)[:801:4, 2]
    constants = {
        "theta_C": np.deg2rad(float(row["start_angle_deg"])), "theta_D": np.deg2rad(float(row["target_angle_deg"])),
        "shell": float(row["shell"]), "U": float(row["supply_V"]),
    }  # fmt: skip
    candidate = np.array([float(row["p0_MPa"]) * 1e6, float(row["k"]), float(row["eta3"]), float(row["n"])])
    found = simulate_plainly(Model(PLANTS["shell_transfer_arm"]), Manoeuvre(0.004, 201, constants), candidate)[0]
    assert np.abs(found - expected).max() <= 2e-8


def drive(shape: str) -> Manoeuvre:
    values = {"ramp": 5.0 * TIMES, "steps": np.sign(np.sin(9.0 * TIMES)), "none": np.zeros(151)}[shape]
    return Manoeuvre(0.01, 151, {"start_speed": 0.9}, {"u": values})


def test_agrees_with_a_ramp_against_viscous_friction() -> None:
    found = simulate_plainly(Model(PLANTS["driven_axis"]) + EFFECTS["viscous"], drive("ramp"), np.array([3.0, 6.0]))[0]
    lag = 0.5
    expected = 5.0 / 6.0 * (TIMES - lag * (1.0 - np.exp(-TIMES / lag))) + 0.9 * np.exp(-TIMES / lag)
    np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_takes_the_drive_as_it_is_held(hold: str) -> None:
    manoeuvre = replace(drive("steps"), hold=hold)
    values = manoeuvre.inputs["u"]
    steps = values[:-1] if hold == "zero" else 0.5 * (values[1:] + values[:-1])
    expected = 0.9 + np.concatenate([[0.0], np.cumsum(steps)]) * 0.01 / 3.0
    np.testing.assert_allclose(simulate_plainly(Model(PLANTS["driven_axis"]), manoeuvre, np.array([3.0]))[0], expected,
                               atol=1e-10)  # fmt: skip


def still(time):
    """Distance to 0.5 s."""
    return 0.503 - time


def brake(on, level):
    """Constant effort after the switch."""
    return -level * on


def corner(v, level):
    """An effort with a corner at 0.7."""
    return -level * np.maximum(v - 0.7, 0.0)


def at_corner(v):
    """The corner."""
    return v - 0.7


def nothing():
    """Start at 0."""
    return 0.0


def pace(v):
    """Rate of what is counted."""
    return v


def test_switches_once_and_between_samples() -> None:
    late = Effect("late", (Parameter("level", "effort", 0, 9, null=0.0),), {"torque": brake},
                  guards=(Guard("on", still, latch=True),))  # fmt: skip
    found = simulate_plainly(Model(PLANTS["driven_axis"]) + late, drive("none"), np.array([3.0, 6.0]))[0]
    np.testing.assert_allclose(found, 0.9 - 2.0 * np.maximum(TIMES - 0.503, 0.0), atol=1e-9)


def test_lands_on_kinks_and_carries_added_states() -> None:
    """Above 0.7 the speed falls exponentially to it and never arrives."""
    bent = Effect("bent", (Parameter("level", "effort", 0, 9, null=0.0),), {"torque": corner},
                  (State("way", "m", pace, nothing),), (Guard("edge", at_corner),))  # fmt: skip
    found = simulate_plainly(Model(PLANTS["driven_axis"]) + bent, drive("none"), np.array([3.0, 6.0]))[0]
    np.testing.assert_allclose(found, 0.7 + 0.2 * np.exp(-2.0 * TIMES), atol=1e-9)
