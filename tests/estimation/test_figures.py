"""Figures: they are written, of the expected size, and not blank."""

import struct
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

from armid.estimation.identify_figures import chosen, convergence_figure, fit_figure
from armid.record import read_campaign

DPI = 130


def size_of(path):
    """Return width and height in pixels that a PNG file's header tells."""
    head = path.read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", head[16:24])


def ink(path):
    """Return the share of pixels that are not white."""
    return float(np.mean(matplotlib.image.imread(path)[:, :, :3].min(axis=2) < 0.9))


@pytest.mark.parametrize(("n_train", "with_holdout", "inches"), [
    (1, False, (6.8, 5.0)), (1, True, (13.6, 5.0)), (2, True, (13.6, 9.4)),
])  # fmt: skip
def test_one_pair_of_axes_for_each_record(found, lowering, tmp_path, n_train, with_holdout, inches):
    train, holdout = lowering.records
    records = [replace(train, file=f"{i}.csv") for i in range(n_train)] + [holdout] * with_holdout
    fit_figure(found(replace(lowering, records=tuple(records)), budget=80), tmp_path / "fit.png")
    assert size_of(tmp_path / "fit.png") == tuple(round(DPI * side) for side in inches)
    assert ink(tmp_path / "fit.png") > 0.01


def test_of_many_records_eight_are_drawn(found, many_records, tmp_path):
    result = found(many_records, budget=80)
    drawn = chosen(result)
    assert [r.record.role for r in drawn] == ["train"] * 4 + ["holdout"] * 4
    fit_figure(result, tmp_path / "fit.png")
    assert size_of(tmp_path / "fit.png") == (round(DPI * 13.6), round(DPI * 18.2))


@pytest.mark.parametrize(("n_train", "n_holdout", "drawn"), [(9, 0, (8, 0)), (8, 1, (7, 1)), (2, 9, (2, 6))])
def test_both_roles_are_drawn_where_there_are_both(lowering_found, n_train, n_holdout, drawn):
    several = replace(
        lowering_found, train_replays=lowering_found.train_replays * n_train,
        holdout_replays=lowering_found.holdout_replays * n_holdout,
    )  # fmt: skip
    roles = [r.record.role for r in chosen(several)]
    assert (roles.count("train"), roles.count("holdout")) == drawn


@pytest.mark.parametrize("fitness", ["similarity", "rmse", "likelihood"])
def test_convergence(found, lowering, tmp_path, fitness):
    convergence_figure(found(lowering, fitness=fitness), tmp_path / "convergence.png")
    assert size_of(tmp_path / "convergence.png") == (round(DPI * 6.8), round(DPI * 4.2))
    assert ink(tmp_path / "convergence.png") > 0.005


def test_an_axis(found, write_axis, tmp_path):
    result = found(read_campaign(write_axis(tmp_path / "axis")), fitness="rmse")
    fit_figure(result, tmp_path / "fit.png")
    convergence_figure(result, tmp_path / "convergence.png")
    assert size_of(tmp_path / "fit.png") == (round(DPI * 6.8), round(DPI * 5.0))


def test_no_screen_is_needed_and_no_figure_stays_open(lowering_found, tmp_path):
    import matplotlib.pyplot as plt

    before = plt.get_fignums()
    fit_figure(lowering_found, tmp_path / "fit.png")
    convergence_figure(lowering_found, tmp_path / "convergence.png")
    assert plt.get_fignums() == before
    assert plt.get_backend().lower() == "agg"
