"""A driven axis against motions that can be written down: inputs, holds, friction, a pendulum."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from armid.engine import Schedule, Simulation, calibrate, simulate
from armid.model import EFFECTS, PLANTS, Manoeuvre, Model

Array = NDArray[np.float64]
INTERVAL, N_SAMPLES = 0.01, 201
TIMES = INTERVAL * np.arange(N_SAMPLES)
MASS = 3.0


@pytest.fixture(scope="module")
def axis() -> Model:
    """Mass, then level and width of Coulomb friction, slope of viscous friction, constant effort."""
    return Model(PLANTS["driven_axis"]) + EFFECTS["coulomb"] + EFFECTS["viscous"] + EFFECTS["torque_offset"]


def move(axis: Model, drive: Array, level: float = 0.0, slope: float = 0.0, offset: float = 0.0, substeps: int = 4,
         hold: str = "linear", **constants: float) -> Simulation:  # fmt: skip
    """Move the mass; constants by name."""
    manoeuvre = Manoeuvre(INTERVAL, len(drive), constants, {"u": drive}, hold)
    return simulate(axis, manoeuvre, [MASS, level, 0.005, slope, offset], Schedule(substeps), states=True)


def test_a_constant_force_accelerates(axis: Model) -> None:
    found = move(axis, np.full(N_SAMPLES, 2.0), substeps=1)
    np.testing.assert_allclose(found.output[0], 2.0 * TIMES / MASS, rtol=1e-13)
    np.testing.assert_allclose(found.states["q"][0], TIMES**2 / MASS, rtol=1e-12)


def test_a_constant_effort_does_what_a_drive_does(axis: Model) -> None:
    found = move(axis, np.zeros(N_SAMPLES), offset=-0.7)
    np.testing.assert_allclose(found.output[0], -0.7 * TIMES / MASS, rtol=1e-12)


def test_gain_turns_the_drive_into_effort(axis: Model) -> None:
    found = move(axis, np.full(N_SAMPLES, 2.0), gain=-35.0)
    np.testing.assert_allclose(found.output[0], -70.0 * TIMES / MASS, rtol=1e-12)


def test_a_ramp_is_integrated_exactly(axis: Model) -> None:
    found = move(axis, 5.0 * TIMES, substeps=1)
    np.testing.assert_allclose(found.output[0], 2.5 * TIMES**2 / MASS, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("substeps", [1, 3])
def test_between_samples_the_drive_runs_straight(axis: Model, substeps: int) -> None:
    """A drive of arbitrary samples gives the trapezoidal sum."""
    drive = np.random.default_rng(1).normal(size=N_SAMPLES)
    expected = np.concatenate([[0.0], np.cumsum(0.5 * (drive[1:] + drive[:-1]))]) * INTERVAL / MASS
    np.testing.assert_allclose(move(axis, drive, substeps=substeps).output[0], expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("substeps", [1, 3])
def test_with_zero_hold_the_drive_keeps_its_last_sample(axis: Model, substeps: int) -> None:
    drive = np.random.default_rng(2).normal(size=N_SAMPLES)
    expected = np.concatenate([[0.0], np.cumsum(drive[:-1])]) * INTERVAL / MASS
    found = move(axis, drive, substeps=substeps, hold="zero")
    np.testing.assert_allclose(found.output[0], expected, rtol=1e-12, atol=1e-14)


def test_viscous_friction_slows_down_exponentially(axis: Model) -> None:
    found = move(axis, np.zeros(N_SAMPLES), slope=6.0, start_speed=1.5, start_position=-2.0)
    speed = 1.5 * np.exp(-6.0 * TIMES / MASS)
    np.testing.assert_allclose(found.output[0], speed, rtol=1e-8)
    np.testing.assert_allclose(found.states["q"][0], -2.0 + MASS / 6.0 * (1.5 - speed), rtol=1e-8)


def test_viscous_friction_against_a_ramp(axis: Model) -> None:
    """v = a/c (t - m/c (1 - exp(-c t/m)))."""
    found = move(axis, 4.0 * TIMES, slope=6.0)
    lag = MASS / 6.0
    np.testing.assert_allclose(found.output[0], 4.0 / 6.0 * (TIMES - lag * (1.0 - np.exp(-TIMES / lag))), atol=1e-9)


def test_coulomb_friction_stops_the_mass_and_leaves_it_there(axis: Model) -> None:
    """From v0 the mass slows down by level / m and stands from m v0 / level on, but for the smoothing."""
    level, start = 4.0, 0.9
    found = move(axis, np.zeros(N_SAMPLES), level=level, substeps=32, start_speed=start)
    stop = MASS * start / level
    expected = np.maximum(start - level * TIMES / MASS, 0.0)
    assert np.abs(found.output[0] - expected).max() <= 0.015
    assert np.abs(found.output[0][stop + 0.1 < TIMES]).max() <= 1e-6
    assert found.output[0].min() >= -1e-9


def test_coulomb_friction_holds_against_a_smaller_drive(axis: Model) -> None:
    """The mass creeps at the speed at which the smoothed friction balances the drive."""
    found = move(axis, np.full(N_SAMPLES, 2.0), level=4.0, substeps=32)
    assert found.output[0][-1] == pytest.approx(0.005 * 0.5 / np.sqrt(1.0 - 0.25), rel=1e-6)


def test_a_pendulum_swings_as_its_small_angle_says(axis: Model) -> None:
    found = move(axis, np.zeros(N_SAMPLES), gravity_moment=120.0, start_position=1e-4)
    rate = np.sqrt(120.0 / MASS)
    np.testing.assert_allclose(found.states["q"][0], 1e-4 * np.cos(rate * TIMES), atol=1e-11)
    np.testing.assert_allclose(found.output[0], -1e-4 * rate * np.sin(rate * TIMES), atol=1e-11)


@pytest.mark.parametrize("angle", [0.5, 2.0, 3.1])
def test_a_pendulum_keeps_its_energy(axis: Model, angle: float) -> None:
    still = np.zeros(801)
    found = move(axis, still, gravity_moment=120.0, start_position=angle, substeps=8)
    energy = 0.5 * MASS * found.output[0] ** 2 + 120.0 * (1.0 - np.cos(found.states["q"][0]))
    np.testing.assert_allclose(energy, energy[0], rtol=1e-7)
    assert found.output[0].min() < 0.0 < found.output[0].max()


def test_a_piece_started_midway_goes_on_as_the_whole(axis: Model) -> None:
    drive = np.sin(7.0 * TIMES)
    whole = move(axis, drive, level=0.3, slope=0.4, substeps=16, gravity_moment=3.0)
    start = {"start_position": whole.states["q"][0, 80], "start_speed": whole.states["v"][0, 80]}
    rest = move(axis, drive[80:], level=0.3, slope=0.4, substeps=16, gravity_moment=3.0, **start)
    np.testing.assert_allclose(rest.output[0], whole.output[0, 80:], atol=1e-12)


@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_halving_steps_divides_the_error_by_sixteen(axis: Model, hold: str) -> None:
    """Fourth order, whatever the drive does at its samples."""
    drive = np.sign(np.sin(9.0 * TIMES))
    runs = [move(axis, drive, slope=30.0, gravity_moment=200.0, substeps=n, hold=hold) for n in (2, 4, 8)]
    coarse, fine = (np.abs(a.output - b.output).max() for a, b in pairwise(runs))
    assert 12.0 <= coarse / fine <= 20.0


def test_a_mass_too_light_for_the_steps_gets_finer_ones(axis: Model) -> None:
    """With coarse steps friction of 2 N s/m throws a mass of 2 g about: such a schedule must not be taken."""
    manoeuvre = Manoeuvre(INTERVAL, N_SAMPLES, {}, {"u": np.sin(9.0 * TIMES)})
    candidates = np.array([[0.002, 0.0, 0.005, 2.0, 0.0], [3.0, 0.0, 0.005, 2.0, 0.0]])
    assert simulate(axis, manoeuvre, candidates, Schedule(1)).failed.tolist() == [True, False]
    found = calibrate(axis, manoeuvre, candidates)
    assert found.reached
    assert not simulate(axis, manoeuvre, candidates, found.schedule).failed.any()


def test_an_axis_in_radians_obeys_the_same_equations(axis: Model) -> None:
    turning = Model(PLANTS["driven_axis"].for_unit("rad/s"))
    manoeuvre = Manoeuvre(INTERVAL, N_SAMPLES, {"gravity_moment": 3.0}, {"u": np.sin(7.0 * TIMES)})
    found = simulate(turning, manoeuvre, [[MASS]], Schedule(4))
    along = move(axis, np.sin(7.0 * TIMES), gravity_moment=3.0)
    np.testing.assert_allclose(found.output, along.output, atol=1e-13)
