"""The arm against what shares no code with the engine: reference trajectories, and scipy on the stand's equations."""

import numpy as np
import pytest

from arm_cases import REFERENCE, box_of, candidate_of, drawn, index_rows
from armid.engine import Schedule, calibrate, probes, simulate
from armid.model import EFFECTS, Manoeuvre, Model, applicable, refusal_of
from stand import RefusalError
from stand.arm import KNOWN, Arm
from stand.effects import Effects
from stand.motion import Motion
from stand.motion import simulate as simulate_on_stand

ERROR = {"standard": 1e-5, "fine": 2e-7}
# After the current has changed its sign, this file is off by 7e-7 rad/s: there the test stand and the engine with very
# fine steps, which share no code, agree with each other within 2e-10.
ROUGH = {"trajectory_05.csv": 7e-7}
N_CANDIDATES, SEED = 56, 20261121


def stand_speed(manoeuvre, candidate, **effects):
    """Speed at 1 kHz over 1.2 s, (1201,), and the time of the switch; None where the arm would leave its travel."""
    try:
        found = simulate_on_stand(Motion(Arm(*map(float, candidate)), KNOWN[manoeuvre], Effects(**effects)), 1.2)
    except RefusalError:
        return None
    return np.asarray(found.gyro), found.switch_s


def check(found, stood, allowed):
    """Compare speeds at every sample, and switch times."""
    for i, one in enumerate(stood):
        speed, switch = one
        assert np.abs(found.output[i] - speed).max() <= allowed
        switched = found.switch_times["closed"][i]
        assert np.isnan(switched) if switch is None else abs(switched - switch) <= 1e-6


@pytest.mark.parametrize("row", index_rows(), ids=lambda row: row["file"])
def test_agrees_with_the_reference_and_the_test_stand(row, arm, manoeuvres, schedule_for):
    expected = np.loadtxt(REFERENCE / row["file"], delimiter=",", skiprows=1)[:, 2]
    manoeuvre, candidate = manoeuvres[row["manoeuvre"]], candidate_of(row)
    # In company: a candidate among others must come out as right as alone.
    population = np.vstack([drawn(arm, 20, 1), candidate])
    for accuracy, error in ERROR.items():
        found = simulate(arm, manoeuvre, population, schedule_for(row["manoeuvre"], accuracy))
        assert np.abs(found.output[-1] - expected).max() <= error + ROUGH.get(row["file"], 0.0)
        assert abs(found.switch_times["closed"][-1] - float(row["switch_time_s"])) <= 1e-6
        assert not found.failed.any()
    stood = stand_speed(row["manoeuvre"], candidate)
    check(simulate(arm, manoeuvre, candidate, schedule_for(row["manoeuvre"], "fine")), [stood], ERROR["fine"])
    check(simulate(arm, manoeuvre, candidate, Schedule(48)), [stood], 1e-9)


def test_what_is_integrated_in_place_of_powers_and_cosines_stays_equal_to_them(arm):
    """p (V/V0)^n stays p0 and sine^2 + cosine^2 stays 1 over a long motion."""
    states = simulate(arm, Manoeuvre(0.001, 4001), drawn(arm, 30, 2), Schedule(2), states=True).states
    assert np.abs(states["sine"] ** 2 + states["cosine"] ** 2 - 1.0).max() <= 1e-9
    gas = states["pressure"] / states["compression"] ** drawn(arm, 30, 2)[:, 3:]
    assert np.abs(gas / gas[:, :1] - 1.0).max() <= 1e-8


@pytest.mark.nightly
def test_random_candidates_agree_with_the_test_stand(arm, manoeuvres, schedule_for):
    candidates = drawn(arm, N_CANDIDATES, SEED)
    left = 0
    for k, (name, manoeuvre) in enumerate(manoeuvres.items()):
        mine = candidates[k :: len(manoeuvres)]
        stood = [stand_speed(name, candidate) for candidate in mine]
        inside = [i for i, s in enumerate(stood) if s is not None]
        left += len(mine) - len(inside)
        for accuracy, allowed in ERROR.items():
            found = simulate(arm, manoeuvre, mine[inside], schedule_for(name, accuracy))
            check(found, [stood[i] for i in inside], allowed)
    # The test stand refuses what leaves the travel; the box holds next to none of it.
    assert left <= N_CANDIDATES // 20


