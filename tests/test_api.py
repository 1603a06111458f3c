"""Calls by names or objects alike, results that print themselves, and searches that ignore their budget."""

import inspect
import logging
import os
import re
import sys
from pathlib import Path
from shutil import copytree

import numpy as np
import pandas as pd
import pytest
from pymoo.algorithms.soo.nonconvex.de import DE
from pymoo.core.algorithm import Algorithm
from rich.console import Console

import armid
from armid.api import campaign_of
from armid.cli.new import INERTIA
from armid.contract.check import check_campaign, check_thing
from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS
from armid.record import read_campaign
from armid.registry import load_registry
from armid.report.result import Result, Shown
from armid.report.style import pyplot
from armid.units import angles_in, scale_of
from commands import not_drawn
from synthetic import wheel, write_records

QUICK = {"effects": ["viscous"], "budget": 60}
# Where a word is near none that is known.
OWN = "one of your own is a plug-in: the option plugin takes FILE.py:NAME, in Python plugins a list of them"


@pytest.fixture(scope="module")
def axis(synthetic_axis):
    return synthetic_axis


@pytest.fixture(scope="module")
def found(axis):
    return armid.identify(str(axis), effects=["viscous"], identifier="least_squares", fitness="rmse")


def test_a_strength_beyond_its_declared_range_is_found_unless_the_range_was_given(tmp_path):
    """What a motor's voltage brakes at full speed is all that it drives, twice the range of `viscous`."""
    rng, times, tables = np.random.default_rng(64), 0.005 * np.arange(800), {}
    for file in ("a.csv", "b.csv"):
        drive = np.repeat(rng.uniform(-8.0, 8.0, 8), 100)
        speed = wheel(drive, 0.005, 5.0, 0.6 / 0.01)[0] + 0.02 * rng.standard_normal(800)
        tables[file] = {"time_s": times, "drive_V": drive, "angular_velocity_rad_s": speed}
    head = 'name = "motor"\nplant = "driven_axis"\neffects = ["viscous"]\nhold = "zero"\n[constants]\ngain = 0.05\n'
    folder = write_records(tmp_path / "motor", head, tables)
    found = armid.identify(folder, identifier="least_squares")
    assert found.parameters["viscous.slope"].value == pytest.approx(0.6, rel=0.01)
    assert found.parameters["inertia"].value == pytest.approx(0.01, rel=0.01)
    assert not found.at_bound.any()
    assert all(point.passed for point in check_campaign(read_campaign(folder), EFFECTS) if "plausible" in point.name)
    high = 0.9 * found.parameters["viscous.slope"].value
    with pytest.warns(UserWarning, match=r"viscous\.slope may lie outside the range that was searched"):
        held = armid.identify(folder, identifier="least_squares", bounds={"viscous.slope": (0.0, high)}, interval=False)
    assert held.parameters["viscous.slope"].value == pytest.approx(high)


def test_what_is_no_model_and_no_effect_is_refused(axis):
    with pytest.raises(armid.ModelError, match="model is 'driven_axis': a Model is expected"):
        armid.identify(axis, model="driven_axis")
    with pytest.raises(armid.ModelError, match="'viscous' is added to a model: an Effect is expected"):
        armid.read_campaign(axis).model() + "viscous"
    with pytest.raises(armid.ArmidError, match="within is 5: a share between 0 and 1 is expected"):
        armid.close_loop(axis, within=5)


def annealing(value, low, high, budget, random, start=None, step=0.1):
    best, x = value(start), start
    for _ in range(10 * budget):
        tried = np.clip(x + step * (high - low) * random.standard_normal(len(low)), low, high)
        f = value(tried)
        if f < best:
            best, x = f, tried


class Greedy(Algorithm):
    """Ask for ever, whatever the termination says."""

    def _infill(self):
        while True:
            self.problem.evaluate(self.random_state.random((40, self.problem.n_var)) * self.problem.xu)


