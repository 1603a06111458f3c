"""The importers of EMPS and of DFKI's pendulum, on small synthetic sets of the same layout and on the measured ones."""

import os
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.io import savemat

from armid.errors import ArmidError
from armid.record import read_campaign
from commands import ended, refusing
from measured.importers import import_dfki, import_emps, velocity_of

REPOSITORY = Path(__file__).resolve().parents[2]
NOT_AT_HAND = "the measured files are no part of the repository: ARMID_MEASURED names the folder that holds them"
MEASURED = Path(os.environ.get("ARMID_MEASURED", REPOSITORY.parent / "shared" / "data"))
GAIN = 35.15


def variables(amplitude=0.1):
    times = np.arange(2001) / 1000
    column = times[:, np.newaxis]
    position = np.round(amplitude * np.sin(2 * column) / 5e-8) * 5e-8
    return {"t": column, "qm": position, "qg": position, "vir": 3 * np.cos(2 * column), "gtau": GAIN,
            "kp": 160.18, "kv": 243.45}  # fmt: skip


@pytest.fixture
def emps(tmp_path):
    folder = tmp_path / "set"
    folder.mkdir()
    savemat(folder / "DATA_EMPS.mat", variables())
    savemat(folder / "DATA_EMPS_PULSES.mat", {**variables(0.2), "pulses_N": np.zeros((2001, 1), np.uint8)})
    return folder


def test_campaign_of_a_synthetic_axis(emps, tmp_path):
    campaign = read_campaign(import_emps(emps, tmp_path / "out"))
    assert (campaign.name, campaign.plant.name, campaign.unit) == ("emps", "driven_axis", "m/s")
    assert [r.file for r in campaign.train] == ["DATA_EMPS.csv"]
    assert [r.file for r in campaign.holdout] == ["DATA_EMPS_PULSES.csv"]
    record, set_ = campaign.train[0], variables()
    times = set_["t"].ravel()
    assert record.constants["gain"] == GAIN
    assert record.manoeuvre.interval == 0.001
    np.testing.assert_array_equal(record.manoeuvre.inputs["u"], set_["vir"].ravel())
    np.testing.assert_array_equal(record.columns["position_m"], set_["qm"].ravel())
    # away from the ends, where the filter has both sides, the velocity is true to a hundredth of a per cent
    np.testing.assert_allclose(record.measured[50:-50], 0.2 * np.cos(2 * times)[50:-50], atol=3e-5)
    # at the ends the filter has one side only
    assert record.pieces[0].manoeuvre.constants["start_speed"] == pytest.approx(0.2, abs=2e-3)
    text = (tmp_path / "out" / "campaign.toml").read_text()
    assert "Butterworth low-pass of order 4 at 100 Hz" in text
    assert "Janot" in text
    assert "licence" in text


def test_velocity_has_no_phase_shift_and_the_stated_cutoff():
    times = np.arange(4000) / 1000
    for frequency, gain in ((5.0, 1.0), (100.0, 0.5)):
        angle = 2 * np.pi * frequency
        velocity = velocity_of(np.sin(angle * times) / angle, 0.001)[500:-500]
        wave = np.exp(-1j * angle * times[500:-500])
        response = 2 * np.mean(velocity * wave)
        # a central difference itself takes sin(x)/x of a wave
        assert abs(response) == pytest.approx(gain * np.sinc(2 * frequency / 1000), rel=0.01)
        assert abs(np.angle(response)) < 0.005


