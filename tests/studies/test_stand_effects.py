"""What each added effect of the stand must do: closed forms, equivalences, limits and signs."""

import math
from functools import cache

import numpy as np
import pytest

from stand.arm import KNOWN, Arm
from stand.effects import Effects, flux, friction, relative_friction, unlisted_torque, worm_efficiency
from stand.motion import Motion, simulate

ARM = Arm()
LEVER = ARM.piston_lever


@cache
def moved(effects, name="lower", duration_s=0.9):
    # with 1e-9 single samples of a stiff drive are off by 2e-5, on some processors
    return simulate(Motion(ARM, KNOWN[name], effects), duration_s, 1e-10)


def states(count=200):
    rng = np.random.default_rng(5)
    low, high = (-0.9, -3.0, -70.0), (0.7, 3.0, 70.0)
    return [dict(zip(("angle", "speed", "current"), map(float, rng.uniform(low, high)))) for _ in range(count)]


@pytest.mark.parametrize("name", ["lower", "raise"])
@pytest.mark.parametrize(("one", "other"), [
    ({"seal_friction": 300.0, "seal_width": 0.004},
     {"coulomb": 300.0 * LEVER, "coulomb_width": 0.004, "coulomb_tanh": 1.0}),
    ({"asymmetric_friction": 40.0, "asymmetric_share": 0.0},
     {"coulomb": 40.0, "coulomb_width": 0.002, "coulomb_tanh": 1.0}),
    ({"worm_braking": 1.0},
     {"worm_loss": 1.0 - (2.0 - 1.0 / 0.55) / 0.55, "worm_width": 0.002, "worm_tanh": 1.0}),
    ({"piston_stiction": 500.0, "stiction_fade_deg": 1e9}, {"seal_friction": 500.0}),
    ({"cam_bump": 30.0, "cam_width_deg": 1e6}, {"seal_friction": 30.0 / LEVER}),
    ({"sway": 20.0, "sway_hz": 1e-9, "sway_phase_deg": 90.0}, {"torque_offset": 20.0}),
    ({"rocking_hz": 8.0, "rocking_stop": 1e3}, {"rocking_hz": 8.0}),
    ({"base_compliance": 1e-4, "base_hz": 1e-3}, {}),
    ({"drive_compliance": 5e-11, "drive_damping": 3e5}, {}),
], ids=lambda told: next(iter(told), "declared"))  # fmt: skip
@pytest.mark.nightly
def test_two_ways_to_say_the_same_agree(one, other, name):
    assert np.abs(moved(Effects(**one), name).gyro - moved(Effects(**other), name).gyro).max() < 1e-5


def test_friction_takes_energy_out_at_any_state():
    named = ({"coulomb": 40.0, "coulomb_tanh": 1.0}, {"stribeck": 40.0, "stribeck_exponent": 1.0},
             {"seal_friction": 300.0}, {"asymmetric_friction": 40.0})  # fmt: skip
    for sizes in named:
        assert all(friction(ARM, Effects(**sizes), now) * now["speed"] > 0.0 for now in states()), sizes
    for sizes in ({"cam_bump": 60.0}, {"piston_stiction": 800.0}, {"pressure_friction": 0.1}):
        effects = Effects(**sizes)
        assert all(unlisted_torque(ARM, effects, now, -0.8, 400.0) * now["speed"] <= 0.0 for now in states()), sizes


def test_friction_of_either_direction_a_taut_cable_and_what_depends_on_time_by_hand():
    effects = Effects(asymmetric_friction=40.0, asymmetric_share=0.25)
    down, up = (friction(ARM, effects, {"speed": speed}) for speed in (1.0, -1.0))
    assert (down, up) == pytest.approx((50.0, -30.0))
    effects = Effects(cable_spring=100.0, cable_angle_deg=-10.0)
    slack, taut = (
        unlisted_torque(ARM, effects, {"angle": math.radians(deg), "speed": 0.0}, 0.0, 0.0) for deg in (-11.0, 10.0)
    )
    assert (slack, taut) == pytest.approx((0.0, -100.0 * math.radians(20.0)))
    now = {"angle": 0.3, "speed": 0.0, "current": 0.0, "clock": 0.25}
    assert unlisted_torque(ARM, Effects(sway=10.0, sway_hz=1.0), now, 0.0, 0.0) == pytest.approx(10.0)
    ripple = Effects(slipping_ripple=10.0, slip_hz=1.0)
    expected = 10.0 * math.sin(24.0 * 0.3 + math.pi / 2.0)
    assert unlisted_torque(ARM, ripple, now, 0.0, 0.0) == pytest.approx(expected)


def test_the_root_saturates_at_its_current_and_a_fading_motor_loses_torque_with_the_charge():
    root = Effects(flux_root=100.0)
    assert flux(ARM, root, {"current": -100.0}) == pytest.approx(ARM.excitation * 100.0 / math.sqrt(2.0))
    assert flux(ARM, root, {"current": 1e7}) == pytest.approx(ARM.excitation * 100.0, rel=1e-4)
    effects = Effects(motor_fade=0.01)
    fresh, worn = (flux(ARM, effects, {"current": 50.0, "charge": charge}) for charge in (0.0, 25.0))
    assert worn == pytest.approx(fresh / 1.25)
    passed = moved(effects).states
    assert passed["charge"][-1] == pytest.approx(np.trapezoid(np.abs(passed["current"]), dx=1e-3), rel=1e-3)


def test_a_self_locking_worm_passes_nothing_back_and_one_rubs_less_the_faster_it_slides():
    # braking, it has the efficiency of the other direction
    for speed, current, expected in ((1.0, 9.0, 0.55), (-1.0, -9.0, 0.55), (1.0, -9.0, 2.0 - 1.0 / 0.55)):
        now = {"angle": 0.0, "speed": speed, "current": current}
        assert worm_efficiency(ARM, Effects(worm_braking=1.0), now) == pytest.approx(expected)
    assert worm_efficiency(Arm(eta3=0.48), Effects(worm_braking=1.0), now) == pytest.approx(0.0)
    found = [relative_friction(speed) for speed in (0.0, 0.01, 0.1, 1.0, 5.0)]
    assert found[0] == pytest.approx(1.0)
    assert sorted(found, reverse=True) == found
    assert relative_friction(-1.0) == found[3] == pytest.approx(0.4, abs=0.15)


def test_play_in_the_tray_lets_the_shell_lag_and_a_stiff_base_tilts_by_its_compliance():
    tight, loose = (moved(Effects(rocking_hz=12.0, rocking_play=play)).states for play in (0.0, 0.004))
    stretch = [np.abs(states["shell_angle"] - states["angle"]).max() for states in (tight, loose)]
    assert stretch[1] > stretch[0] + 0.003
    compliance = 2e-5
    found = moved(Effects(base_compliance=compliance, base_hz=60.0, base_damping=0.7)).states
    reaction = -np.gradient(found["speed"], 1e-3) * ARM.inertia(True)
    assert np.allclose(found["base"][100:550], compliance * reaction[100:550], rtol=0, atol=1e-3)
    assert np.abs(found["base"][100:550]).max() > 5e-3