def test_names_and_objects_give_the_same(found, axis):
    campaign = armid.read_campaign(axis)
    model = campaign.model() + EFFECTS["viscous"]
    space = armid.space_of(model, campaign.parameters)
    objects = armid.identify(campaign, model, space, armid.FITNESS["rmse"], armid.IDENTIFIERS["least_squares"])
    by_effect = armid.identify(axis / "campaign.toml", effects=EFFECTS["viscous"], identifier="least_squares")
    for other in (objects, by_effect):
        np.testing.assert_array_equal(other.candidate, found.candidate)
    values = {name: p["value"] for name, p in found.to_dict()["parameters"].items()}
    assert values == pytest.approx({"inertia": INERTIA, "viscous.slope": 0.03}, rel=0.02)
    assert (found.budget, armid.identify(axis, **{**QUICK, "budget": None}).budget) == (12_000, 3_000)
    assert armid.identify(axis, **QUICK).identifier == "pso+least_squares"
    assert armid.identify(axis, fitness="similarity", **QUICK).identifier == "cmaes"
    paper = armid.identify(axis, paper=True, effects="viscous", budget=80)
    assert (paper.identifier, paper.fitness.name) == ("pso", "similarity")
    assert paper.campaign.train[0].pieces[0].duration == pytest.approx(0.7)


@pytest.mark.parametrize("identifier", [DE(pop_size=10), DE, lambda budget: DE(pop_size=10), annealing])
def test_an_algorithm_of_pymoo_or_any_function_searches(axis, identifier):
    one, again = (armid.identify(axis, identifier=identifier, **QUICK) for _ in range(2))
    assert (one.used, one.stopped) == (60, "budget used")
    np.testing.assert_array_equal(one.candidate, again.candidate)


def test_a_search_of_the_user_has_options_and_follows_in_a_chain(axis, tmp_path):
    (tmp_path / "mine.py").write_text(f"import numpy as np\n\n\n{inspect.getsource(annealing)}", encoding="utf-8")
    plugins = [f"{tmp_path}/mine.py:annealing"]
    fine = armid.identify(axis, identifier="pso+annealing", plugins=plugins, options={"annealing.step": 0.01}, **QUICK)
    assert fine.used == 60
    with pytest.raises(ArmidError, match=r"no option 'stap'.*did you mean 'step'"):
        armid.identify(axis, identifier=annealing, options={"stap": 0.01}, **QUICK)
    with pytest.raises(ArmidError, match=r"has an argument 'lows' without a default.*did you mean 'low'"):
        armid.as_identifier("mine", lambda value, lows: None)


def test_an_identifier_that_ignores_its_budget_is_stopped(axis):
    ended = armid.identify(axis, identifier=lambda budget: Greedy(), **QUICK)
    assert ended.stopped == "<lambda> went on after its budget and was stopped"
    assert ended.used == 60
    assert {p.name for p in check_thing("identifiers", "mine", Greedy) if not p.passed} == {"exact budget"}


def test_tables_are_a_campaign_and_read_as_their_files_would_be(found, axis):
    tables = {}
    for file, role in (("synthetic_train", "train"), ("synthetic_holdout", "holdout")):
        tables[file] = pd.read_csv(Path(axis) / f"{file}.csv")
        tables[file].attrs = {"role": role, "hold": "zero", "constants": {"gain": 1.0}}
    for plant in ("driven_axis", PLANTS["driven_axis"]):
        other = armid.identify(tables, plant=plant, effects=["viscous"], identifier="least_squares")
        np.testing.assert_allclose(other.candidate, found.candidate, rtol=1e-9)
    assert armid.simulate(tables["synthetic_train"], plant="driven_axis", inertia=0.05).campaign.train[0].file
    table = pd.read_csv(Path(axis) / "synthetic_train.csv").astype({"time_s": "float32", "drive_N_m": "float32"})
    table["note"], table["load_kg"] = "none yet", pd.array([pd.NA, *range(1, len(table))], dtype="Int64")
    table.attrs = {"window_s": (np.float64(0.0), 1), "constants": {"gain": np.int64(1)}}
    (record,) = campaign_of({"move": table}, "driven_axis", load_registry([])).records
    (speed,), (own, *_) = record.signals, armid.read_campaign(axis).records
    np.testing.assert_array_equal(speed.measured, own.measured)
    np.testing.assert_array_equal(record.manoeuvre.inputs["u"], own.manoeuvre.inputs["u"])
    assert (record.file, record.constants["gain"], record.pieces[0].window.start) == ("move.csv", 1.0, 0)


