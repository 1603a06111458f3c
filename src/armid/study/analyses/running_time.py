"""Cost of the truth: simulations until the parameters are within a tolerance of it.

The expected running time is what one success costs when a method is started again until it has one.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pandas import DataFrame

from armid.report.document import Column, Figure, Part, Table
from armid.report.style import LEAST_HEIGHT, named_lines, panels
from armid.study.analyses.analysis import N_RUNS, SETTING, TARGETS, VARIANT, Analysis, Evidence
from armid.study.analyses.success import SUCCESS_TOLERANCES

Array = NDArray[np.floating[Any]]
PAIRS_HIT = "share of (run, target) pairs hit"
SHARE_AXES: Any = {"xscale": "log", "ylim": (0.0, 1.0)}
# Of both targets.
CAPTION = (
    "ERT = (simulations of all runs until the target is first hit, all that were used where it is not) / (number of "
    "runs that hit it), over all cases and seeds; inf where no run hits it. In brackets the share of runs that hit. "
    "{target} A run that hits a target may leave it again, since the fitness and not the error decides what is best: "
    "hits can exceed the success rates, which judge the end."
)
TARGET = "Target: the largest relative error of the best candidate so far is at the tolerance or below."
ECDF_CAPTION = (
    "Share of all pairs of a run and a target that are hit within so many simulations. The 51 targets are largest "
    "relative errors of the parameters, evenly spread in their logarithm from 100 % to 1e-8 %; a target is hit when "
    "the best candidate so far (by fitness) is first that near to the truth. Your own identifiers and the best have "
    "a colour, the others are grey. A run that stops early stays where it ended."
)
FIGURE_CAPTION = (
    "Simulations that one success costs on average when a method is started again until it has one: those of all runs "
    "until the target is first hit (all that were used where it is not), divided by the number of runs that hit. A "
    "line ends at the strictest target that any run hit. Your own identifiers and the best have a colour."
)


def parts(evidence: Evidence) -> Sequence[Part]:
    if not evidence.knows_truth:
        return ()
    hits = evidence.histories.error_hits
    shown = {f"{100 * t:g} %": t for t in SUCCESS_TOLERANCES}
    label = "largest relative error of the best candidate [%]"
    title = "Expected running time to the truth [simulations]"
    return (
        running_time(evidence, hits, shown, "running_time", title, TARGET),
        Figure("ecdf", "ECDF over targets", ECDF_CAPTION, lambda: ecdf_figure(evidence)),
        Figure("running_time", "Expected running time", FIGURE_CAPTION,
               lambda: running_time_figure(evidence, hits, 100.0 * TARGETS, label)),
    )  # fmt: skip


RUNNING_TIME = Analysis("running_time", "Cost of the truth", parts, "simulations until the parameters are right")


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
    curves: Sequence[tuple[str, ArrayLike, Mapping[str, Array]]], colours: Mapping[str, int], columns: int = 2,
    width: float = 7.8, **axes: Any,
) -> Any:  # fmt: skip
    """Draw one panel each with a line for each identifier. curves: title, x, and name -> y; axes: scales and labels."""
    figure, cells = panels(len(curves), columns, width, LEAST_HEIGHT)
    for axis, (title, x, lines) in zip(cells, curves, strict=True):
        axis.set(title=title, **axes)
        named_lines(axis, x, lines, colours)
        axis.grid(alpha=0.3)
    return figure


def running_time_figure(evidence: Evidence, hits: Array, targets: Array, label: str) -> Any:
    """Draw one panel a setting and one line a variant; a line ends where no run hits the target."""
    curves = []
    for setting, variants in evidence.groups.items():
        lines = {v: expected_running_time(hits[rows], evidence.used[rows])[0] for v, rows in variants.items()}
        curves.append((setting, targets, {v: np.where(np.isfinite(ert), ert, np.nan) for v, ert in lines.items()}))
    limits = powers_around(line for *_, lines in curves for line in lines.values())
    return line_panels(curves, evidence.colours, xscale="log", yscale="log", xlim=(targets[0], targets[-1]),
                       ylim=limits, xlabel=label, ylabel="expected running time [simulations]")  # fmt: skip


def powers_around(lines: Iterable[Array]) -> tuple[float, float]:
    finite = np.concatenate([y[np.isfinite(y)] for y in lines])
    if not finite.size:
        return 1.0, 10.0
    return 10.0 ** np.floor(np.log10(finite.min())), 10.0 ** np.ceil(np.log10(finite.max()) + 1e-9)


# Parts of the way to the best known value that may be left.
SHARES_LEFT = (1e-1, 1e-3, 1e-5)
N_OF_TIMES = 200
BEST_TARGET = (
    "Target: of the way from a first candidate (median of the first fitness of all runs on the case) to the best "
    "fitness that any identifier found on the same case, noise and seed, no more than this share is left. Where "
    "several fitnesses were run, each is compared with its own kind."
)
PROFILE_CAPTION = (
    "Share of the problems (a case with its noise and seed) that are solved within so many simplex gradients, that is "
    "simulations divided by one more than the number of free parameters. Solved: no more than the share in the title "
    "is left of the way from a first candidate to the best fitness that anyone found (More and Wild 2009). Each "
    "fitness is compared with its own kind only."
)
LEFT_LABEL = "share of the way to the best known fitness that is left"
WATERFALL_CAPTION = (
    "What each run leaves of the way from a first candidate to the best known fitness when it ends, sorted: a seed is "
    "a start. A flat step above the lowest one is a local minimum that many starts end in; 1e-10 and below are alike."
)
BEST_FIGURE_CAPTION = (
    "Expected running time with targets of the fitness: what is left of the way from a first candidate (median over "
    "all runs on the case) to the best fitness that anyone found on the same case, noise and seed."
)


def best_fitness_parts(evidence: Evidence) -> Sequence[Part]:
    if evidence.parameters.empty:
        return ()
    hits = evidence.histories.value_hits
    shown = {f"{t:g} left": t for t in SHARES_LEFT}
    title = "Expected running time to the best known fitness"
    return (
        running_time(evidence, hits, shown, "fixed_target", f"{title} [simulations]", BEST_TARGET),
        Figure("waterfall", "Waterfall of starts", WATERFALL_CAPTION, lambda: waterfall_figure(evidence)),
        Figure("data_profile", "Data profiles", PROFILE_CAPTION, lambda: data_profile_figure(evidence)),
        Figure(
            "fixed_target", title, BEST_FIGURE_CAPTION, lambda: running_time_figure(evidence, hits, TARGETS, LEFT_LABEL)
        ),
    )


BEST_FITNESS = Analysis(
    "best_fitness", "Cost of the best fitness", best_fitness_parts, "simulations until the fitness is best"
)


def data_profile(hits: Array, n_parameters: NDArray[np.integer[Any]], grid: Array) -> Array:
    """Return the share of problems solved within each number of simplex gradients, (n_grid,).

    d(kappa) = #{p : h_p <= kappa (n_p + 1)} / n_problems. hits: of one tolerance, (n_problems,); grid: kappa.
    Source: More and Wild, SIAM J. Optim. 20 (2009) 172, Eq. 2.5.
    """
    return share_hit(hits / (n_parameters + 1), grid)


def data_profile_figure(evidence: Evidence) -> Any:
    kept, n_free, columns, curves = evidence.histories, evidence.n_free, len(SHARES_LEFT), []
    for (setting, variants), share in product(evidence.groups.items(), SHARES_LEFT):
        place = int(np.flatnonzero(share * (1.0 + 1e-9) >= TARGETS)[0])
        least = min(int(n_free[rows].min()) for rows in variants.values()) + 1
        grid = np.geomspace(1.0, int(kept.grid[-1]) / least, N_OF_TIMES)
        lines = {v: data_profile(kept.value_hits[rows, place], n_free[rows], grid) for v, rows in variants.items()}
        curves.append((f"{setting}, {share:g} left", grid, lines))
    return line_panels(curves, evidence.colours, columns, 6.6, xlabel="simulations / (free parameters + 1)",
                       ylabel="share of problems solved", **SHARE_AXES)  # fmt: skip


def waterfall_figure(evidence: Evidence) -> Any:
    """Draw what the runs leave of the way to the best known fitness, sorted, a panel for each setting."""
    n_hit = np.isfinite(evidence.histories.value_hits).sum(axis=1)
    left, shares = TARGETS[np.maximum(n_hit - 1, 0)], np.linspace(0.0, 1.0, N_OF_TIMES)
    curves = [(setting, 100.0 * shares,
               {v: np.quantile(left[rows], shares, method="inverted_cdf") for v, rows in variants.items()})
              for setting, variants in evidence.groups.items()]  # fmt: skip
    return line_panels(curves, evidence.colours, yscale="log", ylim=(0.6 * TARGETS[-1], 1.6),
                       xlabel="runs, the best first [%]", ylabel="share of the way left")  # fmt: skip
