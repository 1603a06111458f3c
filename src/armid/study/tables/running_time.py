"""Expected running times as tables: to errors of the parameters, and to shares of the way to the best fitness."""

import numpy as np
from pandas import DataFrame

from armid.study.metrics import ERROR_TARGETS, SHARES_LEFT, TOLERANCES, VALUE_TARGETS, expected_running_time
from armid.study.tables.table import Column, Table

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
