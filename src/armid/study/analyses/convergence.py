"""Success and convergence: how often all parameters end within a tolerance of the truth, and what it costs.

The expected running time is what one success costs when a method is started again until it has one.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pandas import DataFrame, concat

from armid.problem.fitness import SIMILARITIES
from armid.report.document import Column, Figure, Part, Table, slug
from armid.report.style import LEAST_HEIGHT, named_lines, panels
from armid.study.analyses.analysis import BUDGET_COLUMN, N_RUNS, SETTING, TARGETS, VARIANT, Analysis, Evidence

Array = NDArray[np.floating[Any]]
PAIRS_HIT = "share of (run, target) pairs hit"
SHARE_AXES: Any = {"xscale": "log", "ylim": (0.0, 1.0)}
SUCCESS_TOLERANCES = (1e-2, 1e-3, 1e-4)
SUCCESS_CAPTION = (
    "A run succeeds when the relative errors of all parameters of its result are within the tolerance; a failed run "
    "does not. In brackets the 95 % Wilson interval of the rate. Runs of all cases and seeds count alike."
)
# Of both targets.
CAPTION = (
    "ERT = (simulations of all runs until the target is first hit, or all that were used) / (number of runs that hit "
    "it), over all cases and seeds; in brackets the share of runs that hit. {target}"
)
TARGET = (
    "Target: the largest relative error of the best candidate so far is at the tolerance or below. A run may leave a "
    "target again, so that hits can exceed the success rates, which judge the end."
)
ECDF_CAPTION = (
    "Share of all pairs of a run and a target that are hit within so many simulations. The 51 targets are largest "
    "relative errors of the parameters, from 100 % to 1e-8 %."
)


SUCCESS = Analysis("success", "Success rates", lambda evidence: (
    success(concat([evidence.of(setting) for setting in evidence.settings])),
), "share of runs with all parameters within 1, 0.1 and 0.01 %", lambda evidence: evidence.knows_truth)  # fmt: skip


def success(runs: DataFrame) -> Table:
    """Return, per setting, variant and tolerance: runs, successes, rate and its 95 % Wilson interval.

    A failed run is not a success. Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    from statsmodels.stats.proportion import proportion_confint

    names = {f"{100 * tolerance:g}": tolerance for tolerance in SUCCESS_TOLERANCES}
    rows = []
    for key, group in runs.dropna(subset=["largest_error"]).groupby(["setting", "variant"], sort=False):
        row = dict(zip(("setting", "variant", "n"), (*key, len(group)), strict=True))
        for percent, tolerance in names.items():
            n = int((group["largest_error"] <= tolerance).sum())
            rate, (low, high) = n / len(group), proportion_confint(n, len(group), method="wilson")
            shown = {"text": f"{100 * rate:.1f} ({100 * low:.1f} to {100 * high:.1f})", "successes": n, "rate": rate}
            row |= {f"within_{percent}_percent_{k}": v for k, v in {**shown, "low": low, "high": high}.items()}
        rows.append(row)
    columns = (Column(f"within_{percent}_percent_text", f"within {percent} % [% of runs]") for percent in names)
    return Table("success", "Success rates", SUCCESS_CAPTION, DataFrame(rows), (SETTING, VARIANT, N_RUNS, *columns))


RUNNING_TIME = Analysis("running_time", "Cost of the truth", lambda evidence: (
    running_time(evidence, evidence.histories.error_hits, {f"{100 * t:g} %": t for t in SUCCESS_TOLERANCES},
                 "running_time", "Expected running time to the truth [simulations]", TARGET),
    Figure("ecdf", "ECDF over targets", ECDF_CAPTION, lambda: ecdf_figure(evidence)),
), "simulations until the parameters are right", lambda evidence: evidence.knows_truth)  # fmt: skip


