"""The result as numbers for other programs, as words for people, as figures that are not blank."""

import re
import shutil
from dataclasses import replace

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import pytest

from armid.estimation.identify import identify, record_errors
from armid.estimation.identify_document import (
    answer,
    chosen,
    convergence_figure,
    details_of,
    figures_of,
    fit_figure,
    identify_document,
    pairs_of,
    result_of,
)
from armid.identifiers import IDENTIFIERS
from armid.problem.fitness import FITNESS
from armid.problem.space import space_of
from armid.record import read_campaign
from armid.report.style import DPI, save
from armid.report.terminal import show
from changed_records import noisy


def test_numbers_are_si_and_remarks_name_bounds_pairs_divergence_and_noise(lowering_found):
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
    told = by_record["lower_low_voltage.csv"]
    for told_of_it in (told, told["outputs"]["angular_velocity"]):
        assert told_of_it["unit"] == holdout.unit
        numbers = {k: v for k, v in vars(holdout).items() if k != "unit"}
        # joined over one record: its weight is multiplied in and divided out again
        assert {k: told_of_it[k] for k in numbers} == pytest.approx(numbers, rel=1e-12)
    at_its_bound = replace(lowering_found, candidate=lowering_found.space.low, n_failed=7)
    said = "\n".join(details_of(at_its_bound)["remarks"])
    for name in ("p0", "k", "eta3", "n"):
        assert f"{name} sits on its bound" in said
    assert "7 of 160 candidates diverged and were given a penalty." in said
    assert re.search(
        r"Hardly to be told apart on these records \(correlation\): \w+ and \w+ [+-]0.9.*n and p0 -0.9", said
    )
    assert "lower.csv: noise 0.215 deg/s rms and mean -0.019 deg/s (shown, not subtracted) from 100 samples" in said


def test_what_is_not_known_is_null(lowering_found, capsys):
    def shown(found):
        show(identify_document(result_of(found), details_of(found), {}, ""))
        return capsys.readouterr().out

    lost = lowering_found.information.deviation.copy()
    lost[1] = np.inf
    unknown = np.where([[False], [True], [False], [False]], np.nan, lowering_found.information.correlation)
    information = replace(lowering_found.information, deviation=lost, correlation=unknown)
    worse = replace(lowering_found, information=information, holdout=None, value=np.inf, scatter=None)
    result = result_of(worse)
    assert (result["parameters"]["k"]["low"], result["parameters"]["k"]["high"]) == (None, None)
    assert set(result["correlation"]["k"].values()) == {None}
    assert result["error"]["holdout"] is None
    assert result["fitness_value"] is None
    text = shown(worse)
    assert "Not determined by these records: k." in text
    assert "│ not determined" in text
    assert "holdout: none" in text
    assert "k is not determined by these records." in details_of(worse)["remarks"]
    outputs = {name: replace(e, rmse=np.nan) for name, e in worse.train.outputs.items()}
    lost = replace(worse, train=replace(worse.train, rmse=np.nan, outputs=outputs))
    assert "Error (RMSE): not finite deg/s on the records fitted" in shown(lost)


def test_noise_a_lacking_model_an_unfinished_search_and_a_failed_holdout_are_told(lowering_found):
    information = lowering_found.information
    level = replace(information.levels[0], rms=3e-2, from_residual=True)
    quiet = noisy(lowering_found.train_replays[0], source="differences", mean=None, rms=1e-4)
    lacking = {"train_replays": (quiet,), "information": replace(information, levels=(level,))}
    away, near = (
        {"information": replace(information, step=np.array([0.1, k, 0.2, np.nan]), gain=0.0), "scatter": None}
        for k in (-40.0, 1.0)
    )
    short = {"information": replace(information, gain=0.93), "scatter": None}
    train = replace(lowering_found.train, chi2_per_sample=1.1)
    worse, alike = ({"train": train, "holdout": replace(train, chi2_per_sample=chi2)} for chi2 in (6.6, 1.2))
    for changes, words, is_told in (
        (lacking, "from high-frequency differences of the motion: no rest with still inputs has 50 samples", True),
        (lacking, "this many times the noise: 300 in lower.csv: the model lacks something", True),
        (away, "has not come to the least-squares minimum", True), (away, "move k by 40", True),
        (near, "least-squares minimum", False), (short, "take away 93 % of the squares", True),
        (worse, "does not carry over", True), (alike, "does not carry over", False),
    ):  # fmt: skip
        assert (words in "\n".join(details_of(replace(lowering_found, **changes))["remarks"])) == is_told, words


