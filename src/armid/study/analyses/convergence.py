"""Convergence: error and fitness of the best candidate against simulations, median over runs."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.report.document import Column, Figure, Part, Table, slug
from armid.study.analyses.analysis import BUDGET_COLUMN, VARIANT, Analysis, Evidence, fitness_scale
from armid.study.analyses.success import PAIRS_HIT, SHARE_AXES, line_panels, share_hit

Array = NDArray[np.floating[Any]]
ERROR_LABEL = "largest relative error [%]"
# Smaller values are drawn there.
LEAST_PERCENT, LEAST_FITNESS = 1e-6, 1e-16
ERROR_CAPTION = (
    "Largest relative error of the best candidate so far against simulations: median over all cases and seeds, drawn "
    "from 1e-6 % on. The error may rise, since the fitness decides what is best."
)
FITNESS_CAPTION = "Smallest value of {fitness} so far against simulations: median over all cases and seeds."


def parts(evidence: Evidence) -> Sequence[Part]:
    if evidence.parameters.empty:
        return ()
    kept, figures = evidence.histories, []
    if evidence.knows_truth:
        mask = np.ones(len(evidence.runs), bool)
        draw = partial(convergence_figure, evidence, mask, 100.0 * kept.errors, ERROR_LABEL, LEAST_PERCENT)
        figures.append(Figure("convergence_error", "Convergence of the parameters", ERROR_CAPTION, draw))
    names = list(dict.fromkeys(map(str, evidence.runs["fitness"])))
    for name in names:
        own = (evidence.runs["fitness"] == name).to_numpy()
        unit, factor = fitness_scale(name, evidence.unit)
        label = f"best fitness ({name}{unit})"
        draw = partial(convergence_figure, evidence, own, factor * kept.values, label, LEAST_FITNESS)
        file = slug("convergence", name) if len(names) > 1 else "convergence_fitness"
        figures.append(Figure(file, f"Convergence of {name}", FITNESS_CAPTION.format(fitness=name), draw))
    return figures


CONVERGENCE = Analysis("convergence", "Convergence", parts, "error and fitness against simulations")


def median(held_values: Array) -> Array:
    """Return the median at each count of simulations, (n_grid,), a value that a run had."""
    medians: Array = np.quantile(held_values, 0.5, axis=0, method="inverted_cdf").astype(float)
    return medians


def convergence_figure(evidence: Evidence, own: NDArray[np.bool_], values: Array, label: str, floor: float) -> Any:
    """Draw one panel a setting and one line a variant, the median over its runs.

    own: runs to show, (n_runs,); values: quantity of the best candidate so far, (n_runs, n_grid); floor: least drawn.
    """
    grid = evidence.histories.grid
    curves: dict[str, dict[str, Array]] = {}
    for setting, variants in evidence.groups.items():
        for variant, rows in variants.items():
            if own[rows].any():
                medians = median(values[rows[own[rows]]])
                spent = grid > evidence.runs["budget"].to_numpy()[rows[own[rows]]].max()
                shown = np.where(np.isfinite(medians) & ~spent, np.maximum(medians, floor), np.nan)
                curves.setdefault(setting, {})[variant] = shown
    finite = np.concatenate([line[np.isfinite(line)] for lines in curves.values() for line in lines.values()])
    limits = (float(finite.min()) / 1.6, float(finite.max()) * 1.6) if finite.size else (0.1, 1.0)
    figure = line_panels([(setting, grid, lines) for setting, lines in curves.items()], evidence.colours,
                         xscale="log", yscale="log", xlim=(1, max(grid[-1], 2)), ylim=limits, xlabel="simulations",
                         ylabel=label)  # fmt: skip
    for axis in figure.axes:
        axis.minorticks_off()
    return figure


ATTAINED_CAPTION = (
    "Share of all pairs of a run and a target that are hit within so many simulations a parameter. The 51 targets are"
    " shares of the way from a first candidate to the fitness of the truth, from all of it to 1e-10."
)
AREA_CAPTION = (
    "Mean over the targets of the figure of the share of the budget, in its logarithm, that is left when a target is "
    "first hit. 1 hits all at once, 0 none; over all cases and seeds."
)


def anytime_parts(evidence: Evidence) -> Sequence[Part]:
    if not evidence.is_suite or evidence.parameters.empty:
        return ()
    return areas(evidence), Figure("attained", "Targets hit at any time", ATTAINED_CAPTION, lambda: attained(evidence))


ANYTIME = Analysis("anytime", "At any time", anytime_parts, "area over the convergence curve, empirical attainment")


def area_over_curve(hits: Array, budget: Array) -> Array:
    """Return the area over the convergence curve of each run, (n_runs,), from 0 to 1.

    A = mean over targets of max(0, 1 - ln h / ln B). hits: first hits h, (n_runs, n_targets); budget: B above 1.
    Source: Lopez-Ibanez et al. 2024, doi:10.1162/evco_a_00341 (the share of an attainment surface that is covered).
    """
    left: Array = np.clip(1.0 - np.log(hits) / np.log(budget)[:, np.newaxis], 0.0, 1.0).mean(axis=1)
    return left


def areas(evidence: Evidence) -> Table:
    area = area_over_curve(evidence.histories.value_hits, evidence.runs["budget"].to_numpy(float))
    groups = evidence.runs.assign(area=area).groupby(["setting", "variant"], sort=False)["area"]
    frame = groups.describe()[["count", "mean", "25%", "50%", "75%"]].reset_index()
    place = {setting: i for i, setting in enumerate(evidence.settings)}
    frame = frame.assign(_at=frame["setting"].map(place)).sort_values(["_at", "mean"], ascending=[True, False])
    columns = (BUDGET_COLUMN, VARIANT, Column("count", "runs", ".0f"), Column("mean", "area", ".3f"),
               Column("25%", "lower quartile", ".3f"), Column("50%", "median", ".3f"),
               Column("75%", "upper quartile", ".3f"))  # fmt: skip
    return Table("anytime", "Area over the convergence curve", AREA_CAPTION, frame.drop(columns="_at"), columns,
                 grouped=True)  # fmt: skip


def attained(evidence: Evidence) -> Any:
    """Draw the shares of targets hit against simulations a parameter, one panel a setting and one line a variant."""
    per_parameter = evidence.histories.value_hits / evidence.n_free[:, np.newaxis]
    budget, curves = evidence.runs["budget"].to_numpy(float) / evidence.n_free, []
    for setting, variants in evidence.groups.items():
        # a curve ends where the budget of its setting does
        last = max(float(budget[rows].max()) for rows in variants.values())
        grid = np.geomspace(1.0 / evidence.n_free.max(), last, 121)
        curves.append((setting, grid, {v: share_hit(per_parameter[rows], grid) for v, rows in variants.items()}))
    return line_panels(curves, evidence.colours, xlabel="simulations / free parameters", ylabel=PAIRS_HIT, **SHARE_AXES)
