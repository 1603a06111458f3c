"""Noise of measured inputs: what a column shows of it, how far it moves the model, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest

from armid import close_loop, identify, read_campaign
from armid.estimation.identify_document import answer, details_of, ranked, result_of
from armid.estimation.input_noise import answers, at_rest, cosines, moved_by_inputs, pooled_noise, smoothed
from armid.inference.infer import prepared
from armid.loop import report_of
from armid.loop.document import error_sentence
from armid.model import EFFECTS, Model
from armid.record.sensor import InputNoise, noise_of_input
from synthetic import wheel, write_records

INERTIA, DAMPING, INTERVAL, SPEED_NOISE, TORQUE_NOISE = 0.05, 0.03, 0.01, 0.005, 0.02
TIMES = INTERVAL * np.arange(800)
NOWHERE = np.zeros(len(TIMES), dtype=np.bool_)
HEAD = """\
name = "axis"
plant = "rotary_arm"
hold = "zero"
effects = {}
[parameters]
gain = {{ fixed = 1.0 }}
gravity_moment = {{ fixed = 0.0 }}
"""


def torque(seed):
    rng = np.random.default_rng(seed)
    waves = zip(rng.uniform(0.05, 0.15, 3), rng.uniform(0.1, 1.0, 3), rng.uniform(0.0, 6.0, 3), strict=True)
    return np.clip((TIMES - 0.6) / 0.5, 0.0, 1.0) * sum(a * np.sin(2.0 * np.pi * f * TIMES + p) for a, f, p in waves)


def speed(drive):
    return wheel(drive, INTERVAL, 1.0 / INERTIA, DAMPING / INERTIA)[0]


def campaign(folder, measured, driven=torque):
    tables, rng = {}, np.random.default_rng(5)
    for i in range(3):
        drive = driven(i)
        driven_by, seen = measured(drive, rng), speed(drive) + rng.normal(0.0, SPEED_NOISE, len(TIMES))
        tables[f"r{i}.csv"] = {"time_s": TIMES, "drive_N_m": driven_by, "angular_velocity_rad_s": seen}
    return read_campaign(write_records(folder, HEAD.format([]), tables))


def exact(drive, rng):
    return drive


def noisy(drive, rng):
    return drive + rng.normal(0.0, TORQUE_NOISE, len(drive))


def rounded(drive, rng):
    return 0.01 * np.round(drive / 0.01)


@pytest.mark.parametrize(("measured", "rms", "step"), [(noisy, TORQUE_NOISE, 0.0), (rounded, 0.0, 0.01)])
def test_what_a_column_shows(tmp_path, measured, rms, step):
    (found,) = pooled_noise(campaign(tmp_path / "axis", measured).train).values()
    assert found.rms == pytest.approx(rms, rel=0.25, abs=1e-9)
    assert found.step == pytest.approx(step, rel=1e-6, abs=1e-4)
    records = campaign(tmp_path / "exact", exact).train
    assert pooled_noise(records) == {}
    # a motion that passes few values shows multiples of the step
    steps = zip(records, (InputNoise(0.0, 0.0015), InputNoise(0.0, 0.0001)), strict=True)
    assert pooled_noise([replace(r, input_noise={"u": n}) for r, n in steps]) == {"u": InputNoise(0.0, 0.0001)}


@pytest.mark.parametrize("command", [
    np.repeat(np.random.default_rng(1).choice([-1.0, 1.0], 400), 3),
    np.repeat(np.linspace(-12.0, 12.0, 25), 40),
    np.sin(TIMES) * (TIMES > 0.5),
    0.0015 * np.abs((np.arange(1200) + 100) % 400 - 200.0),
], ids=["pseudo-random", "staircase", "sine", "ramps"])  # fmt: skip
def test_a_command_is_known_exactly(command):
    still = np.random.default_rng(2).normal(0.0, 0.01, len(command))
    assert noise_of_input(command, [(still, True)]) == InputNoise()


@pytest.mark.parametrize(("drive", "rms"), [
    (5.8 + 0.5 * np.sin(2.0 * np.pi * 0.7 * TIMES) + np.random.default_rng(1).normal(0.0, 0.03, TIMES.size), 0.03),
    (0.5 * np.sin(2.0 * np.pi * 0.7 * TIMES), 0.0), (np.random.default_rng(2).normal(0.0, 0.5, TIMES.size), 0.0),
], ids=["measured", "smooth", "white excitation"])  # fmt: skip
def test_without_a_rest_it_is_what_is_white_in_the_column(drive, rms):
    """A controller that holds a load never stands still. What is as large as the input is a command."""
    assert noise_of_input(drive, [(np.sin(TIMES), True)]).rms == pytest.approx(rms, rel=0.15)


def held(folder, seed=4):
    """Return a campaign of an axis that a controller moves and holds against a weight, its torque measured with noise.

    The true torque follows the true angle; a fine encoder sees what the noise of the column does from the first row on.
    """
    tables, rng, weight = {}, np.random.default_rng(seed), 0.4
    kept = np.exp(-DAMPING * INTERVAL / INERTIA)
    way = INTERVAL - INERTIA / DAMPING * (1.0 - kept)
    rise, fall = np.clip((TIMES[:600] - 1.0) / 0.8, 0.0, 1.0), np.clip((TIMES[:600] - 3.5) / 0.5, 0.0, 0.6)
    for i, size in enumerate((1.0, -0.7, 1.3)):
        q, v, rows = 0.0, 0.0, []
        for aim in size * (rise - fall):
            torque = weight + 2.0 * (aim - q) - 0.4 * v
            rows.append((torque, q))
            pushed = torque - weight
            q += v / DAMPING * INERTIA * (1.0 - kept) + pushed / DAMPING * way
            v = kept * v + (1.0 - kept) * pushed / DAMPING
        true, angle = np.array(rows).T
        tables[f"r{i}.csv"] = {"time_s": TIMES[:600], "drive_N_m": true + rng.normal(0.0, 0.01, 600),
                               "angle_rad": angle + rng.normal(0.0, 2e-6, 600)}  # fmt: skip
    return read_campaign(write_records(folder, HEAD.format('["torque_offset"]'), tables))


@pytest.mark.slow
def test_no_fit_of_a_start_takes_up_what_noise_of_an_input_does_later(tmp_path):
    """Such a fit takes the noise as white, and would move the whole record: what is left looks like an offset."""
    read = held(tmp_path / "held")
    _, declared = prepared(read.model(EFFECTS), read, candidates={})
    data, noise = declared.records.data, {"u": InputNoise(rms=0.01)}
    assert data.inputs_count
    for replay in declared.records.replays:
        (piece,), (columns,) = replay.pieces, answers(replay.ready, [replay], declared.candidate, noise, [2e-6])
        assert dict(piece.manoeuvre.constants).items() >= piece.shown_start.items()
        assert not piece.correction.gain.any()
        moved = np.sqrt(np.sum(columns[0] ** 2, axis=1))
        assert moved[0] < 1e-3 * moved[-1]


@pytest.mark.nightly
def test_a_load_that_a_controller_holds_lacks_nothing(tmp_path):
    """What the noise does to the whole record is no offset of the torque."""
    found = close_loop(held(tmp_path / "held"), candidates=["coulomb", "stribeck"])
    assert found.verdict == "no_discrepancy"
    assert next(e.value for e in found.after.estimates if e.name == "inertia") == pytest.approx(INERTIA, rel=0.01)


@pytest.mark.slow
def test_how_far_it_moves_the_model_and_that_this_may_be_all_that_remains(tmp_path):
    """A torque with noise turns a disc as a random walk with damping, whose variance is known."""
    declared = campaign(tmp_path / "axis", noisy)
    fit = identify(declared)
    kept = np.exp(-DAMPING * INTERVAL / INERTIA)
    kicks = ((1.0 - kept) / DAMPING) ** 2 * pooled_noise(declared.train)["u"].rms ** 2
    walk = kicks * np.cumsum(np.append(0.0, kept ** (2.0 * np.arange(len(TIMES) - 1))))
    moved = moved_by_inputs(fit.train_replays, fit.candidate)
    (rms,) = moved.values()
    assert rms == pytest.approx(np.sqrt(np.mean(walk)), rel=0.25)
    said = " ".join(answer(result_of(fit), details_of(fit)))
    assert "that of the inputs moves the model by" in said
    assert "what remains may be that alone" in said
    without = identify(campaign(tmp_path / "exact", exact))
    assert "inputs" not in " ".join(answer(result_of(without), details_of(without)))


@pytest.mark.nightly
@pytest.mark.parametrize("measured", [noisy, exact])
def test_an_interval_holds_what_noise_of_an_input_does_where_fitted_starts_and_the_sensor_hide_it(tmp_path, measured):
    inside, alone = [], []
    for seed in range(4):
        tables, rng = {}, np.random.default_rng(seed)
        for i in range(3):
            drive = 3.0 * torque(10 * seed + i + 1)[100:]
            angle = INTERVAL * np.cumsum(speed(drive)) - 0.5 * INTERVAL * speed(drive)
            tables[f"r{i}.csv"] = {"time_s": TIMES[:700], "drive_N_m": measured(drive, rng),
                                   "angle_rad": angle + rng.normal(0.0, 0.05, 700)}  # fmt: skip
        fit = identify(read_campaign(write_records(tmp_path / f"{seed}", HEAD.format([]), tables)))
        off = [fit.parameters["inertia"].value - INERTIA, fit.parameters["damping"].value - DAMPING]
        inside += [p.low <= true <= p.high and p.interval_holds for p, true in
                   ((fit.parameters["inertia"], INERTIA), (fit.parameters["damping"], DAMPING))]  # fmt: skip
        # what the ellipses of pairs are drawn from
        assert fit.uncertainty.half_width[0] == pytest.approx(fit.parameters["inertia"].high - fit.candidate[0])
        assert np.all(fit.uncertainty.deviation >= fit.information.deviation)
        alone += list(np.abs(off) <= fit.information.half_width)
        text = " ".join(ranked(fit))
        assert ("Noise of the inputs moves" in text) == (measured is noisy)
    assert sum(inside) >= 7
    assert (sum(alone) <= 5) == (measured is noisy)


@pytest.mark.parametrize("share", [1.0, 0.2])
def test_noise_that_the_records_deny_widens_no_interval(tmp_path, share):
    """What a controller computes of a noisy speed looks as if it were measured with noise, and is exact.

    With a share of 0.2 the sensors see less of it than of their own noise.
    """
    read = [campaign(tmp_path / one.__name__, one, computed) for one in (exact, noisy)]
    there, gone = (identify(as_if_noisy(r, share * TORQUE_NOISE)) for r in read[::-1])
    assert there.by_inputs.any()
    assert not gone.by_inputs.any()


INPUTS = {
    "waves": np.sin(2.0 * np.pi * 0.5 * TIMES) + 0.4 * np.sin(2.0 * np.pi * 1.3 * TIMES),
    "staircase": np.repeat(np.random.default_rng(4).uniform(-1.0, 1.0, 8), 100),
}


@pytest.mark.parametrize("name", INPUTS)
def test_the_estimate_is_closer_than_the_column_and_knows_its_error(name):
    """The error may be correlated over the whole record, so that several columns are looked at."""
    true, misses, claimed = INPUTS[name] * (TIMES > 0.6), [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        column = true + rng.normal(0.0, 0.03, len(true))
        found = smoothed(column, InputNoise(rms=0.03), NOWHERE)
        misses.append(np.mean((found.values - true) ** 2))
        claimed.append(np.mean(found.errors(16, rng) ** 2))
        assert np.sqrt(misses[-1]) < 0.7 * 0.03
        # what drives a machine far is the sum of the errors
        assert abs(np.sum(found.values - column)) < 1e-6 * len(true)
    assert np.sqrt(np.mean(misses) / np.mean(claimed)) == pytest.approx(1.0, abs=0.25)


def test_where_machine_and_input_stand_still_the_input_is_constant(tmp_path):
    """Else its estimate would turn a machine there that does not move, and friction that holds it were likely."""
    pushed = 0.3 * ((TIMES > 1.0) & (TIMES < 6.0))
    record, *_ = campaign(tmp_path / "axis", noisy, lambda _: pushed).train
    piece = record.pieces[0]
    column = piece.manoeuvre.inputs["u"]
    still = at_rest(record, piece, column)
    assert still[:70].all()
    assert not still[100:700].any()
    known = smoothed(column, InputNoise(rms=TORQUE_NOISE), still)
    assert np.ptp(known.values[:70]) < 0.02 * TORQUE_NOISE
    errors = known.errors(400, np.random.default_rng(1))[25]
    assert np.std(errors) == pytest.approx(TORQUE_NOISE / np.sqrt(still[:100].sum()), rel=0.2)


@pytest.mark.parametrize("step", [0.0, 0.05])
def test_the_covariance_of_its_error_is_that_of_drawn_columns(step):
    """Two waves are enough: a slow one, along which rounding errors add up, and a fast one."""
    waves, true = cosines(len(TIMES), np.array([3, 200])), 0.5 * np.sin(2.0 * np.pi * 0.2 * TIMES)
    noise = InputNoise(rms=0.0 if step else 0.03, step=step)
    rng = np.random.default_rng(1)
    if step:
        known = smoothed(step * np.rint(true / step), noise, NOWHERE)
        begins = np.flatnonzero(np.diff(np.rint(known.values / step), prepend=np.nan) != 0.0)
        runs = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(TIMES))))
        columns = step * (rng.random((len(begins), 400))[runs] - 0.5)
    else:
        known = smoothed(true + rng.normal(0.0, 0.03, len(TIMES)), noise, NOWHERE)
        columns = rng.normal(0.0, 0.03, (len(TIMES), 400))
    followed = waves.T @ known.solved(columns / known.variance)
    covariance = known.covariance(waves, step)
    # the error is what the estimate follows of the noise, and what it leaves of the input
    least = np.mean(followed**2, axis=1)
    assert np.all(np.diag(covariance) > 0.8 * least)
    assert covariance[0, 0] == pytest.approx(least[0], rel=0.25)


@pytest.mark.nightly
def test_what_a_right_model_leaves_is_turned_white(tmp_path):
    """Of many torques with noise on the same motion; whitened, the misfit of the true model is noise."""
    chi2, lags = [], []
    for seed in range(6):
        records = campaign(tmp_path / f"axis_{seed}", lambda drive, _, s=seed: noisy(drive, np.random.default_rng(s)))
        library, declared = prepared(Model(records.plant), records, candidates={})
        data, z = library.data, declared.records.shares(np.array([INERTIA, DAMPING]))
        assert data.inputs_count
        left = declared.records.plain.residuals(z)[0]
        chi2.append(float(np.mean(left**2)))
        lags += [np.mean(x[lag:] * x[:-lag]) for x in data.by_record(left) for lag in (1, 5, 25)]
    assert np.mean(chi2) == pytest.approx(1.0, abs=0.15)
    assert abs(np.mean(lags)) < 0.03


@pytest.mark.nightly
def test_friction_is_found_beside_it_and_judged_by_the_model_that_the_loop_ends_with(tmp_path):
    """That model has other parameters than the declared one. A sound machine lacks nothing."""
    records = campaign(tmp_path / "axis", noisy)
    sound = close_loop(records, candidates=["coulomb", "viscous"])
    assert sound.verdict == "no_discrepancy"
    inertia = next(e for e in sound.after.estimates if e.name == "inertia")
    assert inertia.low < INERTIA < inertia.high
    assert inertia.trusted
    found = close_loop(records, candidates=["coulomb", "viscous"], fixed={"damping": 0.0})
    assert found.effects == ("viscous",)
    assert found.steps[0].claimed
    rms = found.outputs["angular_velocity"]["moved_by_inputs"]
    fit = identify(records)
    assert rms == pytest.approx(next(iter(moved_by_inputs(fit.train_replays, fit.candidate).values())), rel=0.1)
    unseen = found.outputs["angular_velocity"]["moved_by_inputs_holdout"]
    assert unseen == pytest.approx(fit.outputs["angular_velocity"]["moved_by_inputs_holdout"], rel=0.1)
    assert unseen != pytest.approx(rms, rel=0.01)
    assert report_of(found)["probabilities"]["unknown"] < 0.05
    shown = f"that of the inputs moves the model by {np.rad2deg(unseen):.3g} deg/s"
    assert shown in error_sentence(report_of(found))


def computed(seed):
    return torque(seed + 200) + np.random.default_rng(seed + 200).normal(0.0, TORQUE_NOISE, len(TIMES))


def as_if_noisy(read, rms=TORQUE_NOISE):
    """Return a campaign whose inputs look as if they were measured with noise."""
    noise = {"u": InputNoise(rms=rms)}
    return replace(read, records=tuple(replace(r, input_noise=noise) for r in read.records))


@pytest.mark.nightly
def test_inputs_count_as_exact_where_the_records_are_more_probable_so(tmp_path):
    """What a controller computes of a noisy speed looks as if it were measured with noise, and is exact."""
    records, steps = as_if_noisy(campaign(tmp_path / "axis", exact, computed)), []
    found = close_loop(records, candidates=["coulomb", "viscous"], fixed={"damping": 0.0}, told=steps.append)
    assert "taking the measured inputs as measured with noise" in steps
    assert found.inference.exploration.library.as_read is None
    assert found.effects == ("viscous",)


@pytest.mark.slow
def test_inputs_count_as_exact_where_a_constant_is_off_as_well(tmp_path):
    """Held at its declared value it would leave more than noise, for which the input would be blamed."""
    toml = 'name = "axis"\nplant = "driven_axis"\nhold = "zero"\neffects = ["viscous"]\n[constants]\ngain = 0.94\n'
    toml += f"[tolerances]\ngain = 0.03\n[parameters]\nmass = {{ fixed = {INERTIA} }}\n"
    tables, rng = {}, np.random.default_rng(5)
    for i in range(3):
        drive = computed(i)
        seen = speed(drive) + rng.normal(0.0, SPEED_NOISE, len(TIMES))
        tables[f"r{i}.csv"] = {"time_s": TIMES, "drive_N": drive, "velocity_m_s": seen}
    records, steps = as_if_noisy(read_campaign(write_records(tmp_path / "axis", toml, tables))), []
    found = close_loop(records, candidates=["coulomb"], told=steps.append)
    assert "taking the measured inputs as measured with noise" in steps
    assert found.inference.exploration.library.as_read is None
    assert (found.verdict, found.steps) == ("no_discrepancy", ())
    assert found.inference.best.deviations["gain"] == pytest.approx(0.06 / 0.94 / 0.03, abs=0.2)
