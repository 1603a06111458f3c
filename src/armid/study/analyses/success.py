"""Success: how often all parameters end within a tolerance of the truth, and what it costs.

The expected running time is what one success costs when a method is started again until it has one.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pandas import DataFrame, concat

from armid.report.document import Column, Figure, Part, Table
from armid.report.style import LEAST_HEIGHT, named_lines, panels
from armid.study.analyses.analysis import N_RUNS, SETTING, TARGETS, VARIANT, Analysis, Evidence

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
    "it), over all cases and seeds; in brackets the share of runs that hit. {target} A run may leave a target again, "
    "so that hits can exceed the success rates, which judge the end."
)
TARGET = "Target: the largest relative error of the best candidate so far is at the tolerance or below."
ECDF_CAPTION = (
    "Share of all pairs of a run and a target that are hit within so many simulations. The 51 targets are largest "
    "relative errors of the parameters, from 100 % to 1e-8 %."
)


def success_parts(evidence: Evidence) -> Sequence[Part]:
    if not evidence.knows_truth:
        return ()
    return (success(concat([evidence.of(setting) for setting in evidence.settings])),)


SUCCESS = Analysis(
    "success", "Success rates", success_parts, "share of runs with all parameters within 1, 0.1 and 0.01 %"
)


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


def running_time_parts(evidence: Evidence) -> Sequence[Part]:
    if not evidence.knows_truth:
        return ()
    shown = {f"{100 * t:g} %": t for t in SUCCESS_TOLERANCES}
    title = "Expected running time to the truth [simulations]"
    return (
        running_time(evidence, evidence.histories.error_hits, shown, "running_time", title, TARGET),
        Figure("ecdf", "ECDF over targets", ECDF_CAPTION, lambda: ecdf_figure(evidence)),
    )


RUNNING_TIME = Analysis(
    "running_time", "Cost of the truth", running_time_parts, "simulations until the parameters are right"
)


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
WATERFALL_CAPTION = "What a run leaves of the way to the best fitness, sorted. A flat step is a local minimum."


def best_fitness_parts(evidence: Evidence) -> Sequence[Part]:
    if evidence.parameters.empty:
        return ()
    shown = {f"{t:g} left": t for t in SHARES_LEFT}
    title = "Expected running time to the best known fitness [simulations]"
    return (
        running_time(evidence, evidence.histories.value_hits, shown, "fixed_target", title, BEST_TARGET),
        Figure("waterfall", "Waterfall of starts", WATERFALL_CAPTION, lambda: waterfall_figure(evidence)),
    )


BEST_FITNESS = Analysis(
    "best_fitness", "Cost of the best fitness", best_fitness_parts, "simulations until the fitness is best"
)


def waterfall_figure(evidence: Evidence) -> Any:
    """Draw what the runs leave of the way to the best known fitness, sorted, a panel for each setting."""
    n_hit = np.isfinite(evidence.histories.value_hits).sum(axis=1)
    left, shares = TARGETS[np.maximum(n_hit - 1, 0)], np.linspace(0.0, 1.0, N_OF_TIMES)
    curves = [(setting, 100.0 * shares,
               {v: np.quantile(left[rows], shares, method="inverted_cdf") for v, rows in variants.items()})
              for setting, variants in evidence.groups.items()]  # fmt: skip
    return line_panels(curves, evidence.colours, yscale="log", ylim=(0.6 * TARGETS[-1], 1.6),
                       xlabel="runs, the best first [%]", ylabel="share of the way left")  # fmt: skip
