"""Motions that mislead: a fast axis with few samples and no rest, a pendulum upright, an axis with sharp friction."""

from dataclasses import replace

import numpy as np
import pytest

import armid
from armid.estimation.information import start_changes
from armid.inference import prepared
from armid.inference.candidates import EffectKey
from armid.inference.checks import holdout_residuals
from armid.inference.kinds.effects import hypotheses
from armid.inference.kinds.same_law import done_together
from armid.inference.model import unless_diverged
from armid.inference.whitening import WhiteRecords, whitened
from armid.loop import close_loop
from armid.model import EFFECTS, Model
from armid.problem.problem import replays
from armid.problem.space import space_of
from armid.record import read_campaign
from synthetic import write_records

pytestmark = pytest.mark.slow
MASS, NOISE, STEP_S, N = 2.0, 0.02, 0.05, 200


def test_noise_without_a_rest_is_what_the_declared_model_leaves_and_one_that_diverges_does_not_count(tmp_path_factory):
    rng, tables = np.random.default_rng(4), {}
    for file in ("a.csv", "b.csv", "c.csv"):
        force = rng.normal(0.0, 20.0, N)
        speed = np.append(0.0, np.cumsum(force[:-1]) * STEP_S / MASS)
        tables[file] = {"time_s": STEP_S * np.arange(N), "velocity_m_s": speed + NOISE * rng.standard_normal(N),
                        "drive_N": force}  # fmt: skip
    head = 'name = "fast"\nplant = "driven_axis"\nhold = "zero"\n'
    fast = read_campaign(write_records(tmp_path_factory.mktemp("fast"), head, tables))
    library, declared = prepared(Model(fast.plant), fast, {"viscous": EFFECTS["viscous"]})
    assert min(r.noise.rms for r in fast.train) > 5.0 * NOISE
    assert [level.known for level in library.data.levels] == [False, False]
    for level in library.data.levels:
        assert level.rms == pytest.approx(NOISE, rel=0.2)
    assert declared.chi2 / len(declared.residual) == pytest.approx(1.0, abs=0.3)
    assert declared.values["mass"] == pytest.approx(MASS, rel=0.01)
    unseen = holdout_residuals(declared, fast.holdout, library)
    assert [level.rms for level in unseen.data.levels] == [library.data.levels[0].rms]
    assert unless_diverged(lambda: declared) is declared
    alone = type(declared)(declared.active, declared.records, declared.z, declared.residual)
    alone.__dict__["jacobian"] = np.zeros_like(declared.jacobian)
    assert unless_diverged(lambda: alone) is None


@pytest.mark.parametrize(("start", "least", "most"), [(np.pi, 0.2, 2.0), (0.0, 0.0, 0.01)])
def test_the_doubt_of_a_start_bends_where_the_motion_does(tmp_path, start, least, most):
    """Near its upper rest a pendulum falls to either side; where it hangs it swings in proportion."""
    times, rng = 0.01 * np.arange(100), np.random.default_rng(2)
    table = {"time_s": times, "angle_rad": start + 0.01 * rng.standard_normal(100), "drive_N_m": 0.0 * times,
             "angular_velocity_rad_s": 0.1 + 0.2 * rng.standard_normal(100)}  # fmt: skip
    head = 'name = "p"\nplant = "driven_axis"\n[constants]\ngain = 1.0\ngravity_moment = 0.5\n'
    campaign = read_campaign(write_records(tmp_path / "p", head, {"p.csv": table, "q.csv": table}))
    model = Model(campaign.plant)
    space = space_of(model, {}, {"inertia": (0.01, 0.03)})
    records = WhiteRecords(replays(campaign.holdout, model, space), space, whitened(campaign.holdout, campaign.plant))
    slope, bend = np.array(list(start_changes(records, np.array([0.5]), bent=True)))[:2]
    assert next(start_changes(records, np.array([0.5]))) == pytest.approx(slope)
    assert least <= np.linalg.norm(bend) / np.linalg.norm(slope) <= most


LEVEL, OFF, TOLERANCE, SMALL_NOISE = 1.5, 1.04, 0.03, 5e-5
HEAD = """\
name = "sharp"
plant = "driven_axis"
effects = ["coulomb"]
hold = "zero"
[constants]
gain = {gain}
[tolerances]
gain = {tolerance}
[parameters."coulomb.width"]
fixed = 0.001
"""


def tables(rng):
    times = 0.005 * np.arange(800)
    for _ in range(3):
        waves = zip(rng.uniform(0.3, 3.0, 5), rng.uniform(0.0, 6.0, 5), strict=True)
        force = 2.5 * sum(np.sin(2.0 * np.pi * f * times + p) for f, p in waves) * (times > 0.4)
        yield {"time_s": times, "velocity_m_s": force, "drive_N": force}


def campaign(folder, records, gain):
    return read_campaign(write_records(folder, HEAD.format(gain=gain, tolerance=TOLERANCE), records, holdout=0))


@pytest.mark.nightly
def test_force_mass_and_friction_that_grow_alike_are_not_told_apart_by_sharp_friction(tmp_path):
    rng = np.random.default_rng(2)
    records = {f"r{i}.csv": table for i, table in enumerate(tables(rng))}
    made = armid.simulate(campaign(tmp_path / "made", records, OFF), parameters={"mass": MASS, "coulomb.level": LEVEL})
    for file, table in records.items():
        speed = made.tables[file]["velocity_m_s"]
        table["velocity_m_s"] = speed + SMALL_NOISE * rng.standard_normal(len(speed))
    declared = campaign(tmp_path / "declared", records, 1.0)
    found = close_loop(declared.model(), declared, {"torque_offset": EFFECTS["torque_offset"]})
    assert (found.verdict, found.steps) == ("no_discrepancy", ())
    for name, truth in (("mass", MASS), ("coulomb.level", LEVEL)):
        estimate = next(e for e in found.before.estimates if e.name == name)
        assert estimate.value == pytest.approx(truth / OFF, rel=0.01)
        assert estimate.high - estimate.low == pytest.approx(2 * 1.96 * TOLERANCE * estimate.value, rel=0.15)
        assert estimate.low < truth < estimate.high


