"""Cost of the best fitness: simulations until little of the way to the best known fitness is left."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.report.document import Figure, Part
from armid.report.style import panels
from armid.study.analyses.analysis import Analysis, Evidence
from armid.study.analyses.drawing import named_lines, panel_height
from armid.study.analyses.running_time import running_time, running_time_figure
from armid.study.traces import TARGETS

Array = NDArray[np.floating[Any]]
# Parts of the way to the best known value that may be left.
SHARES_LEFT = (1e-1, 1e-3, 1e-5)
N_GRID = 200
TARGET = (
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
FIGURE_CAPTION = (
    "Expected running time with targets of the fitness: what is left of the way from a first candidate (median over "
    "all runs on the case) to the best fitness that anyone found on the same case, noise and seed."
)


def parts(evidence: Evidence) -> Sequence[Part]:
    if evidence.parameters.empty:
        return ()
    hits = evidence.histories.value_hits
    shown = {f"{t:g} left": t for t in SHARES_LEFT}
    label = "share of the way to the best known fitness that is left"
    title = "Expected running time to the best known fitness"
    return (
        running_time(evidence, hits, shown, "fixed_target", f"{title} [simulations]", TARGET),
        Figure("data_profile", "Data profiles", PROFILE_CAPTION, lambda: data_profile_figure(evidence)),
        Figure("fixed_target", title, FIGURE_CAPTION, lambda: running_time_figure(evidence, hits, TARGETS, label)),
    )


BEST_FITNESS = Analysis("best_fitness", "Cost of the best fitness", parts, "simulations until the fitness is best")


def data_profile(hits: Array, n_parameters: NDArray[np.integer[Any]], grid: Array) -> Array:
    """Return the share of problems solved within each number of simplex gradients, (n_grid,).

    d(kappa) = #{p : h_p <= kappa (n_p + 1)} / n_problems. hits: first hits of one tolerance, (n_problems,);
    n_parameters: free ones of each problem, (n_problems,); grid: kappa, in units of n_p + 1 simulations, (n_grid,).
    Source: More and Wild, SIAM J. Optim. 20 (2009) 172, Eq. 2.5.
    """
    gradients = np.sort(hits / (n_parameters + 1))
    return np.searchsorted(gradients, grid, side="right") / gradients.size


def data_profile_figure(evidence: Evidence) -> Any:
    """Draw one row of panels a setting, one column a share that may be left, and one line a variant."""
    kept, n_free, columns = evidence.histories, evidence.n_free, len(SHARES_LEFT)
    figure, axes = panels(len(evidence.groups) * columns, columns, 6.6, panel_height(len(evidence.colours)))
    what = [(setting, share) for setting in evidence.groups for share in SHARES_LEFT]
    for axis, (setting, share) in zip(axes, what, strict=True):
        place = int(np.flatnonzero(share * (1.0 + 1e-9) >= TARGETS)[0])
        variants = evidence.groups[setting]
        least = min(int(n_free[rows].min()) for rows in variants.values()) + 1
        grid = np.geomspace(1.0, int(kept.grid[-1]) / least, N_GRID)
        axis.set(xscale="log", ylim=(0.0, 1.0))
        lines = {v: data_profile(kept.value_hits[rows, place], n_free[rows], grid) for v, rows in variants.items()}
        named_lines(axis, grid, lines, evidence.colours)
        axis.grid(alpha=0.3)
        axis.set_title(f"{setting}, {share:g} left")
    for axis in axes[-columns:]:
        axis.set_xlabel("simulations / (free parameters + 1)")
    for axis in axes[::columns]:
        axis.set_ylabel("share of problems solved")
    return figure
