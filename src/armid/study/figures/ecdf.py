"""ECDF over targets: which share of all (run, target) pairs is hit within so many simulations."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from armid.study.figures.lines import named_lines, panel_height
from armid.study.figures.style import panels
from armid.study.metrics import share_hit

Groups = Mapping[str, Mapping[str, np.ndarray]]


def ecdf_figure(groups: Groups, grid: np.ndarray, order: Mapping[str, int]) -> Any:
    """Draw one panel a setting and one line a variant.

    groups: setting -> variant -> first hits, (n_runs, n_targets); grid: simulations, (n_grid,); order: variant ->
    number of its colour.
    """
    figure, axes = panels(len(groups), 2, 7.8, panel_height(len(order)))
    for axis, (setting, variants) in zip(axes, groups.items(), strict=True):
        axis.set_xscale("log")
        axis.set_ylim(0.0, 1.0)
        named_lines(axis, grid, {v: share_hit(hits, grid) for v, hits in variants.items()}, order)
        axis.set_title(setting)
        axis.set_xlabel("simulations")
        axis.set_ylabel("share of (run, target) pairs hit")
        axis.grid(alpha=0.3)
    return figure
