"""The simulated arm: the references, the undeclared effects and their limits, the late controller, the gyro."""

import csv
import math
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from stand import RefusalError
from stand.arm import KNOWN, Arm, Manoeuvre
from stand.effects import Effects
from stand.gyro import Gyro, measure, noise, record_times
from stand.motion import Motion, Trajectory, simulate

REFERENCE = Path(__file__).parents[1] / "reference"
with (REFERENCE / "index.csv").open() as index:
    ROWS = list(csv.DictReader(index))

SIZES = {
    "coulomb": 40.0, "stribeck": 40.0, "viscous": 15.0, "drag": 15.0, "tilt_deg": 2.0, "worm_loss": 0.3,
    "flux_saturation": 150.0, "brush_drop": 1.0, "winding_heating": 2e-5, "supply_sag": 0.01, "gas_heat_loss": 2.0,
    "tachometer_lag": 0.005, "tachometer_offset_deg_s": 2.0, "gyro_bandwidth_hz": 40.0, "gyro_bias_deg_s": 0.3,
    "gyro_scale": 0.005, "rocking_hz": 10.0, "seal_friction": 250.0, "asymmetric_friction": 40.0, "torque_offset": 15.0,
    "worm_braking": 1.0, "worm_speed": 0.1, "drive_gain": 0.05, "flux_atan": 150.0, "flux_root": 150.0,
    "line_loss": 2e4, "tachometer_ripple": 0.05, "controller_delay": 0.005, "controller_period": 0.01, "cam_bump": 60.0,
    "motor_fade": 0.005, "piston_stiction": 800.0, "cable_spring": 150.0, "pressure_friction": 0.08,
    "base_compliance": 1e-4, "slipping_ripple": 50.0, "sway": 30.0, "dahl": 40.0, "lugre": 40.0, "bouc_wen": 40.0,
    "cogging": 30.0, "torque_droop": 200.0, "drive_dead_zone": 40.0, "actuator_lag": 0.02, "drive_compliance": 2e-6,
}  # fmt: skip
STIFF = {"tachometer_lag": 1e-5, "gyro_bandwidth_hz": 1e4, "rocking_hz": 1e3, "actuator_lag": 1e-5,
         "drive_compliance": 1e-9}  # fmt: skip
LATE = {"controller_delay": 5e-4, "controller_period": 1e-3}
# A small level makes these stiff; test_stand_effects holds them to each other.
HYSTERETIC = ("dahl", "lugre", "bouc_wen")
NEARLY_NULL = {name: 1e-6 * size for name, size in SIZES.items() if name not in {*STIFF, *LATE, *HYSTERETIC}} | {
    "flux_saturation": 1e9,
    "flux_atan": 1e7,
    "flux_root": 1e7,
    "torque_droop": 1e9,
    "gas_heat_loss": 1e7,
}


@cache
def moved(effects: Effects | None = None, name: str = "lower", duration_s: float = 1.2) -> Trajectory:
    """Simulate a known manoeuvre once."""
    return simulate(Motion(Arm(), KNOWN[name], effects or Effects()), duration_s)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["file"])
def test_agrees_with_the_independent_integrator(row: dict[str, str]) -> None:
    arm = Arm(float(row["p0_MPa"]) * 1e6, float(row["k"]), float(row["eta3"]), float(row["n"]))
    stroke = float(row["start_angle_deg"]), float(row["target_angle_deg"])
    manoeuvre = Manoeuvre(row["manoeuvre"], *stroke, row["shell"] == "1", float(row["supply_V"]))
    found = simulate(Motion(arm, manoeuvre), 1.2)
    time, angle, speed, current = np.loadtxt(REFERENCE / row["file"], delimiter=",", skiprows=1).T
    assert np.allclose(found.time_s, time, rtol=0, atol=1e-12)
    assert np.abs(found.states["angle"] - angle).max() < 1e-7
    assert np.abs(found.states["speed"] - speed).max() < 1e-6
    assert np.abs(found.states["current"] - current).max() < 1e-3
    assert found.switch_s == pytest.approx(float(row["switch_time_s"]), abs=1e-9)


def test_a_short_stroke_is_in_closed_loop_from_the_start() -> None:
    assert moved(name="inside_E").switch_s == 0.0


def test_a_record_that_ends_before_the_switch_has_none() -> None:
    short = moved(duration_s=0.3)
    assert short.switch_s is None
    assert np.abs(short.gyro - moved().gyro[:301]).max() < 1e-9