@pytest.mark.parametrize(("name", "change", "fragments"), [
    ("DATA_EMPS", {"vir": None}, ["DATA_EMPS.mat", "'vir' is missing"]),
    ("DATA_EMPS", {"vir": np.zeros((7, 1))}, ["DATA_EMPS.mat", "2001, 2001, 7, 1"]),
    ("DATA_EMPS", {"qm": np.full((2001, 1), np.nan)}, ["'qm'", "finite"]),
    ("DATA_EMPS", {"t": np.arange(2001) ** 1.5}, ["intervals of t"]),
    ("DATA_EMPS", {"t": np.arange(2001) / 50}, ["intervals of t", "0.004"]),
    ("DATA_EMPS_PULSES", {"gtau": 1.0}, ["DATA_EMPS_PULSES.mat", "gtau is 1", "35.15"]),
])  # fmt: skip
def test_refused_variables(emps, tmp_path, name, change, fragments):
    kept = {key: value for key, value in {**variables(), **change}.items() if value is not None}
    savemat(emps / f"{name}.mat", kept)
    with refusing(*fragments):
        import_emps(emps, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_refused_files(emps, tmp_path):
    (emps / "DATA_EMPS_PULSES.mat").unlink()
    with pytest.raises(ArmidError, match=r"DATA_EMPS_PULSES\.mat' does not exist"):
        import_emps(emps, tmp_path / "out")
    whole = (emps / "DATA_EMPS.mat").read_bytes()
    for damaged in (b"", b"garbage" * 50, whole[:200], whole[:9000], whole[:128] + b"\xff" * 500):
        (emps / "DATA_EMPS.mat").write_bytes(damaged)
        with pytest.raises(ArmidError, match=r"DATA_EMPS\.mat"):
            import_emps(emps, tmp_path / "out")


def test_the_package_is_asked_where_no_folder_is_named_and_missing_it_is_said(emps, tmp_path, monkeypatch):
    files = [str(emps / name) for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")]
    package = SimpleNamespace(EMPS=lambda data_file_locations: files if data_file_locations else None)
    monkeypatch.setitem(sys.modules, "nonlinear_benchmarks", package)
    assert read_campaign(import_emps(None, tmp_path / "out")).name == "emps"
    monkeypatch.setitem(sys.modules, "nonlinear_benchmarks", None)
    with pytest.raises(ArmidError, match=r"armid\[measured\]"):
        import_emps(None, tmp_path / "out")

    def fails(data_file_locations):
        raise ConnectionError("no network")

    monkeypatch.setitem(sys.modules, "nonlinear_benchmarks", SimpleNamespace(EMPS=fails))
    with pytest.raises(ArmidError, match="could not be downloaded: 'no network'"):
        import_emps(None, tmp_path / "out")


@pytest.mark.skipif(not (MEASURED / "emps" / "DATA_EMPS.mat").is_file(), reason=NOT_AT_HAND)
def test_the_measured_axis(tmp_path):
    campaign = read_campaign(import_emps(MEASURED / "emps", tmp_path / "out"))
    train, holdout = campaign.records
    assert train.n_samples == holdout.n_samples == 24841
    assert train.duration == pytest.approx(24.84)
    assert train.irregularity is None
    assert not train.is_noise_free
    assert train.constants["gain"] == pytest.approx(35.15065, abs=1e-5)
    assert campaign.plant.scales.effort == pytest.approx(152.05, abs=0.01)
    # where the encoder began and ended is what the velocity adds up to
    travelled = np.cumsum(train.measured) * 0.001
    np.testing.assert_allclose(travelled, train.columns["position_m"] - train.columns["position_m"][0], atol=1e-4)


DFKI_RECORDS = ("ddp", "direct_collocation")


def columns(interval):
    times = interval * np.arange(int(2.5 / interval))
    return {"time": times, "position": 0.4 * np.sin(3 * times), "velocity": 1.2 * np.cos(3 * times),
            "torque": 0.5 * np.sin(3 * times)}  # fmt: skip


def write_dfki(folder, name, table):
    np.savetxt(folder / f"{name}_measured.csv", np.column_stack(list(table.values())), delimiter=",",
               header=",".join(table), comments="")  # fmt: skip


@pytest.fixture
def dfki(tmp_path):
    folder = tmp_path / "set"
    folder.mkdir()
    for name, interval in zip(DFKI_RECORDS, (0.002, 0.003), strict=True):
        write_dfki(folder, name, columns(interval))
    return folder


def test_campaign_of_a_synthetic_pendulum(dfki, tmp_path):
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


@pytest.mark.slow
def test_nothing_free_is_identified_through_the_command(dfki, tmp_path, capsys):
    out = tmp_path / "out"
    assert ended("import", "dfki", dfki, "--out", out, "--holdout", "ddp") == 0
    # the records are made with other constants than those from CAD, which the data checks see
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        assert ended("identify", out, "--fitness", "rmse", "--budget", "12000") == 0
    held = read_campaign(out)
    assert ([r.file for r in held.train], [r.file for r in held.holdout]) == (["direct_collocation.csv"], ["ddp.csv"])
    text, told = capsys.readouterr()
    assert "bounds or fixed values look wrong" in told
    assert "0 of 12000 simulations used, no parameter is free" in text
    assert "the model, in which nothing is free, lacks something" in " ".join(text.split())
    assert "has not come to the minimum" not in text


@pytest.mark.parametrize(("change", "holdout", "fragments"), [
    ({"torque": None}, None, ["ddp_measured.csv, line 1", "'torque' is missing", "velocity"]),
    ({"torque": "absent"}, None, ["ddp_measured.csv does not exist", "results/"]),
    ({}, "dpd", ["holdout 'dpd'", "did you mean 'ddp'"]),
])  # fmt: skip
def test_refused_pendulum(dfki, tmp_path, change, holdout, fragments):
    if change.get("torque", "") is None:
        write_dfki(dfki, "ddp", {k: v for k, v in columns(0.002).items() if k != "torque"})
    elif change:
        (dfki / "ddp_measured.csv").unlink()
    with refusing(*fragments):
        import_dfki(dfki, tmp_path / "out", holdout)
    assert not (tmp_path / "out").exists()


@pytest.mark.filterwarnings("ignore::armid.record.IrregularSamplingWarning")
@pytest.mark.skipif(not (MEASURED / "dfki_simple_pendulum" / "ddp_measured.csv").is_file(), reason=NOT_AT_HAND)
def test_the_measured_pendulum(tmp_path):
    ddp, collocation = read_campaign(import_dfki(MEASURED / "dfki_simple_pendulum", tmp_path / "out")).records
    assert [len(ddp.pieces), len(collocation.pieces)] == [6, 3]
    assert ddp.manoeuvre.interval == pytest.approx(0.002, rel=1e-3)
    assert np.max(np.abs(collocation.measured)) == pytest.approx(9.4, abs=0.05)
    # the speed that the drive tells adds up to 2 % less than its encoder moved
    travelled = np.sum(ddp.measured) * ddp.manoeuvre.interval
    assert travelled == pytest.approx(np.ptp(ddp.columns["angle_rad"][[0, -1]]), rel=0.03)