@pytest.mark.parametrize(("change", "said"), [
    (lambda t: t.assign(time_s="late"), "move.csv, line 2: time_s is 'late', a finite number is expected"),
    (lambda t: t.assign(drive_N_m=t["drive_N_m"].where(t.index != 3)), "line 5: drive_N_m has no number there"),
    (lambda t: t.assign(drive_N_m=t["drive_N_m"].where(t.index != 3, np.inf)), "line 5: drive_N_m is inf, a finite"),
    (lambda t: t.assign(drive_N_m=t["drive_N_m"] > 0.0), "line 2: drive_N_m is 'False', a finite number is expected"),
    (lambda t: t.set_axis(range(t.shape[1]), axis=1), "numbers are there, and no header"),
    (lambda t: marked(t, role="both"), "tables, record 'move.csv': key 'role' is 'both', .* expected"),
    (lambda t: marked(t, window_s=t), "tables, record 'move.csv': key 'window_s' is"),
    (lambda t: marked(t, rolle="train"), "key 'rolle' is unknown, did you mean 'role'"),
])  # fmt: skip
def test_what_is_wrong_in_a_table_is_said_as_of_its_file(axis, change, said):
    table = pd.read_csv(Path(axis) / "synthetic_train.csv")
    with pytest.raises(armid.DataError, match=said) as caught:
        armid.identify({"move": change(table)}, plant="driven_axis")
    assert "\n" not in str(caught.value)


def marked(table, **attrs):
    table.attrs = attrs
    return table


def test_simulating_and_examining(axis, tmp_path):
    simulated = armid.simulate(axis, inertia=0.05, effects=["viscous"], parameters={"viscous.slope": 0.03})
    assert set(simulated.table["record"]) == {"synthetic_train.csv", "synthetic_holdout.csv"}
    assert simulated.parameters == {"inertia": 0.05, "viscous.slope": 0.03}
    assert simulated.save(tmp_path / "simulated") == ["synthetic_train.csv", "synthetic_holdout.csv"]
    examined = armid.examine(axis, effects=["viscous"], x={"inertia": 0.05, "viscous.slope": 0.03})
    for result in (simulated, examined):
        shows(result, tmp_path / type(result).__name__)


@pytest.mark.slow
def test_closing_the_loop(axis, tmp_path, monkeypatch):
    monkeypatch.setattr("armid.report.files.save", not_drawn)
    closed = armid.close_loop(axis, candidates=["viscous", EFFECTS["coulomb"]])
    assert (closed.effects, closed.to_dict()["verdict"]) == (("viscous",), "explained")
    shows(closed, tmp_path / "closed")


def shows(result, folder):
    assert isinstance(result, Shown)
    assert 20 < len(repr(result)) < 2_000
    assert "<table" in result._repr_html_()
    assert "<button" not in result._repr_html_()
    assert isinstance(result.table, pd.DataFrame)
    assert len(result.table)
    assert isinstance(result.to_dict(), dict)
    before = pyplot().get_fignums()
    assert result.plot().axes
    assert pyplot().get_fignums() == before
    if isinstance(result, Result):
        folder.mkdir()
        left = [folder / f"{name}.svg" for name in result.kind.figures]
        for path in left:
            # of an earlier result, whose figures this one may not have
            path.write_text("old")
        names = result.save(folder)
        assert set(names) == {path.name for path in folder.iterdir()}
        assert "old" not in [path.read_text() for path in left if path.exists()]
        assert {result.kind.file, result.kind.page, result.kind.markdown} <= set(names)
        with pytest.raises(ArmidError, match="there is no figure 'nothing'"):
            result.plot("nothing")


def test_an_identification_and_its_parts_are_small_and_its_table_holds_numbers(found, tmp_path):
    shows(found, tmp_path / "found")
    assert list(found.table["parameter"]) == ["inertia", "viscous.slope"]
    for part in (found.campaign, found.campaign.train[0], found.model, found.model.plant):
        assert 20 < len(repr(part)) < 2_000
    assert list(found.campaign.table["record"]) == [record.file for record in found.campaign.records]
    assert "<table" in found.campaign._repr_html_()
    for name in ("identify", "simulate", "close_loop", "examine"):
        assert "<" not in str(inspect.signature(getattr(armid, name)))
    stored = found.to_dict()["parameters"]["inertia"]
    inertia = found.parameters["inertia"]
    assert stored["low"] == inertia.low < inertia.value == stored["value"] < inertia.high == stored["high"]
    assert (inertia.unit, inertia.doubt) == ("kg m2", "")
    table = found.table.set_index("parameter")[["value", "low", "high"]]
    assert {str(dtype) for dtype in table.dtypes} == {"float64"}
    assert table.loc["inertia"].tolist() == [inertia.value, inertia.low, inertia.high]