def test_every_effect_is_tested_here() -> None:
    assert {each.name for each in fields(Effects) if "of" not in each.metadata} == set(SIZES)


@pytest.mark.parametrize("name", SIZES)
@pytest.mark.slow
def test_an_effect_at_zero_is_the_declared_arm_exactly(name: str) -> None:
    null = moved(Effects(**{name: 0.0}))
    assert np.array_equal(null.gyro, moved().gyro)
    assert list(null.states) == ["angle", "speed", "current"]


@pytest.mark.parametrize(("name", "size"), SIZES.items())
@pytest.mark.slow
def test_an_effect_changes_what_the_gyro_shows(name: str, size: float) -> None:
    assert np.abs(moved(Effects(**{name: size})).gyro - moved().gyro).max() > math.radians(0.25)


@pytest.mark.parametrize(("name", "size"), NEARLY_NULL.items())
@pytest.mark.slow
def test_an_effect_near_its_null_is_near_the_declared_arm(name: str, size: float) -> None:
    assert np.abs(moved(Effects(**{name: size})).gyro - moved().gyro).max() < 1e-5


@pytest.mark.parametrize(("name", "size"), STIFF.items())
@pytest.mark.slow
def test_a_fast_lag_or_tray_is_near_the_declared_arm(name: str, size: float) -> None:
    """Take the stroke in closed loop from the start, and shortly, since these limits are stiff."""
    shown = moved(Effects(**{name: size}), "inside_E", 0.1).gyro
    assert np.abs(shown - moved(name="inside_E", duration_s=0.1).gyro).max() < 1e-3


def test_refuses_an_effect_too_stiff_to_integrate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stand.motion.MOST_RATES", 20_000)
    with pytest.raises(RefusalError, match="too stiff"):
        moved(Effects(tachometer_lag=1e-9), "inside_E", 0.1)


@pytest.mark.parametrize(
    "name",
    ["coulomb", "stribeck", "viscous", "drag", "flux_saturation", "brush_drop", "winding_heating", "supply_sag",
     "seal_friction", "asymmetric_friction", "worm_speed", "flux_atan", "flux_root", "line_loss", "cam_bump",
     "motor_fade", "piston_stiction", "pressure_friction"],
)  # fmt: skip
@pytest.mark.slow
def test_a_loss_delays_the_switch_both_ways(name: str) -> None:
    for manoeuvre in ("lower", "raise"):
        lossy, declared = (moved(effects, manoeuvre).switch_s for effects in (Effects(**{name: SIZES[name]}), None))
        assert lossy is not None
        assert declared is not None
        assert lossy > declared + 5e-4


def test_a_worm_that_loses_torque_brakes_less() -> None:
    lossy, declared = moved(Effects(worm_loss=0.3)), moved()
    assert np.abs(lossy.gyro - declared.gyro)[:578].max() < 2e-3
    assert lossy.states["angle"].max() > declared.states["angle"].max() + 0.003


def test_the_tachometer_follows_late() -> None:
    states = moved(Effects(tachometer_lag=0.005)).states
    assert np.allclose(states["tachometer"][200:500], states["speed"][195:495], rtol=0, atol=2e-3)


def test_the_gyro_shows_the_speed_late() -> None:
    """Expect the delay of a ramp, 2 z / w = 7 ms, before the switch."""
    late = moved(Effects(gyro_bandwidth_hz=0.7 / (math.pi * 0.007)))
    assert np.allclose(late.gyro[200:500], late.states["speed"][193:493], rtol=0, atol=2e-3)


def test_a_tilt_is_another_angle_of_gravity() -> None:
    arm = replace(Arm(), gravity_angle=Arm().gravity_angle + math.radians(2.0))
    expected = simulate(Motion(arm, KNOWN["lower"]), 1.2)
    assert np.abs(moved(Effects(tilt_deg=2.0)).gyro - expected.gyro).max() < 1e-9


def test_a_sagging_supply_is_twice_its_resistance_in_the_winding() -> None:
    expected = simulate(Motion(replace(Arm(), resistance=0.42), KNOWN["lower"]), 1.2)
    assert np.abs(moved(Effects(supply_sag=0.01)).gyro - expected.gyro).max() < 1e-9


