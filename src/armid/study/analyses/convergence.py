"""Convergence: error and fitness of the best candidate against simulations, median and quartiles over runs."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.report.document import Figure, Part, slug
from armid.report.style import COLOURS, DASHES, PALE, legend_below, panels
from armid.study.analyses.analysis import Analysis, Evidence

Array = NDArray[np.floating[Any]]
QUARTILES = (0.25, 0.5, 0.75)
COLUMNS = 4
ERROR_LABEL = "largest relative\nerror [%]"
# Smaller values are drawn there.
LEAST_PERCENT, LEAST_FITNESS = 1e-6, 1e-16
ERROR_CAPTION = (
    "Largest relative error of the best candidate so far against simulations, over all cases and seeds: median as a "
    "line, quartiles as a band, a colour a noise level. The error may rise, since the fitness decides what is best. "
    "Pale: the smallest median of all identifiers. Errors below 1e-6 % are drawn there; a run that stops early keeps "
    "its value."
)
FITNESS_CAPTION = (
    "Smallest value of the fitness {fitness} so far (of a similarity: 1 minus its degree) against simulations, over "
    "all cases and seeds: median as a line, quartiles as a band, a colour a noise level. Pale: the smallest median of "
    "all identifiers."
)


def parts(evidence: Evidence) -> Sequence[Part]:
    if evidence.parameters.empty:
        return ()
    kept, figures = evidence.histories, []
    if evidence.knows_truth:
        every = np.ones(len(evidence.runs), bool)
        draw = partial(convergence_figure, evidence, every, 100.0 * kept.errors, ERROR_LABEL, LEAST_PERCENT)
        figures.append(Figure("convergence_error", "Convergence of the parameters", ERROR_CAPTION, draw))
    names = list(dict.fromkeys(map(str, evidence.runs["fitness"])))
    for name in names:
        own = (evidence.runs["fitness"] == name).to_numpy()
        draw = partial(convergence_figure, evidence, own, kept.values, f"best fitness\n({name})", LEAST_FITNESS)
        file = slug("convergence", name) if len(names) > 1 else "convergence_fitness"
        figures.append(Figure(file, f"Convergence of {name}", FITNESS_CAPTION.format(fitness=name), draw))
    return figures


CONVERGENCE = Analysis("convergence", "Convergence", parts, "error and fitness against simulations")


def band(held_values: Array) -> Array:
    """Return lower quartile, median and upper quartile at each count of simulations, (3, n_grid).

    held_values: of the best candidate so far, (n_runs, n_grid), infinite before the first. Each is a value that a run
    had (the smallest with at least that share of runs at or below), since no mean with infinity exists.
    """
    found: Array = np.quantile(held_values, QUARTILES, axis=0, method="inverted_cdf").astype(float)
    return found


def convergence_figure(evidence: Evidence, own: NDArray[np.bool_], values: Array, label: str, floor: float) -> Any:
    """Draw one panel a variant: median as a line, quartiles as a band, a colour a setting.

    own: runs to show, (n_runs,); values: quantity of the best candidate so far, (n_runs, n_grid), infinite before the
    first; label: of the quantity; floor: smaller values are drawn there.
    """
    grid = evidence.histories.grid
    bands: dict[str, dict[str, Array]] = {}
    for setting, variants in evidence.groups.items():
        for variant, rows in variants.items():
            if own[rows].any():
                found = band(values[rows[own[rows]]])
                shown = np.where(np.isfinite(found), np.maximum(found, floor), np.nan)
                bands.setdefault(variant, {})[setting] = shown
    every = np.concatenate([b[np.isfinite(b)] for of in bands.values() for b in of.values()])
    limits = (float(every.min()) / 1.6, float(every.max()) * 1.6) if every.size else (0.1, 1.0)
    settings = list(dict.fromkeys(s for of in bands.values() for s in of))
    figure, axes = panels(len(bands), COLUMNS, 4.4, 3.5)
    for place, (axis, (variant, of)) in enumerate(zip(axes, bands.items(), strict=True)):
        for setting, (lower, middle, upper) in of.items():
            i = settings.index(setting)
            axis.plot(grid, best_of_all(bands, setting), color=PALE, lw=1.0, zorder=1)
            axis.fill_between(grid, lower, upper, color=COLOURS[i % 7], alpha=0.22, lw=0, zorder=2)
            axis.plot(grid, middle, color=COLOURS[i % 7], ls=DASHES[i % 3], lw=1.8, label=setting, zorder=3)
        axis.set(xscale="log", yscale="log", xlim=(1, grid[-1]), ylim=limits)
        axis.minorticks_off()
        axis.grid(alpha=0.3)
        axis.set_title(variant, fontsize="medium")
        if place % COLUMNS == 0:
            axis.set_ylabel(label)
        else:
            axis.tick_params(labelleft=False)
        if place + COLUMNS >= len(axes):
            axis.set_xlabel("simulations")
    legend_below(figure, 4)
    return figure


def best_of_all(bands: Mapping[str, Mapping[str, Array]], setting: str) -> Array:
    """Return the smallest median of all variants at each count of simulations, NaN where none has any."""
    medians = np.array([of[setting][1] for of in bands.values() if setting in of])
    smallest: Array = np.min(np.where(np.isnan(medians), np.inf, medians), axis=0)
    return np.where(np.isfinite(smallest), smallest, np.nan)
