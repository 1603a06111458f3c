"""A stranger's machine: a plant outside of the package, irregular records, its own gains, sagging supply, drive off."""

import json
import re
import sys
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from armid.contract.check import check_thing
from armid.loop import close_loop
from armid.model import EFFECTS, Model, Output, is_late_as_a_whole
from armid.model.effect import zero
from armid.model.effects.sensor import sensor_effects
from armid.problem.problem import replays
from armid.problem.space import space_of
from armid.record import read_campaign
from armid.registry import load_registry
from commands import ended

TRUTH = {"inertia": 0.8, "motor_constant": 1.6, "boom_moment": 4.0, "load_friction.share": 0.15,
         "output_lag.time_constant": 0.012}  # fmt: skip
pytestmark = pytest.mark.filterwarnings("ignore::armid.record.IrregularSamplingWarning")


@pytest.fixture(scope="module")
def folder(root):
    return root / "studies" / "your_own_machine"


@pytest.fixture(scope="module")
def plugin(folder):
    return f"{folder / 'plant.py'}:boom"


@pytest.mark.nightly
def test_the_plant_keeps_the_contract(plugin):
    plant = load_registry([plugin]).plants["boom"]
    assert [f"{f.name}: {f.sentence}" for f in check_thing("plants", "boom", plant) if not f.passed] == []


@pytest.mark.nightly
def test_a_late_voltage_is_no_late_torque(folder, plugin):
    """Told as one, for want of a port at the winding, it would give another inertia, of which nobody may be sure."""
    boom = load_registry([plugin]).plants["boom"]
    ports = {name: unit for name, unit in boom.ports.items() if name != "winding"}
    torque_alone = replace(boom, ports=ports, quantities={**boom.quantities, "winding": zero})
    assert (is_late_as_a_whole(boom), is_late_as_a_whole(torque_alone)) == (False, True)
    said = next(p.sentence for p in check_thing("plants", "boom", torque_alone) if p.name.startswith("late drive"))
    assert "add a port `winding` [V]" in said
    truth = {"inertia": 0.8, "motor_constant": 1.6, "boom_moment": 4.0, "controller_delay.delay": 0.008}
    model = Model(boom) + EFFECTS["controller_delay"].in_form("voltage")
    space, rng = space_of(model, fixed=truth), np.random.default_rng(7)
    records = []
    every = read_campaign(folder / "campaign", {"boom": boom})
    for replay in replays([*every.train, *every.holdout[:1]], model, space):
        signal = replay.signal(space.complete(np.empty((1, 0))))[0]
        signal = signal + replay.record.noise.rms * rng.standard_normal(signal.shape)
        records.append(replay.measuring(signal).record)
    campaign = replace(read_campaign(folder / "campaign", {"boom": torque_alone}), records=tuple(records))
    campaign = campaign.with_window(0.0, 1.8)
    found = close_loop(Model(torque_alone), campaign, {n: EFFECTS[n] for n in ("controller_delay", "output_lag")})
    assert [s.effect for s in found.steps] == ["controller_delay"]
    inertia = found.after.estimates[0]
    assert inertia.low < truth["inertia"] < inertia.high


def test_what_is_read(folder, plugin):
    campaign = read_campaign(folder / "campaign", load_registry([plugin]).plants)
    assert [len(campaign.train), len(campaign.holdout)] == [4, 2]
    # what the plant declares stays, and so does its first input, which is not a force
    assert (campaign.plant.scales.effort, campaign.plant.scales.speed) == (15.0, 4.0)
    gains = {r.file: (r.constants["kp"], r.constants["kd"]) for r in campaign.records}
    assert gains["stiff.csv"] == (90.0, 3.0)
    assert len(set(gains.values())) == 5
    for record in campaign.records:
        assert record.irregularity.share > 0.9
        assert set(record.manoeuvre.inputs) == {"target", "supply", "drive_on"}
        assert np.min(record.manoeuvre.inputs["supply"]) < 22.5
        assert np.rad2deg(record.noise.rms) == pytest.approx(0.8, rel=0.12)
    assert np.max(np.abs(campaign.records[0].manoeuvre.inputs["target"])) == pytest.approx(np.deg2rad(80.0), rel=1e-3)
    off = campaign.records[3]
    on = off.manoeuvre.inputs["drive_on"]
    assert np.sum((on > 0) & (on < 1)) <= 1
    # the impulse of the switch is where the file has it
    rows = np.genfromtxt(folder / "campaign" / off.file, delimiter=",", names=True)
    assert np.sum(on) * off.manoeuvre.interval == pytest.approx(rows["time_s"][rows["drive_on"] == 0][0], abs=2e-5)