def test_a_gas_that_exchanges_heat_at_once_is_isothermal_in_the_long_run() -> None:
    states = moved(Effects(gas_heat_loss=1e-3)).states
    isotherm = np.array([replace(Arm(), n=1.0).pressure(angle) for angle in states["angle"]])
    assert np.abs(states["pressure"] / isotherm - 1.0)[10:].max() < 1e-3


def test_the_gyro_error_is_bias_and_scale() -> None:
    expected = moved().gyro * 1.005 + math.radians(0.3)
    assert np.allclose(moved(Effects(gyro_bias_deg_s=0.3, gyro_scale=0.005)).gyro, expected, rtol=0, atol=1e-12)


def test_a_loose_shell_rocks_at_the_frequency_of_the_two_bodies() -> None:
    motion = Motion(Arm(), KNOWN["lower"], Effects(rocking_hz=10.0, rocking_damping=0.001))
    states = simulate(motion, 0.5).states
    stretch = states["shell_angle"] - states["angle"]
    wave = np.diff(stretch - np.polyval(np.polyfit(np.arange(501), stretch, 4), np.arange(501)))
    crossings = np.flatnonzero(np.diff(np.sign(wave)))
    found = 500.0 / np.diff(crossings).mean()
    expected = 10.0 * math.sqrt(Arm().inertia(True) / motion.inertia)
    assert found == pytest.approx(expected, rel=0.03)


def test_no_shell_no_rocking() -> None:
    assert np.array_equal(moved(Effects(rocking_hz=10.0), "empty").gyro, moved(name="empty").gyro)


def test_all_effects_together_run_in_both_directions() -> None:
    sizes = {name: size for name, size in SIZES.items() if name != "controller_period"}
    for name in ("lower", "raise"):
        assert np.isfinite(moved(Effects(**sizes), name, 0.9).gyro).all()


def test_refuses_to_leave_the_travel() -> None:
    with pytest.raises(RefusalError, match="leave the travel"):
        simulate(Motion(Arm(p0=9e6), KNOWN["lower"]), 1.2)


FINE = 1e-4
"""Step of the plain integrator [s], a whole part of every delay here."""


@cache
def moved_late(name: str, told: tuple[tuple[str, float], ...] = ()) -> Trajectory:
    return simulate(Motion(Arm(), KNOWN[name], Effects(**dict(told))), 1.0, 1e-9)


def plainly_late(name: str, delay: float) -> npt.NDArray[np.float64]:
    """Integrate by the midpoint rule, with a plain list of the states gone by; speeds at 1 kHz [rad/s]."""
    motion = Motion(Arm(), KNOWN[name])
    back, target = round(delay / FINE), motion.manoeuvre.target
    gone = [np.array(list(motion.start.values()))] * (back + 1)
    closed = False
    for _ in range(round(1.0 / FINE)):
        now, late, next_late = gone[-1], gone[-1 - back], gone[-back]
        closed = closed or abs(target - late[0]) <= motion.arm.switch_distance
        half = now + 0.5 * FINE * np.array(motion.rates(now, closed, late))
        gone.append(now + FINE * np.array(motion.rates(half, closed, 0.5 * (late + next_late))))
    return np.array(gone)[back :: round(1e-3 / FINE), 1]


@pytest.mark.parametrize("delay", [0.002, 0.010])
@pytest.mark.parametrize(("name", "near"), [("lower", 4e-3), ("inside_E", 4e-4)])
@pytest.mark.slow
def test_a_delay_agrees_with_a_plain_integrator_that_remembers(name: str, near: float, delay: float) -> None:
    """Allow for the switch of the plain one, which comes up to a step late."""
    found = moved_late(name, (("controller_delay", delay),)).gyro
    assert np.abs(found - plainly_late(name, delay)).max() < near
    assert np.abs(found - moved_late(name).gyro).max() > 10.0 * near


def test_a_delay_shifts_the_switch_and_nothing_before_it() -> None:
    plain, late = moved_late("lower"), moved_late("lower", (("controller_delay", 0.008),))
    assert plain.switch_s is not None
    assert late.switch_s == pytest.approx(plain.switch_s + 0.008, abs=1e-9)
    reached = int(plain.switch_s * 1000)
    assert np.abs(late.gyro - plain.gyro)[: reached + 1].max() < 1e-7


