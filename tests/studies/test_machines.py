"""Eight simulated machines: their simulator against armid's engine, what campaigns hold, and that armid reads them."""

import json
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from armid.engine import Schedule, prepare
from armid.model import EFFECTS, Manoeuvre, Model, applicable
from armid.model.effects.sensor import sensor_effects
from armid.record import RecordWarning, read_campaign
from machines.campaign import files_of
from machines.catalogue import MACHINES
from machines.draw import STEP, chosen_forms, drawn, plan
from machines.forms import FORMS, WIDTH
from machines.integrate import Planted, simulate
from machines.make import main
from machines.plants import PLANTS
from machines.sensors import NOISE

OF_NAME = {plant.name: plant for plant in PLANTS}
DT, N = 0.01, 200
SEED_4 = ["--seed", "4", "--count", str(len(MACHINES))]


def numbers_of(machine):
    rng = np.random.default_rng(4)
    return {name: float(rng.uniform(*r)) for name, r in {**machine.parameters, **machine.constants}.items()}


def both(name, hold, planted=(), effects=(), values=None, n_sub=10):
    """Simulate a machine here and by armid's engine; return the outputs of each over the speed scale.

    effects: of the engine; None: it is not asked.
    """
    machine, plant = MACHINES[name], OF_NAME[name]
    numbers, times = numbers_of(machine), DT * np.arange(N)
    command = machine.limit(numbers) * (0.4 * np.sin(5.0 * times) + 0.4 * np.sign(np.sin(3.1 * times)))
    inputs = {i: np.full(N, 10.0) if i == "supply" else command for i in machine.inputs}
    ours = simulate(machine, numbers, {k: v[None] for k, v in inputs.items()}, DT, n_sub, hold, planted)
    if effects is None:
        return SimpleNamespace(ours=ours[:, 0, ::n_sub] / machine.speed)
    model = Model(plant, tuple(effects))
    known = {**numbers, **{n: p.fixed for n, p in model.parameters.items() if p.fixed is not None}, **(values or {})}
    manoeuvre = Manoeuvre(DT, N, {c: numbers[c] for c in machine.constants}, inputs, hold)
    run = prepare(model, manoeuvre, Schedule(substeps=4 * n_sub)).run(np.array([[known[p] for p in model.parameters]]))
    return SimpleNamespace(ours=ours[:, 0, ::n_sub] / machine.speed, theirs=run.outputs[:, 0] / machine.speed)


def form_of(family, form):
    return next(f for f in FORMS if (f.family, f.form) == (family, form))


@pytest.mark.nightly
@pytest.mark.parametrize("name", MACHINES)
def test_simulator_and_engine_agree_on_every_plain_machine(name):
    for hold, tolerance in (("zero", 2e-6), ("linear", 1e-5)):
        run = both(name, hold)
        assert np.ptp(run.ours, axis=1).min() > 1e-3
        np.testing.assert_allclose(run.ours, run.theirs, atol=tolerance)


LISTED = (
    ("motor_disc", "dead_time", "drive", {"delay": 0.037}, "drive_delay:voltage", {"delay": 0.037}),
    ("cart", "dead_time", "drive", {"delay": 0.025}, "drive_delay:voltage", {"delay": 0.025}),
    ("wheel_pwm", "dead_zone", "subtracting", {"zone": 0.5}, "dead_zone", {"zone": 0.5}),
    ("propeller_pendulum", "lag", "actuator", {"time": 0.1}, "drive_lag:actuator", {"time_constant": 0.1}),
    ("unbalanced_disc", "lag", "sensor", {"time": 0.04}, "angle_lag", {"time_constant": 0.04}),
    ("position_servo", "load_friction", "proportional", {"share": 0.3}, "load_friction",
     {"share": 0.3, "width": WIDTH * 8.0, "least": 0.005 * 0.6}),
    ("hydraulic_boom", "dry_friction", "dahl", {"level": 0.05, "way": 0.01}, "presliding",
     {"level": 0.05, "way": 0.01, "width": WIDTH * 0.6}),
    ("elastic_joint", "backlash", "coupling", {"gap": 0.03}, "backlash", {"width": 0.03}),
    ("cart", "saturation", "hard", {"sharpness": 0.4}, "drive_saturation:hard", {"sharpness": 0.4}),
    ("cart", "saturation", "rational", {"sharpness": 0.4}, "drive_saturation:rapp",
     {"sharpness_squared": 0.16, "knee": 1.0}),
    ("motor_disc", "dry_friction", "hess_soom", {"level": 0.1, "excess": 0.5, "fade": 10.0},
     "coulomb+stribeck:hess_soom", {"coulomb.level": 0.1, "coulomb.width": WIDTH * 100.0, "stribeck.level": 0.05,
                                    "stribeck.fade": 10.0, "stribeck.width": WIDTH * 100.0}),
    # one way alone is both ways less, and a difference
    ("motor_disc", "asymmetry", "gain", {"share": 0.2}, "drive_asymmetry+drive_gain",
     {"drive_asymmetry.difference": -0.1, "drive_gain.error": -0.1}),
)  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "family", "form", "sizes", "effect", "values"), LISTED)
def test_a_form_that_the_library_holds_is_its_form(name, family, form, sizes, effect, values):
    plant = OF_NAME[name]
    words = [word.partition(":") for word in effect.split("+")]
    library = applicable({**sensor_effects(plant), **EFFECTS}, plant)
    known = [library[word].in_form(of_form) if of_form else library[word] for word, _, of_form in words]
    values = {n if "." in n else f"{words[0][0]}.{n}": v for n, v in values.items()}
    planted = Planted(form_of(family, form), sizes)
    plain = both(name, "zero", effects=None)
    # friction that changes its sign takes short steps
    run = both(name, "zero", [planted], known, values, n_sub=40)
    moved = np.max(np.abs(run.ours - plain.ours))
    assert moved > 1e-3
    assert np.max(np.abs(run.ours - run.theirs)) < 2e-3 * moved