@pytest.mark.nightly
def test_the_right_effects_find_the_truth_and_without_them_the_answer_is_wrong(capsys, folder, plugin, tmp_path):
    def identified(effects):
        out = tmp_path / f"with {effects}"
        words = ("--identifier", "least_squares", "--fitness", "rmse", "--budget", "600", "--effects", effects)
        assert ended("identify", folder / "campaign", "--plugin", plugin, *words, "--out", out) == 0
        return json.loads((out / "result.json").read_text())

    result = identified("load_friction,output_lag")
    for name, truth in TRUTH.items():
        found = result["parameters"][name]
        assert found["low"] < truth < found["high"], name
        assert found["high"] - found["low"] < 0.03 * truth
    assert result["error"]["holdout"]["chi2_per_sample"] == pytest.approx(1.0, abs=0.1)
    assert not any(p["bound_active"] for p in result["parameters"].values())
    result = identified("")
    motor = result["parameters"]["motor_constant"]
    assert motor["low"] > 1.15 * TRUTH["motor_constant"]
    assert result["error"]["holdout"]["chi2_per_sample"] > 30
    assert "the model lacks something" in capsys.readouterr().out


@pytest.mark.nightly
def test_the_loop_finds_both_and_no_more(folder, plugin, tmp_path):
    words = ("--threads", "1", "--out", tmp_path, "--candidates", "load_friction,output_lag,viscous")
    assert ended("close-loop", folder / "campaign", "--plugin", plugin, *words) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    assert [step["effect"] for step in report["steps"]] == ["load_friction", "output_lag"]
    assert report["verdict"] == "explained"


@pytest.mark.slow
def test_the_records_are_those_of_the_script(folder, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    import make_records

    make_records.main(tmp_path)
    assert (tmp_path / "campaign.toml").read_text() == (folder / "campaign" / "campaign.toml").read_text()
    for entry in tomllib.loads((tmp_path / "campaign.toml").read_text())["records"]:
        made, kept = (np.loadtxt(f / entry["file"], delimiter=",", skiprows=1) for f in (tmp_path, folder / "campaign"))
        # the last digits are the solver's
        np.testing.assert_allclose(made, kept, atol=0.021)
    sys.modules.pop("make_records")


def test_the_text_names_what_there_is(folder):
    text = (folder.parent / "guide" / "pages" / "your_machine.md").read_text()
    lines = len((folder / "plant.py").read_text().splitlines())
    assert f"{lines} lines" in text
    plant = (folder / "plant.py").read_text()
    for name in re.findall(r"^def (\w+)|^    (\w+)=", plant, flags=re.M):
        assert f"`{name[0] or name[1]}`" in text, name


def test_it_may_record_its_angle_and_current_too(folder, plugin):
    """As the guide shows; the records bring the angle, and no current."""
    boom = load_registry([plugin]).plants["boom"]
    plant = replace(
        boom, output="", output_unit="", ports={**boom.ports, "angle_sensor": "rad"},
        quantities={**boom.quantities, "recorded_angle": lambda q, angle_sensor: q + angle_sensor},
        outputs=(Output("angular_velocity", "recorded_speed", "rad/s", port="output"),
                 Output("angle", "recorded_angle", "rad", port="angle_sensor"), Output("current", "current", "A")),
    )  # fmt: skip
    campaign = read_campaign(folder / "campaign", {"boom": plant})
    assert [o.name for o in campaign.plant.outputs] == ["angular_velocity", "angle"]
    assert [o.name for o in campaign.unmeasured] == ["current"]
    assert all(p.shown_start for r in campaign.train for p in r.pieces)
    assert not any(p.shown_start for r in campaign.holdout for p in r.pieces)
    assert {"angle_bias", "angle_scale", "angle_lag"} <= set(sensor_effects(campaign.plant))
