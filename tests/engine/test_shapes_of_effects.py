"""Shapes that rest unless they are set free, against the test stand's own equations of them."""

import numpy as np
import pytest
from arm_stand import stand_speed
from numpy.typing import NDArray

from armid.engine import Schedule, simulate
from armid.model import EFFECTS, PLANTS, Manoeuvre, Model

CANDIDATE = np.array([3.05e6, 1.0, 0.55, 1.4])
# At the stop of 0.01 rad of a tray of 6 Hz the spring is twice as stiff.
HARDENING = 1 / ((2 * np.pi * 6.0) ** 2 * 0.01) ** 2
SHAPES = {
    "stribeck": (
        "exponent",
        {"level": 60.0, "fade": 0.12, "exponent": 1.0, "width": 0.02},
        {"stribeck": 60.0, "stribeck_speed": 0.12, "stribeck_exponent": 1.0, "stribeck_width": 0.02},
    ),
    "winding_heating": ("cooling", {"rise": 6e-5, "cooling": 2.0}, {"winding_heating": 6e-5, "winding_cooling": 2.0}),
    "shell_rocking": (
        "hardening",
        {"inertia_share": 45.5 * 0.85**2, "frequency": 6.0, "damping_ratio": 0.05, "hardening": HARDENING},
        {"rocking_hz": 6.0, "rocking_damping": 0.05, "rocking_stop": 0.01},
    ),
    "controller_delay": ("period", {"delay": 0.0, "period": 0.016}, {"controller_period": 0.016}),
}  # fmt: skip
# The hold of a sampled control is its mean lateness here, not a staircase.
ALLOWED = {"controller_delay": 0.02}


Array = NDArray[np.float64]


def moved(name: str, manoeuvre: Manoeuvre, values: dict[str, float]) -> Array:
    """Speed of the arm with one effect; shapes that are not told rest, (n_samples,)."""
    model = Model(PLANTS["shell_transfer_arm"], (EFFECTS[name],))
    known = {n: p.fixed for n, p in model.parameters.items() if p.fixed is not None}
    known |= dict(zip(("p0", "k", "eta3", "n"), CANDIDATE, strict=True))
    known |= {f"{name}.{n}": v for n, v in values.items()}
    candidate = np.array([[known[n] for n in model.parameters]])
    return np.asarray(simulate(model, manoeuvre, candidate, Schedule(16)).output[0])


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("stroke", ["lower", "raise"])
def test_a_shape_moves_the_arm_as_the_test_stand_does(name: str, stroke: str, manoeuvres: dict[str, Manoeuvre]) -> None:
    shape, values, stand = SHAPES[name]
    stood = stand_speed(stroke, CANDIDATE, **stand)
    assert stood is not None
    with_it, without = (
        np.abs(moved(name, manoeuvres[stroke], v) - stood[0]).max()
        for v in (values, {n: v for n, v in values.items() if n != shape})
    )
    assert with_it <= ALLOWED.get(name, 1e-6)
    assert with_it < 0.5 * without
