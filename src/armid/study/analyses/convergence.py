"""Convergence bands: median and quartiles over runs against simulations."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.study.analyses.drawing import COLOURS, DASHES, PALE, panels

QUARTILES = (0.25, 0.5, 0.75)


def band(held_values: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return lower quartile, median and upper quartile at each count of simulations, (3, n_grid).

    held_values: of the best candidate so far, (n_runs, n_grid), infinite before the first. Each is a value that a run
    had (the smallest with at least that share of runs at or below), since no mean with infinity exists.
    """
    found: NDArray[np.float64] = np.quantile(held_values, QUARTILES, axis=0, method="inverted_cdf").astype(float)
    return found


Groups = Mapping[str, Mapping[str, np.ndarray]]
COLUMNS = 4


def convergence_figure(groups: Groups, grid: np.ndarray, label: str, floor: float) -> Any:
    """Draw one panel a variant: median as a line, quartiles as a band, a colour a setting.

    groups: variant -> setting -> quantity of the best candidate so far, (n_runs, n_grid), infinite before the first;
    grid: simulations, (n_grid,); label: of the quantity; floor: smaller values are drawn there.
    """
    figure, axes = panels(len(groups), COLUMNS, 4.4, 3.5)
    settings = list(dict.fromkeys(s for of in groups.values() for s in of))
    bands = {v: {s: shown_band(held, floor) for s, held in of.items()} for v, of in groups.items()}
    low, high = limits(bands)
    for axis, (variant, of) in zip(axes, bands.items(), strict=True):
        for setting, (lower, middle, upper) in of.items():
            i = settings.index(setting)
            axis.plot(grid, best_of_all(bands, setting), color=PALE, lw=1.0, zorder=1)
            axis.fill_between(grid, lower, upper, color=COLOURS[i % 7], alpha=0.22, lw=0, zorder=2)
            axis.plot(grid, middle, color=COLOURS[i % 7], ls=DASHES[i % 3], lw=1.8, label=setting, zorder=3)
        axis.set(xscale="log", yscale="log", xlim=(1, grid[-1]), ylim=(low, high))
        axis.minorticks_off()
        axis.grid(alpha=0.3)
        axis.set_title(variant, fontsize="medium")
    name_axes(figure, axes, label)
    return figure


def shown_band(held: np.ndarray, floor: float) -> np.ndarray:
    """Return the band with what is infinite left out and what is below the floor raised to it."""
    found = band(held)
    return np.where(np.isfinite(found), np.maximum(found, floor), np.nan)


def best_of_all(bands: Mapping[str, Mapping[str, np.ndarray]], setting: str) -> np.ndarray:
    """Return the smallest median of all variants at each count of simulations."""
    medians = np.array([of[setting][1] for of in bands.values() if setting in of])
    smallest: np.ndarray = np.min(np.where(np.isnan(medians), np.inf, medians), axis=0)
    return np.where(np.isfinite(smallest), smallest, np.nan)


def limits(bands: Mapping[str, Mapping[str, np.ndarray]]) -> tuple[float, float]:
    """Return the range of the upright axis, the same in all panels."""
    every = np.concatenate([b[np.isfinite(b)] for of in bands.values() for b in of.values()])
    return (float(every.min()) / 1.6, float(every.max()) * 1.6) if every.size else (0.1, 1.0)


def name_axes(figure: Any, axes: list[Any], label: str) -> None:
    """Label the outer axes and put one legend below all."""
    for i, axis in enumerate(axes):
        if i % COLUMNS == 0:
            axis.set_ylabel(label)
        else:
            axis.tick_params(labelleft=False)
        if i + COLUMNS >= len(axes):
            axis.set_xlabel("simulations")
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4, frameon=False)