@pytest.mark.parametrize("name", ["controller_delay", "controller_period"])
@pytest.mark.slow
def test_what_a_late_controller_does_vanishes_with_its_lateness(name: str) -> None:
    away = [
        np.abs(moved_late("raise", ((name, late),)).gyro - moved_late("raise").gyro).max()
        for late in (8e-3, 2e-3, 5e-4)
    ]
    assert away[1] < 0.4 * away[0]
    assert away[2] < 0.4 * away[1]


def test_a_sampled_controller_closes_its_loop_at_the_next_sample() -> None:
    plain, held = moved_late("lower").switch_s, moved_late("lower", (("controller_period", 0.012),)).switch_s
    assert plain is not None
    assert held is not None
    assert plain <= held < plain + 0.012
    assert held / 0.012 == pytest.approx(round(held / 0.012))


def test_a_held_command_is_a_delay_of_half_a_period_nearly() -> None:
    held, late = (
        moved_late("empty", (("controller_period", 0.004),)),
        moved_late("empty", (("controller_delay", 0.002),)),
    )
    alike = np.abs(held.gyro - late.gyro)[800:].max()
    assert alike < 0.5 * np.abs(late.gyro - moved_late("empty").gyro)[800:].max() + 1e-3


MANY = 100_000


@pytest.fixture(scope="module")
def lowering() -> Trajectory:
    return simulate(Motion(Arm(), KNOWN["lower"]), 0.7)


def drawn(gyro: Gyro) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    return np.asarray(noise(MANY, gyro, np.random.default_rng(7)))


def test_the_noise_has_the_asked_rms_whatever_its_colour() -> None:
    for bandwidth in (0.0, 20.0, 50.0):
        found = drawn(Gyro(noise_deg_s=0.25, noise_bandwidth_hz=bandwidth))
        assert found.size == MANY
        assert found.std() == pytest.approx(0.25, rel=0.03)
        assert abs(found.mean()) < 0.02


def test_white_noise_is_white_and_coloured_noise_stays_in_the_band() -> None:
    share = []
    for bandwidth in (0.0, 50.0):
        power = np.abs(np.fft.rfft(drawn(Gyro(noise_bandwidth_hz=bandwidth)))) ** 2
        hertz = np.fft.rfftfreq(MANY, 1e-3)
        share.append(power[hertz > 100.0].sum() / power.sum())
    assert share[0] == pytest.approx(0.8, abs=0.02)
    assert share[1] < 0.05


def test_a_record_rests_for_100_ms_and_then_follows_the_arm(lowering: Trajectory) -> None:
    time = record_times(lowering)
    speed = measure(lowering, Gyro(0.0, 0.0), 0.0, np.random.default_rng(1))
    assert time[0] == -0.1
    assert time[100] == 0.0
    assert time.size == speed.size == 801
    assert not speed[:101].any()
    assert np.allclose(speed[100:], np.degrees(lowering.states["speed"]), rtol=0, atol=1e-12)


def test_the_bias_shows_at_rest_as_well(lowering: Trajectory) -> None:
    assert measure(lowering, Gyro(0.0, 0.0), 0.3, np.random.default_rng(1))[0] == 0.3


def test_the_record_is_in_whole_steps_and_in_range(lowering: Trajectory) -> None:
    speed = measure(lowering, Gyro(0.25, 0.5, range_deg_s=100.25), 0.0, np.random.default_rng(1))
    assert np.allclose(speed / 0.5, np.round(speed / 0.5), rtol=0, atol=1e-9)
    assert speed.max() == 100.0


def test_the_noise_of_a_record_is_what_was_asked(lowering: Trajectory) -> None:
    shown = measure(lowering, Gyro(0.25, 0.1), 0.0, np.random.default_rng(1))[100:]
    expected = np.hypot(0.25, 0.1 / np.sqrt(12.0))
    assert (shown - np.degrees(lowering.gyro)).std() == pytest.approx(expected, rel=0.1)


def test_the_decimals_write_a_step_exactly() -> None:
    for step, decimals in ((0.1, 1), (0.05, 2), (0.25, 2), (1.0, 0), (0.0, 6), (400 / 4096, 6)):
        assert Gyro(quantisation_deg_s=step).decimals == decimals


def test_refuses_a_gyro_that_cannot_be() -> None:
    wrong = ("noise_deg_s", -1.0), ("quantisation_deg_s", float("nan")), ("noise_bandwidth_hz", 500.0)
    for name, value in (*wrong, ("range_deg_s", 0.0)):
        with pytest.raises(RefusalError):
            Gyro(**{name: value})
