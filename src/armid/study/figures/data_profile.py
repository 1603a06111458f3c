"""Data profiles of More and Wild."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from armid.study.figures.lines import named_lines, panel_height
from armid.study.figures.style import panels
from armid.study.metrics import SHARES_LEFT, VALUE_TARGETS, data_profile

Problems = tuple[np.ndarray, np.ndarray]
N_GRID = 200


def data_profile_figure(groups: Mapping[str, Mapping[str, Problems]], most: int, order: Mapping[str, int]) -> Any:
    """Draw one row of panels a setting and one column a tolerance.

    groups: setting -> variant -> (first hits of VALUE_TARGETS, (n_runs, n_targets); free parameters, (n_runs,));
    most: simulations of the largest budget.
    """
    figure, axes = panels(len(groups) * len(SHARES_LEFT), len(SHARES_LEFT), 6.6, panel_height(len(order)))
    what = [(setting, tau) for setting in groups for tau in SHARES_LEFT]
    for axis, (setting, tau) in zip(axes, what, strict=True):
        draw_panel(axis, groups[setting], tau, most, order)
        axis.set_title(f"{setting}, {tau:g} left")
    for axis in axes[-len(SHARES_LEFT) :]:
        axis.set_xlabel("simulations / (free parameters + 1)")
    for axis in axes[:: len(SHARES_LEFT)]:
        axis.set_ylabel("share of problems solved")
    return figure


def draw_panel(axis: Any, variants: Mapping[str, Problems], tau: float, most: int, order: Mapping[str, int]) -> None:
    """Draw the profile of one tolerance."""
    place = int(np.flatnonzero(tau * (1.0 + 1e-9) >= VALUE_TARGETS)[0])
    least = min(int(n.min()) for _, n in variants.values()) + 1
    grid = np.geomspace(1.0, most / least, N_GRID)
    axis.set_xscale("log")
    axis.set_ylim(0.0, 1.0)
    lines = {v: data_profile(hits[:, place], n, grid) for v, (hits, n) in variants.items()}
    named_lines(axis, grid, lines, order)
    axis.grid(alpha=0.3)