@pytest.mark.nightly
def test_form_and_width_of_declared_friction_are_fitted_and_no_other_effect_stands_in_for_them(tmp_path):
    rng, toml = np.random.default_rng(8), 'name = "axis"\nplant = "driven_axis"\nhold = "zero"\neffects = ["coulomb"]\n'
    records = {f"r{i}.csv": table for i, table in enumerate(tables(rng))}
    made = read_campaign(write_records(tmp_path / "made", toml.replace("coulomb", "coulomb:tanh"), records, holdout=0))
    width = 0.3 * made.model().parameters["coulomb.width"].fixed
    motion = armid.simulate(made, parameters={"mass": MASS, "coulomb.level": LEVEL, "coulomb.width": width})
    for file, table in records.items():
        speed = motion.tables[file]["velocity_m_s"]
        table["velocity_m_s"] = speed + SMALL_NOISE * rng.standard_normal(len(speed))
    declared = read_campaign(write_records(tmp_path / "declared", toml, records, holdout=0))
    found = close_loop(declared.model(), declared, {n: EFFECTS[n] for n in ("stribeck", "torque_offset", "presliding")})
    assert (found.verdict, found.steps) == ("no_discrepancy", ())
    (sentence,) = (s for s in found.next_steps if s.startswith("Otherwise than by default"))
    assert "coulomb is in its form tanh; coulomb.width is fitted" in sentence
    values = found.parameters
    assert values["coulomb.width"] == pytest.approx(width, rel=0.05)
    assert values["coulomb.level"] == pytest.approx(LEVEL, rel=0.01)


def test_dry_friction_of_the_machine_is_not_looked_for_and_improbable_in_another_form(tmp_path):
    """Two smoothed signs are one friction, but an offset or presliding is another law."""
    rng, toml = np.random.default_rng(3), 'name = "axis"\nplant = "driven_axis"\nhold = "zero"\n'
    records = {f"r{i}.csv": table for i, table in enumerate(tables(rng))}
    own = replace(EFFECTS["coulomb"].every_form[1], name="bearing", form="")
    made = read_campaign(write_records(tmp_path / "made", toml, records, holdout=0))
    motion = armid.simulate(made, effects=[own], parameters={"mass": MASS, "bearing.level": LEVEL})
    for file, table in records.items():
        speed = motion.tables[file]["velocity_m_s"]
        table["velocity_m_s"] = speed + SMALL_NOISE * rng.standard_normal(len(speed))
    declared = read_campaign(write_records(tmp_path / "declared", toml, records, holdout=0))
    candidates = {n: EFFECTS[n] for n in ("coulomb", "viscous", "torque_offset", "presliding", "drive_gain")}
    library, _ = prepared(Model(declared.plant) + own, declared, candidates)
    assert {(k.public, k.form): (d.name, d.exactly) for k, d in library.doubles.items()} == {
        ("coulomb", ""): ("bearing.level", False), ("coulomb", "tanh"): ("bearing.level", True),
        ("coulomb", "arctan"): ("bearing.level", False)}  # fmt: skip
    assert library.left_out == {EffectKey("coulomb", "tanh"): "bearing.level"}
    priors = {(k.public, k.form): h.log_prior for k, h in hypotheses(library).items()}
    assert priors["coulomb", ""] < priors["presliding", ""]


def test_no_record_tells_an_effect_from_what_all_free_parameters_do_together(tmp_path):
    """A gain of the drive scales inertia, damping and weight: with one of these known it is another matter."""
    times, rng = 0.02 * np.arange(200), np.random.default_rng(6)
    table = {"time_s": times, "angle_rad": np.sin(times) + 1e-3 * rng.standard_normal(200), "drive_N_m": np.cos(times)}
    head, tables = (
        'name = "arm"\nplant = "rotary_arm"\n',
        {"a.csv": table, "b.csv": table | {"drive_N_m": np.sin(times)}},
    )
    candidates = {n: EFFECTS[n] for n in ("coulomb", "drive_gain")}
    found = []
    for i, known in enumerate(("", "[parameters]\ndamping = { fixed = 0.1 }\n")):
        arm = read_campaign(write_records(tmp_path / f"{i}", head + known, tables, holdout=0))
        library, fit = prepared(Model(arm.plant), arm, candidates)
        found.append({key.public: names for key in library.joinable(()) if (names := done_together(fit, key, library))})
    assert found == [{"drive_gain": ("inertia", "gravity_moment", "damping")}, {}]


def test_steps_of_what_is_tried_are_those_of_strengths_to_expect(tmp_path):
    """A ripple a thousand times as strong would ask for the finest steps of all fits that hold one."""
    records = {f"r{i}.csv": table for i, table in enumerate(tables(np.random.default_rng(9)))}
    axis = read_campaign(write_records(tmp_path, 'name = "axis"\nplant = "driven_axis"\n', records, holdout=0))
    library, declared = prepared(Model(axis.plant), axis, {n: EFFECTS[n] for n in ("torque_ripple", "drive_delay")})
    assert library.reach > 1.0
    key = EffectKey("torque_ripple")
    problem = library.problem((key,), declared.values)
    anywhere = library.replays(problem.model, problem.space, declared.values, library.misfit)
    most, least = (max(c.schedule.substeps for r in replays for c in r.calibrations)
                   for replays in (anywhere, problem.replays))  # fmt: skip
    assert least < most
