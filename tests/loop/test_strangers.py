"""Machines of coarse encoders: a carriage that no shipped plant describes, a disc, an arm that sticks."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

from armid import Constant, Input, Output, Parameter, Plant, Scales, State
from armid.engine import Schedule
from armid.estimation.corrections import rms
from armid.inference import prepared
from armid.inference.carry_over import over_noise
from armid.inference.decisions import WINDOW
from armid.inference.kinds.effects import records_with, waves_tried
from armid.loop import close_loop, report_of
from armid.model import EFFECTS
from armid.problem.problem import with_each
from armid.record import RecordWarning, read_campaign
from synthetic import moved, write_records

pytestmark = pytest.mark.slow
MASS, DAMPING, STEP_MM, OWN_MM, LATE_S = 4.1, 47.0, 0.02, 0.008, 0.013
# Between the wave numbers from which a fit begins where nothing else is known.
WAVES = 320.0
INERTIA, TORQUE_CONSTANT, FRICTION, MOMENT, RESISTANCE, DEAD_V = 0.02, 0.25, 0.01, 0.15, 1.2, 0.8


CARRIAGE = Plant(
    "carriage",
    parameters=(Parameter("mass", "kg", 0.5, 15.0), Parameter("damping", "N s/m", 0.0, 200.0)),
    states=(State("position", "m", lambda speed: speed, lambda start_position: start_position, "position_m"),
            State("speed", "m/s", lambda drive_effort, drive, torque, damping, speed, mass:
                  (drive_effort + drive + torque - damping * speed) / mass,
                  lambda start_speed: start_speed, "speed_m_s")),
    quantities={"drive_effort": lambda force: force,
                "shown": lambda position, position_sensor: position + position_sensor},
    constants=(Constant("start_position", 0.0, "m"), Constant("start_speed", 0.0, "m/s")),
    inputs=(Input("force", "N", ("force_N",)),), ports={"torque": "N", "drive": "N", "position_sensor": "m"},
    aliases={"omega": "speed", "theta": "position"}, scales=Scales(effort=30.0, speed=0.7), from_rest=False,
    outputs=(Output("position", "shown", "m", port="position_sensor"),),
)  # fmt: skip


DISC = Plant(
    "disc",
    parameters=(Parameter("inertia", "kg m2", 0.002, 0.1), Parameter("torque_constant", "N m/A", 0.05, 1.0),
                Parameter("friction", "N m s/rad", 0.0, 0.1), Parameter("eccentric_moment", "N m", 0.0, 1.0)),
    states=(State("q", "rad", lambda v: v, lambda: 0.0, "angle_rad"),
            State("v", "rad/s", lambda drive_effort, drive, back, eccentric_moment, q, friction, v, torque, inertia:
                  (drive_effort + drive + back - eccentric_moment * np.sin(q) - friction * v + torque) / inertia,
                  lambda: 0.0, "speed_rad_s")),
    quantities={"drive_effort": lambda torque_constant, voltage, resistance: torque_constant * voltage / resistance,
                "back": lambda winding, torque_constant, v, resistance:
                    torque_constant * (winding - torque_constant * v) / resistance,
                "shown": lambda v, output: v + output},
    constants=(Constant("resistance", RESISTANCE, "ohm"),),
    inputs=(Input("voltage", "V", ("voltage_V",), hold="zero"),),
    ports={"torque": "N m", "drive": "N m", "winding": "V", "output": "rad/s"},
    aliases={"omega": "v", "theta": "q"}, scales=Scales(effort=2.0, speed=30.0),
    outputs=(Output("angular_velocity", "shown", "rad/s", port="output"),),
)  # fmt: skip


def pushed(rng, times, slow=1.0):
    """Force [N] at some times, at rest for half a second."""
    waves = zip(rng.uniform(4.0, 10.0, 3), rng.uniform(0.4, 3.0, 3), rng.uniform(0.0, 6.0, 3), strict=True)
    ramp = np.clip((times - 0.5) / 0.5, 0.0, 1.0)
    return np.round(ramp * sum(a * np.sin(2.0 * np.pi * f / slow * times + p) for a, f, p in waves), 7)


def carriage_records(rng, late):
    """Tables of four records; the encoder of one answers late."""
    times = 0.002 * np.arange(2001)
    for i in range(4):
        force = pushed(rng, times)
        dense = np.interp(0.001 * np.arange(4001), times, force)
        position = 1e3 * lsim(([1.0 / MASS], [1.0, DAMPING / MASS, 0.0]), dense, 0.001 * np.arange(4001))[1]
        shown = np.interp(times - (late if i == 1 else 0.0), 0.001 * np.arange(4001), position)
        shown = np.round(STEP_MM * np.round((shown + rng.normal(0.0, OWN_MM, len(times))) / STEP_MM), 2)
        yield {"time_s": times, "force_N": force, "position_mm": shown}


def toothed_records(rng, step_mm, own_mm, teeth=0.0, slow=1.0):
    """Tables of four records; teeth: force [N] that repeats WAVES times in 2 pi m."""

    def rates(x, force):
        return np.array([x[1], (force - DAMPING * x[1] - teeth * np.sin(WAVES * x[0])) / MASS])

    times = 0.002 * np.arange(2001)
    for _ in range(4):
        force = pushed(rng, times, slow)
        position = 1e3 * moved(rates, force, 0.002, (0.0, 0.0), "linear", 1)[:, 0]
        shown = step_mm * np.round((position + rng.normal(0.0, own_mm, len(times))) / step_mm)
        yield {"time_s": times, "force_N": force, "position_mm": np.round(shown, 3)}


def campaign(folder, plant, records):
    files = {f"r{i}.csv": table for i, table in enumerate(records)}
    head = f'name = "{plant.name}"\nplant = "{plant.name}"\n'
    return read_campaign(write_records(folder, head, files), {plant.name: plant})


@pytest.mark.nightly
def test_an_encoder_that_is_fine_for_its_travel_and_coarse_for_its_noise(tmp_path):
    """Its rest shows less noise than its motion; the samples beyond the end of a late file are guessed."""
    records = campaign(tmp_path, CARRIAGE, carriage_records(np.random.default_rng(21), LATE_S))
    truth = np.hypot(OWN_MM, STEP_MM / np.sqrt(12.0)) * 1e-3
    assert [r.noise.rms for r in records.records] == pytest.approx([truth] * 4, rel=0.06)
    starts = [r.pieces[0].manoeuvre.constants["start_speed"] for r in records.records]
    assert np.abs(starts).max() < 5e-4
    found = close_loop(records.model(), records, {n: EFFECTS[n] for n in ("coulomb", "torque_offset", "drive_lag")})
    chances = found.inference.probabilities
    assert found.steps == ()
    assert chances["records"]["late@r1.csv"] == pytest.approx(1.0, abs=0.1)
    assert chances["unknown"] < 0.2
    assert found.after.holdout.errors.rmse == pytest.approx(truth, rel=0.1)
    for estimate, value in zip(found.after.estimates, (MASS, DAMPING), strict=True):
        assert estimate.low <= value <= estimate.high
        assert estimate.high - estimate.low < 0.01 * value
    assert report_of(found)["noise_rms"] == pytest.approx(truth, rel=0.06)


def test_what_an_encoder_rounds_away_of_a_slow_motion_is_no_discrepancy(tmp_path):
    """It passes its steps in a saw tooth, and at rest it shows less noise than in motion."""
    records = campaign(tmp_path, CARRIAGE, toothed_records(np.random.default_rng(26), 1.0, 0.22, slow=2.0))
    found = close_loop(records.model(), records, {n: EFFECTS[n] for n in ("coulomb", "quadratic_drag", "drive_lag")})
    assert found.verdict == "no_discrepancy"
    assert found.inference.probabilities["unknown"] < 0.05


def crept_records(rng, level=6.0, width=0.002, step_mm=0.5):
    """Tables of four records under steps of force; where friction holds the carriage it creeps. Nothing is noise."""

    def rates(x, force):
        return np.array([x[1], (force - DAMPING * x[1] - level * np.tanh(x[1] / width)) / MASS])

    for _ in range(4):
        force = np.repeat(rng.uniform(-9.0, 9.0, 10), 120) * np.repeat(rng.choice([1.0, 0.6], 10), 120)
        force = np.where(np.arange(1200) < 100, 0.0, np.round(force, 2))
        position = 1e3 * moved(rates, np.repeat(force, 20), 0.005 / 20, (0.0, 0.0), "zero", 1)[::20, 0]
        yield {"time_s": 0.005 * np.arange(1200), "force_N": force,
               "position_mm": step_mm * np.round(position / step_mm)}  # fmt: skip


def test_what_an_encoder_rounds_away_where_friction_lets_a_machine_creep_is_no_discrepancy(tmp_path):
    """Its error keeps its sign for seconds, and hangs on the motion to less than a step."""
    held = replace(CARRIAGE, inputs=(Input("force", "N", ("force_N",), hold="zero"),))
    records = campaign(tmp_path, held, crept_records(np.random.default_rng(61)))
    found = close_loop(records.model() + EFFECTS["coulomb"], records, {"quadratic_drag": EFFECTS["quadratic_drag"]})
    assert found.verdict == "no_discrepancy"
    assert found.inference.probabilities["unknown"] < 0.05
    assert found.parameters["coulomb.level"] == pytest.approx(6.0, rel=0.01)


def test_the_number_of_teeth_is_looked_for_wherever_it_lies(tmp_path):
    records = campaign(tmp_path, CARRIAGE, toothed_records(np.random.default_rng(25), 0.02, 0.008, teeth=1.5))
    library, fit = prepared(records.model(), records, {"torque_ripple": EFFECTS["torque_ripple"]})
    (key,) = library.candidates
    problem = records_with(fit, (key,), library)
    places, among = waves_tried(fit, problem, key, library.declared_ranges(problem.model, key))
    travel = max(np.ptp(r.measured) for r in records.train)
    assert np.abs(places["torque_ripple.waves"] - WAVES).min() < np.pi / travel
    low, high = (ends[problem.space.index("torque_ripple.waves")] for ends in (problem.space.low, problem.space.high))
    looked_at = len(places["torque_ripple.waves"]) * among
    assert looked_at == pytest.approx((high - low) * travel / np.pi, abs=1.0)


def turning(x, fed):
    current = (fed - TORQUE_CONSTANT * x[1]) / RESISTANCE
    return np.array([x[1], (TORQUE_CONSTANT * current - FRICTION * x[1] - MOMENT * np.sin(x[0])) / INERTIA])


def disc_records(rng, n_records, n_steps, n_rest):
    """Tables of steps of the voltage, after some samples of rest."""
    for _ in range(n_records):
        voltage = np.repeat(rng.uniform(-9.0, 9.0, n_steps), 40)
        voltage[:n_rest] = 0.0
        fed = np.sign(voltage) * np.maximum(np.abs(voltage) - DEAD_V, 0.0)
        speed = moved(turning, fed, 0.01, (0.0, 0.0), "zero", 4)[:, 1] + rng.normal(0.0, 0.06, len(voltage))
        yield {"time_s": 0.01 * np.arange(len(voltage)), "voltage_V": voltage, "angular_velocity_rad_s": speed}


@pytest.mark.nightly
def test_what_the_added_effect_cannot_be_told_apart_from_widens_its_own_strength_too(tmp_path):
    """The slope that is not declared makes up for all others exactly; a fit with it may not end worse than without."""
    declared = campaign(tmp_path, DISC, disc_records(np.random.default_rng(23), 3, 12, 60))
    found = close_loop(declared.model(), declared, {n: EFFECTS[n] for n in ("dead_zone", "viscous")},
                       fixed={"friction": 0.0})  # fmt: skip
    chances, estimates = found.inference.probabilities["effects"], {e.name: e for e in found.after.estimates}
    assert chances["dead_zone"] > 0.95
    assert 0.1 < chances["viscous"] < 0.9
    truths = {"inertia": INERTIA, "torque_constant": TORQUE_CONSTANT, "eccentric_moment": MOMENT,
              "dead_zone.zone": TORQUE_CONSTANT * DEAD_V / RESISTANCE}  # fmt: skip
    for name, truth in truths.items():
        assert not estimates[name].trusted
        assert estimates[name].low < truth < estimates[name].high
    parents = found.inference.exploration.fits
    for model, fit in parents.items():
        less = [parents[model - {h}] for h in model if h.kind == "effect" and model - {h} in parents]
        assert all(fit.chi2 < 1.01 * other.chi2 for other in less), model


COUNTS, DRAG = 2000.0, 1.2e-3


def by_reading(motion, rng):
    """Speed with a noise of 0.02 rad/s at rest and of 2 % of the reading beside it."""
    return motion[:, 1] + np.hypot(0.02, 0.02 * motion[:, 1]) * rng.normal(size=len(motion))


def from_counts(motion, rng):
    """Speed as the difference of counts over a sample."""
    counts = np.floor(motion[:, 0] / (2.0 * np.pi) * COUNTS + rng.random())
    return np.diff(counts, prepend=counts[0]) * 2.0 * np.pi / COUNTS / 0.01


def dragged(folder, sensor, n_steps):
    """Close the loop on a disc with a drag that its model lacks; n_steps: of its simulation, for a sample."""
    rng, files = np.random.default_rng(31), []
    for _ in range(4):
        voltage = np.repeat(rng.uniform(-9.0, 9.0, 15), 40)
        voltage[:60] = 0.0
        motion = moved(lambda x, fed: turning(x, fed) - [0.0, DRAG * x[1] * abs(x[1]) / INERTIA], voltage, 0.01,
                       (0.0, 0.0), "zero", n_steps)  # fmt: skip
        speed = sensor(motion, rng)
        files.append({"time_s": 0.01 * np.arange(len(voltage)), "voltage_V": voltage, "angular_velocity_rad_s": speed})
    records = campaign(folder, DISC, files)
    names = ("quadratic_drag", "output_delay", "cogging")
    return close_loop(records.model(), records, {name: EFFECTS[name] for name in names})


@pytest.mark.nightly
def test_what_a_simulation_without_noise_errs_is_nothing_that_the_machine_lacks(tmp_path):
    found = dragged(tmp_path, lambda motion, rng: motion[:, 1], 1)
    assert found.verdict == "explained"
    assert found.effects == ("quadratic_drag",)
    assert "assumed" in found.outputs["angular_velocity"]["noise_in_motion"]
    assert found.after.holdout.errors.rmse < 0.1 * found.noise_rms
    assert found.after.holdout.errors.chi2_per_sample is None


@pytest.mark.nightly
@pytest.mark.parametrize("sensor", [by_reading, from_counts])
def test_noise_that_no_rest_tells_is_nothing_that_the_machine_lacks(tmp_path, sensor):
    found = dragged(tmp_path, sensor, 4)
    chances = found.inference.probabilities
    assert chances["unknown"] < 0.1
    assert chances["effects"]["quadratic_drag"] > 0.9
    assert "cogging" not in found.effects
    # a difference over a sample is the speed half a sample ago
    assert (chances["effects"].get("output_delay", 0.0) > 0.9) == (sensor is from_counts)
    assert found.outputs["angular_velocity"]["noise_in_motion"]
    estimates = {e.name: e for e in found.after.estimates}
    assert estimates["inertia"].low < INERTIA < estimates["inertia"].high
    assert estimates["quadratic_drag.c"].low < DRAG < estimates["quadratic_drag.c"].high


def test_a_speed_that_is_counted_over_a_window_is_told_from_one_that_is_late_and_from_one_that_lags(tmp_path):
    rng, tables, window = np.random.default_rng(6), {}, 6
    for file in ("a.csv", "b.csv", "c.csv"):
        drive = np.repeat(rng.uniform(-3.0, 3.0, 12), 50)
        turned = moved(lambda x, u: np.array([x[1], (u - 0.08 * x[1]) / 0.012]), drive, 0.01, (0.0, 0.0), "zero", 4)
        counts = np.floor(turned[:, 0] / (2.0 * np.pi) * COUNTS + rng.random())
        counted = (counts - np.concatenate([np.full(window, counts[0]), counts[:-window]])) / (window * 0.01)
        speed = counted * 2.0 * np.pi / COUNTS
        tables[file] = {"time_s": 0.01 * np.arange(len(drive)), "drive_N_m": drive, "angular_velocity_rad_s": speed}
    head = 'name = "wheel"\nplant = "rotary_arm"\nhold = "zero"\nparameters.gravity_moment.fixed = 0.0\n'
    wheel = read_campaign(write_records(tmp_path / "wheel", head, tables))
    names = ("output_average", "output_delay", "output_lag", "gyro_lag", "coulomb")
    found = close_loop(wheel.model(), wheel, {name: EFFECTS[name] for name in names})
    estimates = {e.name: e for e in found.after.estimates}
    assert found.effects == ("output_average",)
    assert found.inference.probabilities["unknown"] < 0.05
    for name, truth in (("output_average.window", window * 0.01), ("damping", 0.08), ("inertia", 0.012)):
        assert estimates[name].low < truth < estimates[name].high


@pytest.mark.nightly
def test_effects_that_show_only_beside_each_other_are_found(tmp_path):
    """A cart that never stands still: each of the three alone explains next to nothing."""
    rng, drive, late = np.random.default_rng(5), np.repeat([20.0, 40.0, 60.0, 80.0, 100.0], 100), 2
    speed = moved(lambda x, u: np.array([x[1], (u - 15.0 - 15.0 * x[1] - 3.0 * x[1] ** 2) / 4.0]), drive, 0.025,
                  (0.0, 0.31), "zero", 10)[:, 1]  # fmt: skip
    speed = np.concatenate([np.full(late, speed[0]), speed[:-late]]) + 0.004 * rng.normal(size=len(speed))
    table = {"time_s": 0.025 * np.arange(len(drive)), "command": drive, "velocity_m_s": np.round(speed, 2)}
    head = 'name = "cart"\nplant = "linear_axis"\nhold = "zero"\n'
    cart = read_campaign(write_records(tmp_path / "cart", head, {"a.csv": table, "b.csv": table}))
    found = close_loop(cart.model(), cart, {n: EFFECTS[n] for n in ("coulomb", "quadratic_drag", "output_delay")})
    assert set(found.effects) == {"coulomb", "quadratic_drag", "output_delay"}


STICKING = """\
name = "wheel"
plant = "rotary_arm"
hold = "zero"
[parameters]
inertia = { fixed = 1.0 }
gravity_moment = { low = 50, high = 300 }
damping = { low = 0.0, high = 10.0 }
"""


@pytest.mark.nightly
def test_sticks_of_a_coarse_encoder_tell_of_dry_friction(tmp_path):
    rng, interval, n, step = np.random.default_rng(7), 0.01, 1300, 2.0 * np.pi / 4096
    tables = {}
    for file in ("a.csv", "b.csv"):
        phases = rng.uniform(0.0, 2.0 * np.pi, 3)
        times = interval * np.arange(n)
        drive = sum(size * np.sin(w * times + p) for size, w, p in zip((30, 20, 15), (1.1, 2.7, 4.9), phases))
        angle = moved(lambda x, u: np.array([x[1], u - 1.5 * x[1] - 6.0 * np.tanh(x[1] / 0.02) - 130.0 * np.sin(x[0])]),
                      drive, interval, (0.0, 0.0), "zero", 4)[:, 0]  # fmt: skip
        # a clock that is a little uneven
        uneven = times + 0.02 * interval * rng.uniform(-1.0, 1.0, n)
        tables[file] = {"time_s": uneven, "drive_N_m": drive, "angle_rad": np.round(angle / step) * step}
    with pytest.warns(RecordWarning, match="irregular sampling"):
        read = read_campaign(write_records(tmp_path / "stick", STICKING, tables))
    found = close_loop(read.model(), read, {name: EFFECTS[name] for name in ("coulomb", "viscous", "output_lag")})
    report = report_of(found)
    assert report["suspects"] == []
    assert "coulomb" in report["effects"]
    assert report["error"]["after"]["holdout"]["rmse"] < 4.0 * step


@pytest.mark.parametrize("begins", [None, (0.0, 0.1, 0.9)])
def test_the_zero_of_an_encoder_is_anywhere_within_a_step_and_no_record_is_accused_of_it(tmp_path, begins):
    """Counting begins where each record was switched on, hanging; a speed that is read besides has noise."""
    rng, step, tables = np.random.default_rng(12), 0.005, {}
    for i, file in enumerate(("a.csv", "b.csv", "c.csv")):
        drive = np.concatenate([np.zeros(60), np.repeat(rng.uniform(-0.5, 0.5, 11), 40)])
        moving = moved(lambda x, u: np.array([x[1], (u - 0.6 * np.sin(x[0]) - 0.08 * x[1]) / 0.05]), drive, 0.01,
                       (0.0, 0.0), "zero", 4)  # fmt: skip
        tables[file] = {"time_s": 0.01 * np.arange(len(drive)), "drive_N_m": drive,
                        "angle_rad": np.round(moving[:, 0] / step + (begins[i] if begins else rng.random())) * step,
                        "angular_velocity_rad_s": moving[:, 1] + 0.02 * rng.normal(size=len(drive))}  # fmt: skip
    head = 'name = "arm"\nplant = "rotary_arm"\nhold = "zero"\n'
    arm = read_campaign(write_records(tmp_path / "arm", head, tables))
    found = close_loop(arm.model(), arm, {"torque_offset": EFFECTS["torque_offset"]})
    assert found.verdict == "no_discrepancy"
    unseen = found.after.holdout
    assert over_noise(found.after.train, unseen) == [False]
    assert unseen.errors.outputs["angle"].rmse < 1.2 * unseen.noise_of["angle"]
    # a zero that is off by more than a step is an error of the record
    counted = next(one for one in unseen.replays if one.record.unit == "rad")
    simulated = counted.signal(unseen.candidate[np.newaxis])[0]
    assert rms(counted.measuring(simulated + 3.0 * step).zeroed(simulated) - simulated) == pytest.approx(2.0 * step)
    assert found.inference.probabilities["unknown"] < 0.1
    for estimate, truth in zip(found.after.estimates, (0.05, 0.6, 0.08), strict=False):
        assert estimate.low < truth < estimate.high


@pytest.mark.nightly
def test_errors_of_the_engine_do_not_tell_a_late_voltage_from_a_late_sensor(tmp_path):
    """From rest both move the disc alike, and friction is sharp: passed in a hundredth of a sample."""
    rng, files, finer = np.random.default_rng(31), [], 10
    for _ in range(4):
        voltage = np.repeat(rng.uniform(-9.0, 9.0, 15), 40)
        voltage[:60] = 0.0
        at = np.floor(np.arange(finer * len(voltage)) / finer - 5.64 + 1e-9).astype(int)
        motion = moved(lambda x, fed: turning(x, fed) - [0.0, 0.06 * np.tanh(x[1] / 0.02) / INERTIA],
                       np.where(at < 0, 0.0, voltage[at]), 0.01 / finer, (0.0, 0.0), "zero", 4)[::finer]  # fmt: skip
        times, speed = 0.01 * np.arange(len(voltage)), from_counts(motion, rng)
        files.append({"time_s": times, "voltage_V": voltage, "angular_velocity_rad_s": speed})
    records = replace(campaign(tmp_path, DISC, files), tolerances={"resistance": 0.02})
    found = close_loop(records.model(), records, {n: EFFECTS[n] for n in ("coulomb", "drive_delay", "output_delay")})
    chances = found.inference.probabilities["effects"]
    assert found.verdict == "cannot_tell_apart"
    assert max(chances["drive_delay"], chances["output_delay"]) < 0.85
    exploration = found.inference.exploration
    for model, value in exploration.ranked():
        if value > exploration.ranked()[0][1] - WINDOW:
            fit = exploration.fits[model]
            replays = with_each(fit.records.replays, lambda ours: replace(ours, calibrations=tuple(
                replace(c, schedule=Schedule(64)) for c in ours.calibrations)))  # fmt: skip
            exact = replace(fit.records, replays=replays).plain.residuals(fit.z)[0]
            # a tenth is asked for, and an error is estimated to a factor of two
            assert np.sum((exact - fit.residual) ** 2) < 0.2
