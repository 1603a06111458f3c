"""The result as numbers for other programs, and as words for people."""

import json
from dataclasses import replace

import numpy as np
import pytest

from armid.estimation.identify import record_errors
from armid.estimation.identify_document import details_of, identify_document, remarks, result_of
from armid.problem.space import space_of
from armid.report.html import html
from armid.report.markdown import markdown
from armid.report.terminal import show

PARAMETER = {"value", "unit", "low", "high", "bound_low", "bound_high", "bound_active"}
ERROR = {"rmse", "nrmse", "chi2_per_sample", "s", "s1", "s2"}
NEEDED = {"parameters", "error", "correlation", "unit", "budget", "used", "seed", "versions"}


@pytest.fixture(scope="module")
def partly_fixed(found, lowering, arm):
    """The lowering with k fixed, coarse but enough to look at."""
    return found(lowering, arm, space_of(arm, fixed={"k": 1.0}))


@pytest.fixture
def shown(capsys):
    """Return a function that gives what a terminal shows of an identification."""

    def text(found):
        show(identify_document(result_of(found), details_of(found), {}, ""))
        return capsys.readouterr().out

    return text


def test_has_the_declared_keys(lowering_found):
    result = result_of(lowering_found)
    assert set(result) >= NEEDED
    assert set(result["error"]) == {"train", "holdout"}
    assert set(result["error"]["train"]) == set(result["error"]["holdout"]) == ERROR
    assert list(result["parameters"]) == ["p0", "k", "eta3", "n"]
    assert all(set(p) == PARAMETER for p in result["parameters"].values())
    assert set(result["versions"]) >= {"python", "armid", "numpy", "numba", "pymoo"}
    assert result["used"] == result["budget"] == 160
    assert json.loads(json.dumps(result, allow_nan=False)) == result


def test_everything_is_si(lowering_found):
    result = result_of(lowering_found)
    assert result["unit"] == "rad/s"
    assert [p["unit"] for p in result["parameters"].values()] == ["Pa", "1", "1", "1"]
    p0 = result["parameters"]["p0"]
    assert (p0["bound_low"], p0["bound_high"]) == (2.6e6, 3.5e6)
    assert p0["value"] == lowering_found.candidate[0]
    residual = lowering_found.train_replays[0].measured
    residual = residual - lowering_found.train_replays[0].signal(lowering_found.candidate[np.newaxis])[0]
    assert result["error"]["train"]["rmse"] == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert result["noise"]["lower.csv"]["rms"] == pytest.approx(np.radians(0.2145), rel=0.01)
    by_record = result["error_by_record"]
    assert {file: e["role"] for file, e in by_record.items()} == {
        "lower.csv": "train",
        "lower_low_voltage.csv": "holdout",
    }
    holdout = record_errors(lowering_found.holdout_replays[0], lowering_found.candidate)
    assert {k: v for k, v in by_record["lower_low_voltage.csv"].items() if k != "role"} == vars(holdout)


def test_intervals_and_correlations_are_those_of_the_information(lowering_found):
    result, information = result_of(lowering_found), lowering_found.information
    for i, (name, p) in enumerate(result["parameters"].items()):
        assert p["high"] - p["low"] == pytest.approx(2 * 1.959963985 * information.deviation[i])
        assert p["low"] < p["value"] < p["high"]
        assert result["correlation"][name][name] == pytest.approx(1.0)
        assert result["correlation"][name]["n"] == pytest.approx(information.correlation[i, 3])


def test_a_fixed_parameter_has_neither_interval_nor_bounds(partly_fixed, shown):
    result = result_of(partly_fixed)
    nothing = dict.fromkeys(("low", "high", "bound_low", "bound_high"))
    assert result["parameters"]["k"] == {"value": 1.0, "unit": "1", "bound_active": False, **nothing}
    assert set(result["correlation"]) == {"p0", "eta3", "n"}
    assert "fixed" in shown(partly_fixed)


