"""Figures: they are drawn, of the expected size, and not blank."""

from dataclasses import replace

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import pytest

from armid.estimation.identify_document import chosen, convergence_figure, figures_of, fit_figure
from armid.record import read_campaign
from armid.report.style import DPI, save


def saved(figure, path):
    """Write a figure; return its size [inch] and the share of its pixels that are not white."""
    save(figure, path)
    image = matplotlib.image.imread(path)[:, :, :3]
    return (image.shape[1] / DPI, image.shape[0] / DPI), float(np.mean(image.min(axis=2) < 0.9))


@pytest.mark.parametrize(("n_train", "with_holdout", "inches"), [
    (1, False, (6.8, 5.0)), (1, True, (13.6, 5.0)), (2, True, (13.6, 9.4)),
])  # fmt: skip
def test_one_pair_of_axes_for_each_record(lowering_found, tmp_path, n_train, with_holdout, inches):
    replays = {"train_replays": lowering_found.train_replays * n_train,
               "holdout_replays": lowering_found.holdout_replays * with_holdout}  # fmt: skip
    size, ink = saved(fit_figure(replace(lowering_found, **replays)), tmp_path / "fit.png")
    assert size == pytest.approx(inches, abs=0.01)
    assert ink > 0.01


def test_of_many_records_eight_are_drawn_of_both_roles_where_there_are_both(lowering_found, tmp_path):
    for n_train, n_holdout, drawn in ((9, 0, (8, 0)), (8, 1, (7, 1)), (2, 9, (2, 6)), (10, 4, (4, 4))):
        several = replace(
            lowering_found, train_replays=lowering_found.train_replays * n_train,
            holdout_replays=lowering_found.holdout_replays * n_holdout,
        )  # fmt: skip
        roles = [r.record.role for r in chosen(several)]
        assert (roles.count("train"), roles.count("holdout")) == drawn
        assert roles == sorted(roles, reverse=True)
    size, _ = saved(fit_figure(several), tmp_path / "fit.png")
    assert size == pytest.approx((13.6, 18.2), abs=0.01)


@pytest.mark.parametrize("fitness", ["similarity", "rmse", "likelihood"])
def test_convergence(found, lowering, tmp_path, fitness):
    size, ink = saved(convergence_figure(found(lowering, fitness=fitness)), tmp_path / "convergence.png")
    assert size == pytest.approx((6.8, 4.2), abs=0.01)
    assert ink > 0.005


def test_an_axis(found, write_axis, tmp_path):
    result = found(read_campaign(write_axis(tmp_path / "axis")), fitness="rmse")
    assert list(figures_of(result)) == ["fit", "convergence"]
    size, _ = saved(fit_figure(result), tmp_path / "fit.png")
    assert size == pytest.approx((6.8, 5.0), abs=0.01)


def test_no_screen_is_needed_and_no_figure_stays_open(lowering_found, tmp_path):
    before = plt.get_fignums()
    for name, draw in figures_of(lowering_found).items():
        save(draw(), tmp_path / f"{name}.png", tmp_path / f"{name}.svg")
    assert plt.get_fignums() == before
    assert plt.get_backend().lower() == "agg"
