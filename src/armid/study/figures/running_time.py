"""Expected running time against the target."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from armid.study.figures.lines import listed_lines, panel_height
from armid.study.figures.style import panels
from armid.study.metrics import expected_running_time

Hits = tuple[np.ndarray, np.ndarray]


def running_time_figure(
    groups: Mapping[str, Mapping[str, Hits]], targets: np.ndarray, order: Mapping[str, int], label: str
) -> Any:
    """Draw one panel a setting and one line a variant; a line ends where no run hits the target.

    Names are listed from the strictest target reached.

    groups: setting -> variant -> (first hits, (n_runs, n_targets); simulations used, (n_runs,)); targets: falling,
    (n_targets,), as shown; label: of the axis of targets.
    """
    figure, axes = panels(len(groups), 2, 7.8, panel_height(len(order)))
    for axis, (setting, variants) in zip(axes, groups.items(), strict=True):
        axis.set_xscale("log")
        axis.set_yscale("log")
        lines = {v: np.where(np.isfinite(e), e, np.nan) for v, e in running_times(variants).items()}
        axis.set_xlim(targets[0], targets[-1])
        axis.set_ylim(*limits(lines))
        listed_lines(axis, targets, lines, order, sorted(lines, key=lambda v: farthest(lines[v])))
        axis.set_title(setting)
        axis.set_xlabel(label)
        axis.set_ylabel("expected running time [simulations]")
        axis.grid(alpha=0.3)
    return figure


def running_times(variants: Mapping[str, Hits]) -> dict[str, np.ndarray]:
    """Return the expected running time of each variant to each target."""
    return {variant: expected_running_time(hits, used)[0] for variant, (hits, used) in variants.items()}


def farthest(line: np.ndarray) -> tuple[int, float]:
    """Return what sorts lines: how many targets are not reached, then the running time to the last that is."""
    reached = np.isfinite(line)
    return int(np.count_nonzero(~reached)), float(line[reached][-1]) if reached.any() else np.inf


def limits(lines: Mapping[str, np.ndarray]) -> tuple[float, float]:
    """Return the range of the upright axis: powers of ten around all that is finite."""
    finite = np.concatenate([y[np.isfinite(y)] for y in lines.values()] or [np.ones(1)])
    if not finite.size:
        return 1.0, 10.0
    return 10.0 ** np.floor(np.log10(finite.min())), 10.0 ** np.ceil(np.log10(finite.max()) + 1e-9)