def recorded(axis, header, factor):
    """Return the axis' train record with its speed under another header."""
    table = pd.read_csv(Path(axis) / "synthetic_train.csv")
    speed = next(name for name in table if name.startswith("angular_velocity"))
    made = table.rename(columns={speed: header})
    made[header] *= factor * (np.pi / 180.0 if speed.endswith("deg_s") else 1.0)
    made.attrs = {"hold": "zero", "constants": {"gain": 1.0}}
    return made


@pytest.mark.parametrize(("header", "factor", "unit"), [
    ("angular_velocity_rad_s", 1.0, "rad/s"), ("angular_velocity_deg_s", 180.0 / np.pi, "deg/s"),
    ("angular_velocity_rpm", 30.0 / np.pi, "rpm"),
])  # fmt: skip
def test_records_come_back_in_the_unit_in_which_they_were_recorded(axis, header, factor, unit, tmp_path):
    given = {"plant": "driven_axis", "effects": ["viscous"], "identifier": "least_squares"}
    found = armid.identify(recorded(axis, header, factor), **given)
    rmse = found.train.rmse * factor
    assert f"Error (RMSE): {rmse:.4g} {unit} on the records fitted" in repr(found)
    assert f"signal [{unit}]" in found.plot().axes[0].get_ylabel().replace("speed", "signal")
    found.save(tmp_path)
    assert f"{rmse:.4g} {unit}" in (tmp_path / "report.md").read_text()
    asked = armid.identify(recorded(axis, header, factor), units="rad", **given)
    assert f"{found.train.rmse:.4g} rad/s on the records fitted" in repr(asked)
    with pytest.raises(ArmidError, match="units is 'gon': "):
        armid.identify(recorded(axis, header, factor), units="gon", **given)


def test_a_folder_whose_name_is_no_utf_8(found, tmp_path, run):
    folder = tmp_path / os.fsdecode(b"m\xe9s")
    assert "report.html" in found.save(folder, {"command": f"armid identify --out {folder}", "settings": {}})
    saved = [(folder / page).read_text(encoding="utf-8") for page in ("report.html", "report.md")]
    assert r"m\udce9s" in saved[0]
    assert run("report", str(folder)).code == 0
    assert [(folder / page).read_text(encoding="utf-8") for page in ("report.html", "report.md")] == saved


@pytest.mark.parametrize(("call", "said"), [
    (lambda a: armid.identify("nowhere"), "DataError.*'nowhere' does not exist"),
    (lambda a: armid.identify({"x": pd.DataFrame({"time_s": [0.0]})}, plant="driven_axis"), "DataError"),
    (lambda a: armid.identify(a, effects=["viscos"]), "ModelError.*'viscos'"),
    (lambda a: armid.Model(PLANTS["driven_axis"]) - "coulomb", "ModelError.*'coulomb'"),
    (lambda a: armid.Effect("mine", (), {}), "ModelError.*'mine'"),
    (lambda a: armid.load_study("nowhere"), "StudyError"),
    (lambda a: armid.identify(a, fitness=3), "3"),
    (lambda a: armid.identify(a, identifier=3), "is 3, expected"),
    (lambda a: armid.close_loop(a, without=["viscos"]), ": without: effect 'viscos' is not known"),
    (lambda a: armid.close_loop(armid.Model(PLANTS["driven_axis"])), "a Model and its campaign"),
    (lambda a: armid.simulate(armid.Model(PLANTS["driven_axis"])), "a manoeuvre and a population are expected"),
    (lambda a: armid.set_log_level("loud"), "debug, info, warning, error"),
    (lambda a: armid.identify(a, effects=3), "effects is 3: names or Effects are expected"),
    (lambda a: armid.identify(a, plugins=3), "plugins is 3: a list of FILE.py:attribute is expected"),
    (lambda a: armid.identify(a, options=4), "options is 4: name -> value is expected"),
    (lambda a: armid.identify(a, window=0.5), r"window is 0.5: \(begin, end\), s, is expected"),
    (lambda a: armid.identify(a, bounds={"inertia": 3}), r"name -> \(low, high\) is expected"),
    (lambda a: armid.identify(a, fix={"inertia": "x"}), "name -> value is expected"),
    (lambda a: armid.identify(a, seed="x"), "the seed is 'x'"),
    (lambda a: armid.identify(a, target="x"), "the target is 'x'"),
    (lambda a: armid.identify(3), "the campaign is a int"),
    (lambda a: armid.identify(a, effects="own"), OWN),
    (lambda a: armid.identify(a, identifier="own"), OWN),
    (lambda a: armid.identify(a, fitness="own"), OWN),
    (lambda a: armid.identify(pd.DataFrame({"time_s": [0.0]})), "needs its plant"),
    (lambda a: armid.identify(pd.DataFrame({"time_s": [0.0]}), plant="axis"), "axis"),
    (lambda a: armid.identify({f"{a}/move": pd.DataFrame({"time_s": [0.0]})}, plant="driven_axis"),
     "called like a path: a name without a folder is expected"),
    (lambda a: armid.simulate(a, inertai=0.05), "did you mean 'inertia'"),
    (lambda a: armid.simulate(a, inertia="much"), "a finite number is expected"),
])  # fmt: skip
def test_what_is_wrong_is_one_sentence_of_an_exception_that_says_its_cause(axis, call, said):
    with pytest.raises(ArmidError) as caught:
        call(axis)
    assert re.search(said, f"{type(caught.value).__name__}: {caught.value}")
    assert "\n" not in str(caught.value)
    assert "--" not in str(caught.value)