@pytest.mark.nightly
@pytest.mark.parametrize("width", [0.01, 0.001])
def test_friction_agrees_with_the_test_stand(width, rubbing_arm, manoeuvres):
    """However narrow the smoothing of the sign: the schedule follows."""
    low, high = box_of(rubbing_arm)
    low[5] = high[5] = width
    candidates = low + (high - low) * np.random.default_rng(SEED).random((8, 7))
    candidates[:, [4, 6]] *= 0.2
    for name in ("lower", "raise"):
        stood = [stand_speed(name, c[:4], coulomb=c[4], coulomb_width=c[5], viscous=c[6]) for c in candidates]
        for accuracy, allowed in ERROR.items():
            found = calibrate(rubbing_arm, manoeuvres[name], probes(low, high), accuracy)
            assert found.reached
            check(simulate(rubbing_arm, manoeuvres[name], candidates, found.schedule), stood, allowed)


ARM = Arm()
EFFORT_PER_SQUARE = 2.0 * ARM.torque_constant * ARM.excitation * ARM.ratio_motor * ARM.eta1 * ARM.eta2 * ARM.eta3
# Effect -> its parameters, those of the test stand, and how near the two are [rad/s]: shapes as well that are fixed
# unless they are set free. The stand smooths the seals' sign otherwise, and the hold of a sampled control is its mean
# lateness here, not a staircase. At the stop of 0.01 rad of a tray of 6 Hz the spring is twice as stiff.
ON_STAND = {
    "coulomb": ({"level": 40.0, "width": 0.005}, {"coulomb": 40.0}, 1e-9),
    "stribeck": ({"level": 60.0, "fade": 0.12, "exponent": 1.0, "width": 0.02},
                 {"stribeck": 60.0, "stribeck_speed": 0.12, "stribeck_exponent": 1.0, "stribeck_width": 0.02}, 1e-6),
    "viscous": ({"slope": 15.0}, {"viscous": 15.0}, 1e-9),
    "quadratic_drag": ({"c": 15.0}, {"drag": 15.0}, 1e-9),
    "seal_friction": ({"force": 250.0, "width": 0.01}, {"seal_friction": 250.0, "seal_width": 0.01}, 1e-3),
    "presliding": ({"level": 60.0, "way": 60.0 / 2e4, "width": 5e-4}, {"dahl": 60.0}, 1e-5),
    "torque_offset": ({"level": 15.0}, {"torque_offset": 15.0}, 1e-9),
    "cogging": ({"sine": 30.0, "waves": 24.0, "second": -0.4}, {"cogging": 30.0, "cogging_second": -0.4}, 1e-9),
    "tilt": ({"angle": np.deg2rad(2.0)}, {"tilt_deg": 2.0}, 1e-9),
    "worm_direction": ({"loss": 0.3, "width": 0.005}, {"worm_loss": 0.3}, 1e-4),
    "worm_speed": ({"loss": 0.1, "fade": 0.5, "width": 0.005}, {"worm_speed": 0.1, "worm_fade": 0.5}, 1e-4),
    "drive_gain": ({"error": 0.05}, {"drive_gain": 0.05}, 1e-9),
    "torque_constant_droop": ({"sharpness_squared": (EFFORT_PER_SQUARE * 200.0**2) ** -2},
                              {"torque_droop": 200.0, "droop_exponent": 4.0}, 1e-9),
    "dead_zone": ({"zone": 40.0}, {"drive_dead_zone": 40.0}, 1e-8),
    "drive_lag": ({"time_constant": 0.02}, {"actuator_lag": 0.02}, 1e-9),
    "flux_saturation": ({"sharpness": 1.0 / 150.0}, {"flux_saturation": 150.0}, 1e-9),
    "brush_drop": ({"drop": 1.0, "width": 0.5}, {"brush_drop": 1.0}, 1e-6),
    "winding_heating": ({"rise": 6e-5, "cooling": 2.0}, {"winding_heating": 6e-5, "winding_cooling": 2.0}, 1e-6),
    "supply_sag": ({"resistance": 0.01}, {"supply_sag": 0.01}, 1e-9),
    "gas_heat_loss": ({"loss_rate": 0.5}, {"gas_heat_loss": 2.0}, 1e-9),
    "line_loss": ({"c": 2e4}, {"line_loss": 2e4}, 1e-9),
    "tachometer_lag": ({"time_constant": 0.005}, {"tachometer_lag": 0.005}, 1e-9),
    "tachometer_offset": ({"offset": np.deg2rad(2.0)}, {"tachometer_offset_deg_s": 2.0}, 1e-9),
    "tachometer_ripple": ({"sine": 0.05, "order": 1.0}, {"tachometer_ripple": 0.05}, 1e-9),
    "controller_delay": ({"delay": 0.0, "period": 0.016}, {"controller_period": 0.016}, 0.02),
    "gyro_lag": ({"time_constant": 1.0 / (80.0 * np.pi)}, {"gyro_bandwidth_hz": 40.0}, 1e-9),
    "gyro_bias": ({"bias": np.deg2rad(0.3)}, {"gyro_bias_deg_s": 0.3}, 1e-9),
    "gyro_scale": ({"error": 0.005}, {"gyro_scale": 0.005}, 1e-9),
    "shell_rocking": (
        {"inertia_share": 45.5 * 0.85**2, "frequency": 6.0, "damping_ratio": 0.05,
         "hardening": ((2.0 * np.pi * 6.0) ** 2 * 0.01) ** -2},
        {"rocking_hz": 6.0, "rocking_damping": 0.05, "rocking_stop": 0.01}, 1e-6),
}  # fmt: skip
# The second and the third form of effects.
SECOND_ON_STAND = {
    "presliding": ({"level": 60.0, "way": 60.0 / 2e4, "excess": 0.5, "fade": 0.15, "damping": 0.01, "width": 5e-4},
                   {"lugre": 60.0, "lugre_damping": 200.0}, 1e-5),
    "flux_saturation": ({"sharpness_squared": 150.0**-2}, {"flux_atan": 150.0}, 1e-9),
}  # fmt: skip
THIRD_ON_STAND = {
    "presliding": ({"level": 60.0, "way": 60.0 / 2e4, "unloading": 0.5, "width": 5e-4}, {"bouc_wen": 60.0}, 1e-5),
}  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize(("k", "planted"), [(0, ON_STAND), (1, SECOND_ON_STAND), (2, THIRD_ON_STAND)])
def test_effects_move_the_arm_as_on_the_test_stand(k, planted, arm, manoeuvres):
    """All effects, or all further forms, in one model that tests/contract compiles: one at its null adds nothing."""
    forms = [e.every_form[k] for e in applicable(EFFECTS, arm.plant).values() if k < len(e.every_form)]
    model = Model(arm.plant, tuple(form for form in forms if not refusal_of(form, arm.plant)))
    rest = {n: next((v for v in (p.null, p.fixed, p.nominal) if v is not None), p.low)
            for n, p in model.parameters.items()} | {"p0": 3.05e6, "k": 1.0, "eta3": 0.55, "n": 1.4}  # fmt: skip
    each = [rest | {f"{name}.{n}": v for n, v in values.items()} for name, (values, *_) in planted.items()]
    population = np.array([list(candidate.values()) for candidate in (rest, *each)])
    for stroke in ("lower", "raise"):
        declared, *signals = simulate(model, manoeuvres[stroke], population, Schedule(16)).output
        for (name, (_, on_stand, near)), signal in zip(planted.items(), signals, strict=True):
            stood = stand_speed(stroke, population[0, :4], **on_stand)
            missed, without = (np.abs(found - stood[0]).max() for found in (signal, declared))
            assert missed <= near, (stroke, name)
            assert without > max(5e-3, 2.0 * missed), (stroke, name)
