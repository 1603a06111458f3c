"""Expected running time: what one success costs when a method is started again until it has one."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame

from armid.study.analyses.drawing import listed_lines, panel_height, panels
from armid.study.analyses.histories import ERROR_TARGETS, SHARES_LEFT, VALUE_TARGETS
from armid.study.analyses.success import TOLERANCES
from armid.study.analyses.table import Column, Table

Array = NDArray[np.float64]


def expected_running_time(hits: Array, used: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the expected running time to each target [simulations], (n_targets,), and the successes, (n_targets,).

    ERT(t) = (sum over runs of the simulations until t is hit, or of all that were used) / (number of runs that hit t);
    infinite where none does. hits: first hits, (n_runs, n_targets), infinite for never; used: simulations, (n_runs,).
    Source: Hansen et al., arXiv:1605.03560, section 4.
    """
    reached = np.isfinite(hits)
    spent = np.where(reached, hits, used[:, np.newaxis]).sum(axis=0, dtype=np.float64)
    successes = np.count_nonzero(reached, axis=0)
    ert = np.divide(spent, successes, out=np.full(spent.shape, np.inf), where=successes > 0)
    return ert, successes


WORDS = (
    "ERT = (simulations of all runs until the target is first hit, all that were used where it is not) / (number of "
    "runs that hit it), over all cases and seeds; inf where no run hits it. In brackets the share of runs that hit. "
    "{target} A run that hits a target may leave it again, since the fitness and not the error decides what is best: "
    "hits can exceed the success rates, which judge the end."
)
OF_ERRORS = "Target: the largest relative error of the best candidate so far is at the tolerance or below."
OF_VALUES = (
    "Target: of the way from a first candidate (median of the first fitness of all runs on the case) to the best "
    "fitness that any identifier found on the same case, noise and seed, no more than this share is left. Where "
    "several fitnesses were run, each is compared with its own kind."
)


def running_time(found: DataFrame, error_hits: np.ndarray) -> Table:
    """Return the expected running time to errors of 1, 0.1 and 0.01 %.

    found: outcomes of runs; error_hits: first hits of ERROR_TARGETS, (n_runs, n_targets).
    """
    shown = {f"{100 * t:g} %": index_of(ERROR_TARGETS, t) for t in TOLERANCES}
    words = WORDS.format(target=OF_ERRORS)
    return table("running_time", "Expected running time to the truth [simulations]", words, found, error_hits, shown)


def fixed_target(found: DataFrame, value_hits: np.ndarray) -> Table:
    """Return the expected running time to shares of the way to the best known fitness.

    found: outcomes of runs; value_hits: first hits of VALUE_TARGETS, (n_runs, n_targets).
    """
    shown = {f"{t:g} left": index_of(VALUE_TARGETS, t) for t in SHARES_LEFT}
    words = WORDS.format(target=OF_VALUES)
    title = "Expected running time to the best known fitness [simulations]"
    return table("fixed_target", title, words, found, value_hits, shown)


def index_of(targets: np.ndarray, wanted: float) -> int:
    """Return the number of a target that is among them."""
    return int(np.flatnonzero(np.isclose(targets, wanted, rtol=1e-9, atol=0.0))[0])


def table(name: str, title: str, words: str, found: DataFrame, hits: np.ndarray, shown: dict[str, int]) -> Table:
    """Return a table of expected running times, one line a setting and variant."""
    rows = []
    keys = ["setting", "variant"]
    for key, own in found.reset_index(drop=True).groupby(keys, sort=False):
        places = own.index.to_numpy()
        row: dict[str, object] = dict(zip(keys, key, strict=True)) | {"n": len(places)}
        ert, successes = expected_running_time(hits[places], own["used"].to_numpy(float))
        for text, i in shown.items():
            row |= {f"ert {text}": ert[i], f"hits {text}": successes[i]}
            row[text] = f"{ert[i]:.0f} ({100 * successes[i] / len(places):.0f} %)"
        rows.append(row)
    first = (Column("setting", "noise"), Column("variant", "identifier"), Column("n", "runs", ".0f"))
    return Table(name, title, words, DataFrame(rows), (*first, *(Column(text, text) for text in shown)))


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