def share_hit(hits: Array, grid: ArrayLike) -> Array:
    """Return the share of (run, target) pairs that are hit within each number of simulations, (n_grid,).

    hits: (n_runs, n_targets), infinite for never. No restarts are assumed: a run that ends early stays where it ended.
    Source: Hansen et al., arXiv:1605.03560, section 5.
    """
    return np.searchsorted(np.sort(hits, axis=None), grid, side="right") / hits.size


def expected_running_time(hits: Array, used: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the expected running time to each target [simulations], infinite where no run hits it, and the successes.

    ERT(t) = (simulations of all runs until t is hit, or all that were used) / (number of runs that hit t).
    hits: (n_runs, n_targets), infinite for never; used: (n_runs,). Source: Hansen et al., arXiv:1605.03560, section 4.
    """
    reached = np.isfinite(hits)
    spent = np.where(reached, hits, used[:, np.newaxis]).sum(axis=0, dtype=np.float64)
    successes = np.count_nonzero(reached, axis=0)
    ert = np.divide(spent, successes, out=np.full(spent.shape, np.inf), where=successes > 0)
    return ert, successes


def running_time(
    evidence: Evidence, hits: Array, shown: Mapping[str, float], name: str, title: str, target: str
) -> Table:
    """Return the expected running time to some targets (shown: heading -> target), one line a setting and variant."""
    places = {text: int(np.flatnonzero(np.isclose(TARGETS, t, rtol=1e-9, atol=0.0))[0]) for text, t in shown.items()}
    rows = []
    for (setting, variant), group in evidence.runs.groupby(["setting", "variant"], sort=False):
        own = group.index.to_numpy()
        ert, successes = expected_running_time(hits[own], evidence.used[own])
        row: dict[str, object] = {"setting": setting, "variant": variant, "n": len(own)}
        for text, i in places.items():
            row |= {f"ert {text}": ert[i], f"hits {text}": successes[i]}
            row[text] = f"{ert[i]:.0f} ({100 * successes[i] / len(own):.0f} %)"
        rows.append(row)
    columns = (SETTING, VARIANT, N_RUNS, *(Column(text, text) for text in shown))
    return Table(name, title, CAPTION.format(target=target), DataFrame(rows), columns)


def ecdf_figure(evidence: Evidence) -> Any:
    kept = evidence.histories
    curves = [(setting, kept.grid, {v: share_hit(kept.error_hits[rows], kept.grid) for v, rows in variants.items()})
              for setting, variants in evidence.groups.items()]  # fmt: skip
    return line_panels(curves, evidence.colours, xlabel="simulations", ylabel=PAIRS_HIT, **SHARE_AXES)


def line_panels(
    curves: Sequence[tuple[str, ArrayLike, Mapping[str, Array]]], colours: Mapping[str, int], **axes: Any
) -> Any:
    """Draw one panel each with a line for each identifier. curves: title, x, and name -> y; axes: scales and labels."""
    figure, cells = panels(len(curves), 2, 7.8, LEAST_HEIGHT)
    for axis, (title, x, lines) in zip(cells, curves, strict=True):
        axis.set(title=title, **axes)
        named_lines(axis, x, lines, colours)
        axis.grid(alpha=0.3)
    return figure


# Parts of the way to the best known value that may be left.
SHARES_LEFT = (1e-1, 1e-3, 1e-5)
N_OF_TIMES = 200
BEST_TARGET = (
    "Target: no more than this share is left of the way from a first candidate (median over all runs on the case) to "
    "the best fitness that anyone found on the same case, noise and seed."
)
WATERFALL_CAPTION = "What a run leaves of the way to the best fitness, sorted. Runs that end alike make a step."


BEST_FITNESS = Analysis("best_fitness", "Cost of the best fitness", lambda evidence: (
    running_time(evidence, evidence.histories.value_hits, {f"{t:g} left": t for t in SHARES_LEFT}, "fixed_target",
                 "Expected running time to the best known fitness [simulations]", BEST_TARGET),
    Figure("waterfall", "Waterfall of starts", WATERFALL_CAPTION, lambda: waterfall_figure(evidence)),
), "simulations until the fitness is best", lambda evidence: evidence.has_results)  # fmt: skip


def waterfall_figure(evidence: Evidence) -> Any:
    """Draw what the runs leave of the way to the best known fitness, sorted, a panel for each setting."""
    n_hit = np.isfinite(evidence.histories.value_hits).sum(axis=1)
    left, shares = TARGETS[np.maximum(n_hit - 1, 0)], np.linspace(0.0, 1.0, N_OF_TIMES)
    curves = [(setting, 100.0 * shares,
               {v: np.quantile(left[rows], shares, method="inverted_cdf") for v, rows in variants.items()})
              for setting, variants in evidence.groups.items()]  # fmt: skip
    return line_panels(curves, evidence.colours, yscale="log", ylim=(0.6 * TARGETS[-1], 1.6),
                       xlabel="runs, the best first [%]", ylabel="share of the way left")  # fmt: skip


ERROR_LABEL = "largest relative error [%]"
# Smaller values are drawn there.
LEAST_PERCENT, LEAST_FITNESS = 1e-6, 1e-16
ERROR_CAPTION = (
    "Largest relative error of the best candidate so far against simulations: median over all cases and seeds, drawn "
    "from 1e-6 % on. The error may rise, since the fitness decides what is best."
)
FITNESS_CAPTION = "Smallest value of {fitness} so far against simulations: median over all cases and seeds."


def convergence_parts(evidence: Evidence) -> Sequence[Part]:
    kept, figures = evidence.histories, []
    if evidence.knows_truth:
        mask = np.ones(len(evidence.runs), bool)
        draw = partial(convergence_figure, evidence, mask, 100.0 * kept.errors, ERROR_LABEL, LEAST_PERCENT)
        figures.append(Figure("convergence_error", "Convergence of the parameters", ERROR_CAPTION, draw))
    names = list(dict.fromkeys(map(str, evidence.runs["fitness"])))
    for name in names:
        own = (evidence.runs["fitness"] == name).to_numpy()
        unit, factor = evidence.scale_of_fitness(name)
        drawn = f"1 - {name}" if name.partition(":")[0] in SIMILARITIES else name
        label = f"best fitness ({drawn}{unit})"
        draw = partial(convergence_figure, evidence, own, factor * kept.values, label, LEAST_FITNESS)
        file = slug("convergence", name) if len(names) > 1 else "convergence_fitness"
        figures.append(Figure(file, f"Convergence of {name}", FITNESS_CAPTION.format(fitness=drawn), draw))
    return figures


CONVERGENCE = Analysis("convergence", "Convergence", convergence_parts, "error and fitness against simulations",
                       lambda e: e.has_results)  # fmt: skip


def median(held_values: Array) -> Array:
    """Return the median at each count of simulations, (n_grid,), a value that a run had."""
    return np.asarray(np.quantile(held_values, 0.5, axis=0, method="inverted_cdf"), float)


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


ANYTIME = Analysis("anytime", "At any time", lambda evidence: (
    areas(evidence),
    Figure("attained", "Targets hit at any time", ATTAINED_CAPTION, lambda: attained(evidence)),
), "area over the convergence curve, empirical attainment", lambda e: e.is_suite and e.has_results)  # fmt: skip


def area_over_curve(hits: Array, budget: Array) -> Array:
    """Return the area over the convergence curve of each run, (n_runs,), from 0 to 1.

    A = mean over targets of max(0, 1 - ln h / ln B). hits: first hits h, (n_runs, n_targets); budget: B above 1.
    Source: Lopez-Ibanez et al. 2024, doi:10.1162/evco_a_00341 (the share of an attainment surface that is covered).
    """
    return np.asarray(np.clip(1.0 - np.log(hits) / np.log(budget)[:, np.newaxis], 0.0, 1.0).mean(axis=1))


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