@pytest.mark.parametrize(("key", "noticed"), [("28.0", False), ("30.0", True)])
def test_a_residual_of_little_more_than_noise_is_told(stand, tmp_path, key, noticed):
    """A supply declared as 30 V in place of 28 moves parameters at a chi2 of less than 2."""
    folder = tmp_path / "one"
    shutil.copytree(stand("--manoeuvres", "lower", "--holdout", "", "--repeats", "1", "--window-s", "0", "0.7"), folder)
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text().replace("supply_V = 28.0", f"supply_V = {key}"))
    read = read_campaign(folder)
    model = read.model()
    found = identify(read, model, space_of(model), FITNESS["rmse"], IDENTIFIERS["least_squares"])
    assert found.train.chi2_per_sample < 2.5
    assert found.information.levels[0].from_residual is noticed
    details = details_of(found) | {"within_tolerances": ["R (0.03)"]}
    said = "\n".join(answer(result_of(found), details))
    assert " (constants count as exact): " in said
    many = "\n".join(answer(result_of(found), details | {"within_tolerances": [f"I{i} (0.02)" for i in range(28)]}))
    assert "known roughly: I0 (0.02), I1 (0.02), I2 (0.02), I3 (0.02), I4 (0.02), I5 (0.02) and 22 more." in many
    assert "no record was held out, so that nothing judges the model" in said
    assert ("do not rely on the 95 % intervals" in said) is noticed


def saved(figure, path):
    """Write a figure; return its size [inch] and the share of its pixels that are not white."""
    save(figure, path)
    image = matplotlib.image.imread(path)[:, :, :3]
    return (image.shape[1] / DPI, image.shape[0] / DPI), float(np.mean(image.min(axis=2) < 0.9))


def test_of_many_records_eight_are_drawn_of_both_roles_where_there_are_both(found, lowering, lowering_found, tmp_path):
    for one in (lowering_found, found(lowering, fitness="rmse")):
        size, ink = saved(convergence_figure(one), tmp_path / "convergence.png")
        assert (size, ink > 0.005) == (pytest.approx((6.8, 4.2), abs=0.01), True)
    size, ink = saved(fit_figure(lowering_found), tmp_path / "fit.png")
    assert (size, ink > 0.01) == (pytest.approx((13.6, 5.5), abs=0.01), True)
    for n_train, n_holdout, drawn in ((9, 0, (8, 0)), (8, 1, (7, 1)), (2, 9, (2, 6)), (10, 4, (4, 4))):
        several = replace(
            lowering_found, train_replays=lowering_found.train_replays * n_train,
            holdout_replays=lowering_found.holdout_replays * n_holdout,
        )  # fmt: skip
        roles = [r.record.role for r in chosen(several)]
        assert (roles.count("train"), roles.count("holdout")) == drawn
        assert roles == sorted(roles, reverse=True)
    size, _ = saved(fit_figure(several), tmp_path / "fit.png")
    assert size == pytest.approx((13.6, 18.7), abs=0.01)


def test_ellipses_of_the_most_correlated_pairs_with_the_truth_or_of_the_draws_of_a_bootstrap(lowering_found):
    campaign = replace(lowering_found.campaign, truth={"p0": 3.05e6, "k": 1.0, "eta3": 0.55, "n": 1.4})
    figure = figures_of(replace(lowering_found, campaign=campaign))["pairs"]()
    information = lowering_found.information
    correlation = np.abs(information.correlation[np.triu_indices(4, 1)])
    shown = [abs(float(axis.get_title().split()[1])) for axis in figure.axes]
    assert shown == pytest.approx(sorted(correlation, reverse=True), abs=1e-3)
    assert max(len(a.xaxis.get_major_locator().tick_values(*a.get_xlim())) for a in figure.axes) <= 4
    axis = next(a for a in figure.axes if (a.get_xlabel(), a.get_ylabel()) == ("p0 [MPa]", "n"))
    x, y = axis.patches[0].get_xy().T
    ends = [axis.lines[0].get_xdata()[0] + s * 2.4477e-6 * information.deviation[0] for s in (-1.0, 1.0)]
    assert (x.min(), x.max()) == pytest.approx(tuple(ends), rel=1e-6)
    assert np.ptp(y) == pytest.approx(2.0 * 2.4477 * information.deviation[3], rel=1e-3)
    assert np.ravel(axis.lines[-1].get_xydata()) == pytest.approx([3.05, 1.4])
    plt.close(figure)
    space, x = lowering_found.space, np.zeros(4)
    draws = np.random.default_rng(1).normal(0.0, [2.0, 1.0, 0.0, 0.0], (500, 4)) @ np.array(
        [[1.0, 0.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0] * 4, [0.0] * 4]
    )
    nothing = replace(lowering_found.information, deviation=np.full(4, np.inf), correlation=np.full((4, 4), np.nan))
    assert pairs_of("c", space, nothing, x, {}) == {}
    figure = pairs_of("c", space, nothing, x, {}, draws)["pairs"]()
    (axis,) = figure.axes
    widths = np.ptp(axis.patches[0].get_xy(), axis=0) / (1e-6, 1.0)
    assert widths == pytest.approx(2.0 * 2.4477 * draws[:, :2].std(axis=0, ddof=1), rel=1e-3)
    plt.close(figure)