def test_the_longest_step_is_short_enough_for_dry_friction():
    machine = MACHINES["position_servo"]
    numbers, times = numbers_of(machine), DT * np.arange(120)
    target = machine.limit(numbers) * (0.5 * np.sin(5.0 * times) + 0.4 * np.sign(np.sin(3.1 * times)))
    inputs = {"goal": target[None], "supply": np.full((1, 120), 8.0)}
    planted = [Planted(form_of("dry_friction", "coulomb"), {"level": 0.08 * machine.effort})]
    coarse, fine = (
        simulate(machine, numbers, inputs, DT, n, "zero", planted)[0, 0, ::n] for n in (round(DT / STEP), 40)
    )
    # the smallest noise is half of the smallest rms that a sensor draws
    smallest = 0.5 * 10.0 ** NOISE[0] * np.sqrt(np.mean(fine**2))
    assert 0.0 < np.sqrt(np.mean((coarse - fine) ** 2)) < 0.1 * smallest


def test_plants_have_the_scales_of_machines_and_the_library_lacks_two_of_five_forms():
    for name, machine in MACHINES.items():
        plant = OF_NAME[name]
        assert (machine.effort, machine.speed) == (plant.scales.effort, plant.scales.speed)
        assert set(machine.parameters) == {p.name for p in plant.parameters}
        known = applicable({**sensor_effects(plant), **EFFECTS}, plant)
        listed = {e for f in FORMS if f.fits(machine) for names in f.library(machine) for e in names}
        assert listed <= set(known), name
    listed = []
    for index in range(60):
        planned, rng = plan(7, index, list(MACHINES))
        forms = chosen_forms(planned, rng)
        assert [bool(f.library(planned.machine)) for f in forms] == list(planned.listed)
        assert len({f.family for f in forms}) == len(forms)
        listed += planned.listed
        assert 2 <= planned.n_records <= 30
        assert 20.0 <= planned.rate_hz <= 2000.0
        assert all(0.0 <= t <= 0.05 for t in planned.tolerances.values())
    assert len(listed) > 50
    assert 1.0 - np.mean(listed) >= 0.4


@pytest.fixture(scope="module")
def every_machine(tmp_path_factory):
    """A folder with a campaign of each machine, and their key."""
    folder = tmp_path_factory.mktemp("machines") / "all"
    assert main([str(folder), *SEED_4]) == 0
    return folder, json.loads(folder.with_name("all.key.json").read_text())


@pytest.mark.nightly
def test_campaigns_are_the_same_for_the_same_seed_also_after_a_cut(every_machine, tmp_path):
    folder, key = every_machine
    again, last = tmp_path / "all", list(key["campaigns"])[-1]
    again.mkdir()
    first = {name: entry for name, entry in key["campaigns"].items() if name != last}
    (tmp_path / "all.key.part.json").write_text(json.dumps({**key, "campaigns": first}))
    assert main([str(again), *SEED_4]) == 0
    assert json.loads((tmp_path / "all.key.json").read_text()) == key
    files = sorted(f.name for f in (folder / last).iterdir())
    assert files == sorted(f.name for f in (again / last).iterdir())
    assert all((folder / last / f).read_bytes() == (again / last / f).read_bytes() for f in files)


@pytest.mark.nightly
def test_armid_reads_a_campaign_of_every_machine_and_the_key_holds_its_truth(every_machine):
    folder, entries = every_machine[0], every_machine[1]["campaigns"]
    assert [e["machine"] for e in entries.values()] == list(MACHINES)
    assert {e["machine"] for e in entries.values() if e["left_out"]} == {"unbalanced_disc", "elastic_joint"}
    for name, entry in entries.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RecordWarning)
            campaign = read_campaign(folder / name, OF_NAME)
        assert [r.file for r in campaign.records] == [r["file"] for r in entry["records"]]
        assert campaign.tolerances == {n: t for n, t in entry["tolerances"].items() if t > 0.0}
        for constant, share in entry["constants"].items():
            assert abs(share) <= 2.0 * entry["tolerances"][constant] + 1e-12
        assert all(effect["moves"] > 1.0 for effect in entry["effects"])
        assert set(entry["parameters"]) == {p.name for p in campaign.plant.parameters}


@pytest.mark.nightly
def test_noise_in_a_record_is_what_the_key_says():
    planned, rng = plan(12, 0, ["hydraulic_boom"])
    campaign = drawn(planned, rng)
    files, entry = files_of("c000", campaign, rng)
    assert set(files) == {"campaign.toml", *(r["file"] for r in entry["records"])}
    for record in entry["records"]:
        rms = entry["noise"]["rms"]["angle"]
        assert 0.7 * rms < record["noise"]["angle"] < 1.3 * rms


@pytest.mark.parametrize(("words", "sentence"), [
    (["new", "--seed", "1", "--count", "1", "--only", "crane"], "machine 'crane' is unknown"),
    (["new", "--seed", "-1", "--count", "1"], "the seed is -1"),
    (["new", "--seed", "1", "--count", "0"], "the count is 0"),
    (["full", "--seed", "1", "--count", "1"], "exists already"),
])  # fmt: skip
def test_a_command_that_cannot_be_done_is_refused(refuses, words, sentence):
    refuses(main, words, sentence)
