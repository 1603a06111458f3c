"""Expected running times, ECDFs over runs and targets, waterfalls, medians of convergence, lines with names."""

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from armid.report.style import MOST_COLOURED, PALE, named_lines, panels
from armid.study.analyses.analysis import TARGETS
from armid.study.analyses.convergence import (
    convergence_figure,
    ecdf_figure,
    expected_running_time,
    median,
    running_time,
    share_hit,
    waterfall_figure,
)


def named(axis):
    return [text.get_text() for text in axis.get_legend().get_texts()]


def test_share_hit_running_time_and_median_by_hand():
    hits = np.array([[1.0, 10.0], [5.0, np.inf]])
    assert share_hit(hits, np.array([1, 4, 5, 10, 99])).tolist() == [0.25, 0.25, 0.5, 0.75, 0.75]
    hits = np.array([[10.0, np.inf], [np.inf, np.inf], [30.0, np.inf]])
    ert, successes = expected_running_time(hits, np.array([100.0, 50.0, 40.0]))
    assert ert.tolist() == [(10 + 50 + 30) / 2, np.inf]
    assert successes.tolist() == [2, 0]
    runs = np.array([[np.inf, 4.0], [np.inf, 3.0], [8.0, 2.0], [9.0, 1.0]], np.float32)
    assert median(runs).tolist() == [9.0, 2.0]


def test_table_takes_the_tolerances_and_counts_hits():
    evidence = SimpleNamespace(runs=pd.DataFrame({"setting": "s", "variant": ["pso"] * 2}), used=np.full(2, 1000.0))
    hits = np.full((2, 51), np.inf)
    hits[0, TARGETS >= 1e-2 * (1 - 1e-9)] = 200.0
    frame = running_time(evidence, hits, {"1 %": 1e-2, "0.1 %": 1e-3}, "t", "", "").frame
    assert frame.loc[0, "1 %"] == "1200 (50 %)"
    assert frame.loc[0, "0.1 %"] == "inf (0 %)"


def test_lines_are_named_in_the_order_of_their_colours():
    hits = np.full((4, 51), np.inf)
    hits[:, :10], hits[:2, :30] = 5.0, 7.0
    evidence = SimpleNamespace(
        groups={"s": {"near": np.array([2, 3]), "far": np.array([0, 1])}}, colours={"near": 0, "far": 1},
        histories=SimpleNamespace(grid=np.array([1, 10, 100]), error_hits=hits),
    )  # fmt: skip
    figure = ecdf_figure(evidence)
    assert named(figure.axes[0]) == ["near", "far"]
    assert figure.axes[0].get_ylim() == (0.0, 1.0)
    plt.close(figure)


def test_the_first_six_lines_have_a_colour_each_and_all_others_are_grey():
    figure, (axis,) = panels(1, 1, 5.0, 4.6)
    lines = {f"v{i}": [0.0, float(i)] for i in range(9)}
    named_lines(axis, [1.0, 2.0], lines, {name: 8 - i for i, name in enumerate(lines)})
    assert named(axis) == ["v8", "v7", "v6", "v5", "v4", "v3", "others (3)"]
    colours = {line.get_ydata()[1]: line.get_color() for line in axis.lines[:9]}
    assert [colours[i] for i in (0.0, 1.0, 2.0)] == [PALE] * 3
    assert len({colours[float(i)] for i in range(3, 9)}) == MOST_COLOURED
    plt.close(figure)


def test_a_waterfall_rises_to_what_the_worst_run_leaves():
    hits = np.full((4, len(TARGETS)), np.inf)
    hits[0], hits[1, :6], hits[2, :1] = 1.0, 1.0, 1.0
    evidence = SimpleNamespace(groups={"s": {"many": np.arange(4), "one": np.array([0])}},
                               colours={"one": 0, "many": 1}, histories=SimpleNamespace(value_hits=hits))  # fmt: skip
    figure = waterfall_figure(evidence)
    many, one = (line.get_ydata() for line in figure.axes[0].lines[:2])
    assert np.unique(many).tolist() == pytest.approx([1e-10, 1e-1, 1.0])
    assert np.unique(one).tolist() == pytest.approx([1e-10])
    assert (np.diff(many) >= 0.0).all()
    plt.close(figure)


def test_one_panel_a_setting_with_a_line_a_variant_and_runs_of_another_fitness_left_out():
    of = {v: np.array([2 * i, 2 * i + 1]) for i, v in enumerate(("pso", "de", "ga", "other"))}
    evidence = SimpleNamespace(groups={"noise-free": of, "0.3 deg/s": of}, colours={v: i for i, v in enumerate(of)},
                               runs=pd.DataFrame({"budget": [100] * 2 + [10] * 6}),
                               histories=SimpleNamespace(grid=np.array([1, 10, 100])))  # fmt: skip
    values = np.array([[np.inf, 1.0, 1e-12], [2.0, 0.5, 1e-3]] * 4)
    figure = convergence_figure(evidence, np.arange(8) < 6, values, "error", floor=1e-6)
    assert [axis.get_title() for axis in figure.axes] == ["noise-free", "0.3 deg/s"]
    assert named(figure.axes[0]) == ["pso", "de", "ga"]
    _, de, pso = (line.get_ydata() for line in figure.axes[0].lines[:3])
    assert np.nanmin(pso) == 1e-6
    # a line ends where the budget does
    assert [np.isnan(line).tolist() for line in (pso, de)] == [[False] * 3, [False, False, True]]
    plt.close(figure)
