"""The importer of DFKI's pendulum, on a synthetic set of the same layout and, where at hand, on the measured one."""

import os
from pathlib import Path

import numpy as np
import pytest

from armid.cli.main import main
from armid.errors import ArmidError
from armid.record import read_campaign
from armid.record.importers import import_dfki

REPOSITORY = Path(__file__).resolve().parents[2]
MEASURED = Path(os.environ.get("ARMID_MEASURED", REPOSITORY.parent / "shared" / "data")) / "dfki_simple_pendulum"
NAMES = ("ddp", "direct_collocation")


def columns(interval):
    times = interval * np.arange(int(2.5 / interval))
    return {"time": times, "position": 0.4 * np.sin(3 * times), "velocity": 1.2 * np.cos(3 * times),
            "torque": 0.5 * np.sin(3 * times)}  # fmt: skip


def write(folder, name, table):
    np.savetxt(folder / f"{name}_measured.csv", np.column_stack(list(table.values())), delimiter=",",
               header=",".join(table), comments="")  # fmt: skip


@pytest.fixture
def dfki(tmp_path):
    """Return a folder with a synthetic set."""
    folder = tmp_path / "set"
    folder.mkdir()
    for name, interval in zip(NAMES, (0.002, 0.003), strict=True):
        write(folder, name, columns(interval))
    return folder


def test_campaign_of_a_synthetic_set(dfki, tmp_path):
    campaign = read_campaign(import_dfki(dfki, tmp_path / "out"))
    assert (campaign.name, campaign.plant.name, campaign.unit) == ("dfki", "driven_axis", "rad/s")
    assert [r.file for r in campaign.train] == ["ddp.csv", "direct_collocation.csv"]
    assert campaign.holdout == ()
    # a rod of 0.13 kg, 0.5 m long, with 0.546 kg at its end, and a rotor behind a gear of 6:1
    assert campaign.records[0].constants["gravity_moment"] == pytest.approx(9.81 * (0.546 + 0.065) * 0.5, rel=1e-4)
    inertia = 0.546 * 0.25 + 0.13 * 0.25 / 3 + 36 * 6.0719e-5
    assert campaign.parameters["inertia"].fixed == pytest.approx(inertia, rel=1e-4)
    record = campaign.records[1]
    np.testing.assert_array_equal(record.manoeuvre.inputs["u"], columns(0.003)["torque"])
    np.testing.assert_array_equal(record.columns["angle_rad"], columns(0.003)["position"])
    assert [p.start_index for p in record.pieces] == [0, 333]
    assert record.pieces[1].manoeuvre.constants["start_position"] == pytest.approx(0.4 * np.sin(3 * 0.999), abs=1e-6)
    text = (tmp_path / "out" / "campaign.toml").read_text()
    for word in ("ESTIMATES", "BSD-3-Clause", "doi:10.21105/joss.03884", "ed17ea2d32a3"):
        assert word in text


def test_a_record_is_held_out(dfki, tmp_path):
    campaign = read_campaign(import_dfki(dfki, tmp_path / "out", "ddp"))
    assert ([r.file for r in campaign.train], [r.file for r in campaign.holdout]) == (
        ["direct_collocation.csv"], ["ddp.csv"])  # fmt: skip


def test_nothing_free_is_identified_through_the_command(dfki, tmp_path, capsys):
    out = tmp_path / "out"
    for command in (["import", "dfki", str(dfki), "--out", str(out), "--holdout", "ddp"],
                    ["identify", str(out), "--fitness", "rmse"]):  # fmt: skip
        with pytest.raises(SystemExit) as left:
            main(command)
        assert left.value.code == 0
    text = capsys.readouterr().out
    assert "0 of 12000 simulations used, no parameter is free" in text
    assert "the model, in which nothing is free, lacks something" in " ".join(text.split())
    assert "has not come to the minimum" not in text


@pytest.mark.parametrize(("change", "holdout", "fragments"), [
    ({"torque": None}, None, ["ddp_measured.csv, line 1", "'torque' is missing", "velocity"]),
    ({"torque": "absent"}, None, ["ddp_measured.csv does not exist", "results/"]),
    ({}, "dpd", ["--holdout 'dpd'", "did you mean 'ddp'"]),
])  # fmt: skip
def test_refused(dfki, tmp_path, change, holdout, fragments):
    if change.get("torque", "") is None:
        write(dfki, "ddp", {k: v for k, v in columns(0.002).items() if k != "torque"})
    elif change:
        (dfki / "ddp_measured.csv").unlink()
    with pytest.raises(ArmidError) as refusal:
        import_dfki(dfki, tmp_path / "out", holdout)
    for fragment in fragments:
        assert fragment in str(refusal.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.filterwarnings("ignore::armid.record.IrregularSamplingWarning")
@pytest.mark.skipif(not (MEASURED / "ddp_measured.csv").is_file(), reason="the measured files of DFKI's pendulum are "
                    "not at hand: ARMID_MEASURED names the folder that holds dfki_simple_pendulum/")  # fmt: skip
def test_the_measured_set(tmp_path):
    ddp, collocation = read_campaign(import_dfki(MEASURED, tmp_path / "out")).records
    assert [len(ddp.pieces), len(collocation.pieces)] == [6, 3]
    assert ddp.manoeuvre.interval == pytest.approx(0.002, rel=1e-3)
    assert np.max(np.abs(collocation.measured)) == pytest.approx(9.4, abs=0.05)
    # the speed that the drive tells adds up to 2 % less than its encoder moved
    travelled = np.sum(ddp.measured) * ddp.manoeuvre.interval
    assert travelled == pytest.approx(np.ptp(ddp.columns["angle_rad"][[0, -1]]), rel=0.03)
