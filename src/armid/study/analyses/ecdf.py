"""Empirical cumulative distribution of the first hits over runs and targets."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.study.analyses.drawing import named_lines, panel_height, panels
from armid.study.analyses.histories import SHARES_LEFT, VALUE_TARGETS, data_profile

Array = NDArray[np.float64]


def share_hit(hits: Array, grid: NDArray[np.int64]) -> Array:
    """Return the share of (run, target) pairs that are hit within each number of simulations, (n_grid,).

    F(e) = #{(r, t) : h_rt <= e} / (n_runs n_targets). hits: (n_runs, n_targets), infinite for never;
    grid: simulations, (n_grid,). Runs are not restarted in thought: what ends early stays where it ended.
    Source: Hansen et al., arXiv:1605.03560, section 5.
    """
    ordered = np.sort(hits, axis=None)
    return np.searchsorted(ordered, grid, side="right") / ordered.size


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
