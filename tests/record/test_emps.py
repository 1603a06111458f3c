"""The importer of EMPS, on a small synthetic set of the same layout and, where it is at hand, on the measured one."""

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.io import savemat

from armid.errors import ArmidError
from armid.record import read_campaign
from armid.record.importers import import_emps, velocity_of

REPOSITORY = Path(__file__).resolve().parents[2]
MEASURED = Path(os.environ.get("ARMID_MEASURED", REPOSITORY.parent / "shared" / "data")) / "emps"
GAIN = 35.15


def variables(amplitude=0.1):
    times = np.arange(2001) / 1000
    column = times[:, np.newaxis]
    position = np.round(amplitude * np.sin(2 * column) / 5e-8) * 5e-8
    return {"t": column, "qm": position, "qg": position, "vir": 3 * np.cos(2 * column), "gtau": GAIN,
            "kp": 160.18, "kv": 243.45}  # fmt: skip


@pytest.fixture
def emps(tmp_path):
    """Return a folder with a synthetic set."""
    folder = tmp_path / "set"
    folder.mkdir()
    savemat(folder / "DATA_EMPS.mat", variables())
    savemat(folder / "DATA_EMPS_PULSES.mat", {**variables(0.2), "pulses_N": np.zeros((2001, 1), np.uint8)})
    return folder


def test_campaign_of_a_synthetic_set(emps, tmp_path):
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
    ("DATA_EMPS", {"qm": "text"}, ["'qm'", "finite"]),
    ("DATA_EMPS", {"t": np.arange(2001) ** 1.5}, ["intervals of t"]),
    ("DATA_EMPS", {"t": np.arange(2001) / 50}, ["intervals of t", "0.004"]),
    ("DATA_EMPS", {"t": np.zeros(2001)}, ["intervals of t"]),
    ("DATA_EMPS_PULSES", {"gtau": 1.0}, ["DATA_EMPS_PULSES.mat", "gtau is 1", "35.15"]),
])  # fmt: skip
def test_refused_variables(emps, tmp_path, name, change, fragments):
    kept = {key: value for key, value in {**variables(), **change}.items() if value is not None}
    savemat(emps / f"{name}.mat", kept)
    with pytest.raises(ArmidError) as refusal:
        import_emps(emps, tmp_path / "out")
    for fragment in fragments:
        assert fragment in str(refusal.value)
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


def test_the_package_is_asked_where_no_folder_is_named(emps, tmp_path, monkeypatch):
    files = [str(emps / name) for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")]
    package = SimpleNamespace(EMPS=lambda data_file_locations: files if data_file_locations else None)
    monkeypatch.setitem(sys.modules, "nonlinear_benchmarks", package)
    assert read_campaign(import_emps(None, tmp_path / "out")).name == "emps"


def test_a_missing_package_or_network_is_said(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "nonlinear_benchmarks", None)
    with pytest.raises(ArmidError, match=r"armid\[measured\]"):
        import_emps(None, tmp_path / "out")

    def fails(data_file_locations):
        raise ConnectionError("no network")

    monkeypatch.setitem(sys.modules, "nonlinear_benchmarks", SimpleNamespace(EMPS=fails))
    with pytest.raises(ArmidError, match="could not be downloaded: 'no network'"):
        import_emps(None, tmp_path / "out")


@pytest.mark.skipif(not (MEASURED / "DATA_EMPS.mat").is_file(), reason="the measured EMPS files are not at hand: they "
                    "are not part of the repository; ARMID_MEASURED names the folder that holds emps/")  # fmt: skip
def test_the_measured_set(tmp_path):
    campaign = read_campaign(import_emps(MEASURED, tmp_path / "out"))
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