@pytest.mark.parametrize("name", ["identify", "simulate", "examine", "close_loop", "run_study", "read_campaign"])
def test_arguments_are_spelt_out_with_their_types(name, axis):
    function = getattr(armid, name)
    arguments = inspect.signature(function).parameters
    assert all(p.annotation is not p.empty for p in arguments.values())
    assert [p.name for p in arguments.values() if p.kind is p.VAR_KEYWORD] == (["values"] if name == "simulate" else [])
    assert len(str(inspect.signature(function))) < 1_200
    if name != "simulate":
        with pytest.raises(TypeError, match="unexpected keyword argument 'efects'"):
            function(axis, efects=["viscous"])


def test_catalogues_and_things_show_themselves_in_a_few_lines_and_sizes_get_a_prefix():
    things = (armid.EFFECTS, armid.IDENTIFIERS, armid.PLANTS, armid.FITNESS, armid.suite(), EFFECTS["coulomb"],
              armid.IDENTIFIERS["pso"], PLANTS["shell_transfer_arm"], armid.Model(PLANTS["rotary_arm"]))  # fmt: skip
    for thing in things:
        assert 20 < len(repr(thing)) < 1_000
        assert " at 0x" not in repr(thing)
    assert all(name in repr(armid.EFFECTS) for name in EFFECTS)
    cases = {("N m", 2e-5): "uN m", ("N m", 0.5): "N m", ("N m", 2e4): "kN m", ("s", 2e-3): "ms", ("V", 0.0): "V",
             ("kg m2", 1e-5): "kg m2", ("1", 1e-5): "1", ("Pa", 1.0): "MPa", ("s3/rad2", 1e-4): "s3/rad2"}  # fmt: skip
    for (unit, size), name in cases.items():
        assert scale_of(unit, size)[0] == name
    assert scale_of("N m", 2e-5)[1] * 2e-5 == pytest.approx(20.0)
    with angles_in("rad"):
        assert scale_of("rad/s") == ("rad/s", 1.0)
    assert scale_of("rad/s")[0] == "deg/s"


def test_a_bar_is_drawn_when_it_is_asked_for(axis, monkeypatch, capsys):
    monkeypatch.setattr("armid.progress.console", lambda: Console(file=sys.stderr, force_terminal=True, width=100))
    armid.identify(axis, progress=True, **QUICK)
    assert "/60 simulations" in capsys.readouterr().err
    armid.identify(axis, **QUICK)
    assert capsys.readouterr().err == ""
    used = []
    armid.identify(axis, progress=lambda meter: used.append(meter.used), **QUICK)
    assert used
    assert max(used) <= 60


def test_the_log_is_printed_from_a_level_on(capsys):
    try:
        armid.set_log_level("info")
        armid.set_log_level("info")
        logging.getLogger("armid").info("compiling")
        armid.set_log_level("warning")
        logging.getLogger("armid").info("once more")
    finally:
        for handler in [h for h in logging.getLogger("armid").handlers if h.name == "armid"]:
            logging.getLogger("armid").removeHandler(handler)
    assert capsys.readouterr().err == "armid: compiling\n"


@pytest.mark.nightly
def test_a_study_shows_itself(table_study, tmp_path, monkeypatch):
    monkeypatch.setattr("armid.report.files.save", not_drawn)
    out = copytree(table_study / "out", tmp_path / "out")
    results = armid.run_study(table_study / "tiny.toml", jobs=1, out=out)
    shows(results, tmp_path)
    assert results.to_dict()["n_done"] == 4
    assert {"report.html", "report.md", "overview.csv"} <= set(results.save(tmp_path / "report"))
