"""The measured machines: campaigns of made-up files of their formats, the table, what is refused."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from armid.contract.check import check_thing
from armid.record import read_campaign
from armid.registry import load_registry
from commands import python


@pytest.fixture
def folder(root):
    return root / "studies" / "measured"


@pytest.fixture
def call(folder):
    """Return a function that runs a program of the folder and returns exit code and what it said."""

    def run(program, *words):
        done = python(folder / program, *words)
        return done.returncode, done.stdout + done.stderr

    return run


def drone_files(to):
    time = np.arange(0.0, 100.0, 0.01)
    angle = 30.0 - 20.0 * np.cos(0.8 * time)
    for name in ("sinal4_multiseno", "sinal2_degraus", "sinal3_swept_sine"):
        table = {"Tempo_s": time, "Referencia": angle, "Saida_y": angle, "Controle_u": 30.0 + angle}
        pd.DataFrame(table).to_csv(to / f"{name}_malha_fechada.csv", index=False)


def test_the_quarter_drone_follows_its_published_protocol(folder, call, tmp_path):
    drone_files(tmp_path)
    assert call("quarter_drone/make_campaign.py", "--data", tmp_path, "--out", tmp_path / "out")[0] == 0
    plants = load_registry([f"{folder / 'quarter_drone' / 'plant.py'}:quarter_drone"]).plants
    campaign = read_campaign(tmp_path / "out", plants)
    lengths = {r.file: (r.role, r.measured.size) for r in campaign.records}
    train, test = ("train", 960), ("holdout", 240)
    assert lengths == {"multisine_train.csv": train, "multisine_test.csv": test, "steps_train.csv": train,
                       "steps_test.csv": test, "swept_test.csv": ("holdout", 1200)}  # fmt: skip
    for record in campaign.records:
        piece = record.pieces[0]
        assert (piece.shown_start, piece.window.start) == ({}, 0)
        start = 20.0 if "test" not in record.file or "swept" in record.file else 68.0
        assert piece.manoeuvre.constants["start_angle"] == pytest.approx(np.radians(30.0 - 20.0 * np.cos(0.8 * start)))
        speed = np.radians(16.0 * np.sin(0.8 * start))
        assert piece.manoeuvre.constants["start_speed"] == pytest.approx(speed, abs=2e-3)


@pytest.mark.slow
def test_the_quarter_drone_keeps_the_contract(folder):
    plant = load_registry([f"{folder / 'quarter_drone' / 'plant.py'}:quarter_drone"]).plants["quarter_drone"]
    assert [f"{f.name}: {f.sentence}" for f in check_thing("plants", "quarter_drone", plant) if not f.passed] == []


def test_the_flexible_link_is_cut_at_12_s(call, tmp_path):
    time = np.arange(0.0, 20.0, 0.002)
    table = {"time_s": time, "commanded_current_A": time, "current_A": np.sin(time), "reference_deg": time,
             "hub_angle_deg": np.sin(2.0 * time), "deflection_deg": 0.1 * np.cos(time)}  # fmt: skip
    pd.DataFrame(table).to_csv(tmp_path / "stage_1.csv", index=False)
    assert call("quanser_flexible_link/make_campaign.py", "--data", tmp_path, "--out", tmp_path / "out")[0] == 0
    campaign = read_campaign(tmp_path / "out")
    assert [(r.role, len(r.whole_pieces)) for r in campaign.records] == [("train", 3), ("holdout", 2)]
    assert [o.name for o in campaign.plant.outputs] == ["hub_angle", "deflection"]
    assert campaign.parameters["stiffness"].fixed == pytest.approx(39.957)
    # of what is 0 nothing is known by a share of it, and starts come from the record
    halves = dict.fromkeys(("gain", "hub_inertia", "tip_inertia", "stiffness", "hub_damping"), 0.5)
    assert (campaign.rough, campaign.tolerances) == (halves, {"gain": 0.5})


def test_files_that_are_not_there_are_named(call, tmp_path):
    code, output = call("quarter_drone/make_campaign.py", "--data", tmp_path, "--out", tmp_path / "out")
    assert code == 2
    assert re.search(r"error: .*(does not exist|No such file)", output)
    assert "Traceback" not in output
    assert not (tmp_path / "out").exists()


def test_a_line_of_the_table_shows_every_output_of_every_record_held_out(folder, call, tmp_path):
    """Of a report that is stored already; machines without data are left out."""
    drone_files(tmp_path)
    out, machine = tmp_path / "out", tmp_path / "quarter_drone"
    machine.mkdir()
    call("quarter_drone/make_campaign.py", "--data", tmp_path, "--out", out / "campaigns" / "quarter_drone")

    def error(size):
        files = ("multisine_train", "multisine_test", "steps_train", "steps_test", "swept_test")
        records = {f"{f}.csv": {"outputs": {"angle": {"rmse": size * np.radians(i)}}} for i, f in enumerate(files)}
        return {"train": {"rmse": 1.0}, "records": records}

    step = {"effect": "coulomb", "alternatives": ["stribeck"]}
    report = {"verdict": "explained", "effects": ["coulomb"], "steps": [step],
              "error": {"before": error(2.0), "after": error(1.0)}}  # fmt: skip
    (out / "quarter_drone").mkdir()
    (out / "quarter_drone" / "report.json").write_text(json.dumps(report))
    (out / "quarter_drone" / "cpu_s.txt").write_text("12\n")
    code, said = call("run.py", "--data", tmp_path, "--out", out)
    assert code == 0, said
    assert "| deg | 2 6 8 | 1 3 4 |" in said
    assert "| coulomb or stribeck | explained | 12 |" in said
    assert said.count("is not there, left out") == 7
    assert (out / "table.md").read_text().count("\n") == 3
