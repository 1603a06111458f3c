"""Inputs of simulated cases: signals by name, columns of a file, and studies of random cases that they drive."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import periodogram

from armid.errors import ArmidError
from armid.study.analyses.analysis import Evidence, wide_runs
from armid.study.inputs import SIGNALS, input_values
from armid.study.results import load_study
from armid.study.runner import run_study
from armid.study.tasks import read_study
from commands import refusing

TIMES = 1e-3 * np.arange(4001)
STUDY = """\
name = "driven"
plant = "driven_axis"
budget = 200
seeds = 1
fitness = "rmse"
interval_s = 0.005
effects = ["viscous"]
bounds = {{ mass = [1.0, 4.0], "viscous.slope" = [0.5, 6.0] }}

[[identifiers]]
name = "least_squares"

[random_cases]
n = 3
seed = 2
margin = 0.1
manoeuvres = [{{ duration_s = 2.0, inputs = {{ u = {input} }} }}]
"""


def signal(kind, **keys):
    return input_values({"kind": kind, "amplitude": 2.0, "offset": 0.5, **keys}, TIMES)


def test_signals_are_what_their_names_say():
    chirp = signal("chirp", from_hz=1.0, to_hz=9.0)
    assert chirp[0] == pytest.approx(0.5)
    assert (chirp.max(), chirp.min()) == (pytest.approx(2.5, abs=1e-3), pytest.approx(-1.5, abs=1e-3))
    # 1 Hz at first and 9 Hz at last: 5 on the mean
    assert np.count_nonzero(np.diff(np.sign(chirp - 0.5)) != 0) == pytest.approx(2 * 5 * 4, abs=2)
    several = signal("multisine", from_hz=2.0, to_hz=5.0, n=4, seed=3)
    assert np.abs(several - 0.5).max() == pytest.approx(2.0)
    frequencies, power = periodogram(several[:-1], 1000.0)
    assert frequencies[power > 0.01 * power.max()].tolist() == [2.0, 3.0, 4.0, 5.0]
    steps, binary = signal("steps", hold_s=0.1, seed=1), signal("prbs", hold_s=0.1, seed=1)
    for values in (steps, binary):
        assert (values[:4000].reshape(40, 100) == values[:4000:100, np.newaxis]).all()
        assert len(set(values)) > 1
    assert set(binary) == {-1.5, 2.5}
    assert np.array_equal(steps, signal("steps", hold_s=0.1, seed=1))
    assert not np.array_equal(steps, signal("steps", hold_s=0.1, seed=2))


INPUTS = {
    "chirp": '{ kind = "chirp", amplitude = 8.0, from_hz = 0.5, to_hz = 3.0 }',
    "multisine": '{ kind = "multisine", amplitude = 8.0, from_hz = 0.5, to_hz = 3.0 }',
    "steps": '{ kind = "steps", amplitude = 8.0, hold_s = 0.2 }',
    "prbs": '{ kind = "prbs", amplitude = 8.0, hold_s = 0.2, seed = 4 }',
    "csv": '{ csv = "drive.csv", column = "force" }',
}


def test_random_cases_serve_a_plant_with_an_input(tmp_path):
    drive = pd.DataFrame({"time_s": 0.01 * np.arange(250), "force": 8.0 * np.sin(0.1 * np.arange(250))})
    drive.to_csv(tmp_path / "drive.csv", index=False)
    (tmp_path / "driven.toml").write_text(STUDY.format(input=INPUTS["csv"]), encoding="utf-8")
    run_study(tmp_path / "driven.toml", jobs=1, out=tmp_path / "out")
    runs = load_study(tmp_path / "out").runs
    assert len(runs) == 3
    assert (runs["error_mass"] < 1e-5).all()
    assert (runs["error_viscous.slope"] < 1e-5).all()


def test_noise_is_told_in_the_unit_of_the_records(tmp_path):
    study = tmp_path / "driven.toml"
    text = STUDY.format(input=INPUTS["prbs"]).replace("interval_s", "noise_mm_s = [0.0, 2.0]\ninterval_s")
    study.write_text(text, encoding="utf-8")
    results = run_study(study, jobs=1, out=tmp_path / "out")
    evidence = Evidence(results)
    assert evidence.settings == ["noise-free", "2 mm/s"]
    runs = wide_runs(evidence).set_index("setting")
    assert sorted(set(runs["noise_mm_s"])) == [0.0, 2.0]
    assert runs.loc["2 mm/s", "train_rmse"].to_numpy() == pytest.approx(np.full(3, 2e-3), rel=0.1)
    assert (runs.loc["noise-free", "train_rmse"] < 1e-6).all()
    study.write_text(text.replace("noise_mm_s", "noise_deg_s"), encoding="utf-8")
    with pytest.raises(ArmidError, match="noise_deg_s is given, but the records are in m/s, noise_mm_s is expected"):
        read_study(study)


@pytest.mark.parametrize("kind", [*SIGNALS, "csv"])
def test_every_input_is_read(tmp_path, kind):
    pd.DataFrame({"time_s": [0.0, 1.0, 3.0], "force": [0.0, 1.0, 0.0]}).to_csv(tmp_path / "drive.csv", index=False)
    (tmp_path / "driven.toml").write_text(STUDY.format(input=INPUTS[kind]), encoding="utf-8")
    stored = read_study(tmp_path / "driven.toml").cases[0].strokes[0]["inputs"]["u"]
    times = 0.005 * np.arange(401)
    assert np.abs(input_values(stored, times)).max() > 0.5
    if kind == "csv":
        assert input_values(stored, times)[[100, 300]] == pytest.approx([0.5, 0.75])


@pytest.mark.parametrize(("given", "sentence"), [
    ('{ kind = "chrip", amplitude = 1.0 }', "kind 'chrip' is unknown: did you mean 'chirp'?"),
    ('{ kind = "prbs", amplitude = 1.0 }', "key 'hold_s' is missing, a number above 0 is expected"),
    ('{ amplitude = 1.0 }', "`kind` or `csv` is expected, one of them"),
    ('{ csv = "drive.csv", column = "farce" }', "column 'farce' is unknown, did you mean 'force'?"),
    ('{ csv = "short.csv", column = "force" }', "short.csv lasts 1 s, at least the 2 s of the manoeuvre are expected"),
    ('{ csv = "../drive.csv", column = "force" }', "leads out of the folder of the study"),
])  # fmt: skip
def test_what_is_no_input_is_refused_in_one_sentence(tmp_path, given, sentence):
    for name, end in (("drive.csv", 3.0), ("short.csv", 1.0)):
        pd.DataFrame({"time_s": [0.0, end], "force": [0.0, 1.0]}).to_csv(tmp_path / name, index=False)
    (tmp_path / "driven.toml").write_text(STUDY.format(input=given), encoding="utf-8")
    with refusing(sentence):
        read_study(tmp_path / "driven.toml")


def test_an_input_that_is_missing_or_unknown_is_named(tmp_path):
    for inputs, sentence in (("", "is driven by u, and `inputs` does not tell it: u = { kind"),
                             (f", inputs = {{ w = {INPUTS['prbs']} }}", "input 'w' is unknown, ")):  # fmt: skip
        text = STUDY.format(input="{}").replace(", inputs = { u = {} }", inputs)
        (tmp_path / "driven.toml").write_text(text, encoding="utf-8")
        with refusing(sentence):
            read_study(tmp_path / "driven.toml")