def test_what_is_not_known_is_null(lowering_found, shown):
    lost = lowering_found.information.deviation.copy()
    lost[1] = np.inf
    unknown = np.where([[False], [True], [False], [False]], np.nan, lowering_found.information.correlation)
    information = replace(lowering_found.information, deviation=lost, correlation=unknown)
    worse = replace(lowering_found, information=information, holdout=None, value=np.inf)
    result = result_of(worse)
    assert (result["parameters"]["k"]["low"], result["parameters"]["k"]["high"]) == (None, None)
    assert set(result["correlation"]["k"].values()) == {None}
    assert result["error"]["holdout"] is None
    assert result["fitness_value"] is None
    text = shown(worse)
    assert "Not determined by these records: k." in text
    assert "│ not determined" in text
    assert "holdout: none" in text
    assert "k is not determined by these records." in remarks(worse)
    lost = replace(worse, train=replace(worse.train, rmse=np.nan))
    assert "Error (RMSE): not finite deg/s on the records fitted" in shown(lost)


def test_tables_are_in_units_that_people_read(lowering_found, shown):
    text = shown(lowering_found)
    p0 = lowering_found.candidate[0]
    assert f"{p0 / 1e6:.6g}" in text
    assert "MPa" in text
    assert f"{np.degrees(lowering_found.train.rmse):.4g}" in text
    assert "RMSE, deg/s" in text


def test_every_renderer_gives_the_answer_first(lowering_found, shown):
    document = identify_document(result_of(lowering_found), details_of(lowering_found), {}, "armid report x")
    first = document.answer[0]
    assert first.startswith("p0 = ")
    assert " ".join(shown(lowering_found).split()).startswith(" ".join(first.split()))
    assert f"**{first}**" in markdown(document)
    assert html(document).index(first) < html(document).index("<section")
    assert html(document).count("<svg") == len(details_of(lowering_found)["records"])


def test_remarks_name_bounds_pairs_divergence_and_noise(lowering_found):
    at_its_bound = replace(lowering_found, candidate=lowering_found.space.low, n_failed=7)
    said = "\n".join(remarks(at_its_bound))
    for name in ("p0", "k", "eta3", "n"):
        assert f"{name} sits on its bound" in said
    assert "7 of 160 candidates diverged and were given a penalty." in said
    assert "n and p0 can hardly be told apart on these records (correlation -0.9" in said
    assert "lower.csv: noise 0.215 deg/s rms and mean -0.019 deg/s (shown, not subtracted) from 100 samples" in said


def test_noise_from_differences_and_a_lacking_model_are_told(lowering_found):
    replay = lowering_found.train_replays[0]
    noise = replace(replay.record.noise, source="differences", mean=None, rms=1e-4)
    level = replace(lowering_found.information.levels[0], rms=3e-2, from_residual=True)
    told = replace(
        lowering_found, train_replays=(replace(replay, record=replace(replay.record, noise=noise)),),
        information=replace(lowering_found.information, levels=(level,)),
    )  # fmt: skip
    said = "\n".join(remarks(told))
    assert "from high-frequency differences of the motion, as fewer than 50 samples were recorded at rest" in said
    assert "the residual is 300 times the noise: the model lacks something" in said


def test_a_search_that_has_not_come_to_the_minimum_is_told(lowering_found):
    far = replace(lowering_found.information, step=np.array([0.1, -40.0, 0.2, np.nan]))
    near = replace(lowering_found.information, step=np.array([0.1, 1.0, 0.2, np.nan]))
    assert any("has not come to the least-squares minimum" in text and "move k by 40" in text
               for text in remarks(replace(lowering_found, information=far)))  # fmt: skip
    assert not any("least-squares minimum" in text for text in remarks(replace(lowering_found, information=near)))


def test_a_fit_that_does_not_carry_over_is_told(lowering_found):
    train = replace(lowering_found.train, chi2_per_sample=1.1)
    for chi2, told in ((6.6, True), (1.2, False)):
        found = replace(lowering_found, train=train, holdout=replace(train, chi2_per_sample=chi2))
        assert any("does not carry over" in text for text in remarks(found)) == told
