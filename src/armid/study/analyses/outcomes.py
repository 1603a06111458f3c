"""The outcome of every run: who ran on what, and how far from the truth it ended."""

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from pandas import DataFrame, Series

from armid.study.outcome import RunTrace

NOISE_FREE = "noise-free"


def outcomes(runs: DataFrame, parameters: DataFrame) -> DataFrame:
    """Return the runs with `variant`, `setting` and `largest_error`.

    variant: label of the identifier, and the fitness where a label ran on several. setting: noise, and the window where
    the study has several. largest_error: max of abs(value - truth)/abs(truth) over the free parameters whose truth is
    known; infinite for a failed run, NaN where no truth is known.
    """
    found = runs.copy()
    found["variant"] = variants(runs)
    found["setting"] = settings(runs)
    found["largest_error"] = largest_errors(runs, parameters)
    return found


def variants(runs: DataFrame) -> Series:
    """Return the name under which a run is compared."""
    several = runs.groupby("identifier")["fitness"].transform("nunique") > 1
    return runs["identifier"].where(~several, runs["identifier"] + " on " + runs["fitness"])


def settings(runs: DataFrame) -> Series:
    """Return the noise, and the window where there are several."""
    noise = runs["noise_deg_s"].map(noise_text)
    return noise if runs["window"].nunique() < 2 else noise + ", " + runs["window"]


def noise_text(noise_deg_s: float) -> str:
    """Return a noise level in words; NaN is the noise that the records have of their own."""
    if np.isnan(noise_deg_s):
        return "as recorded"
    return NOISE_FREE if noise_deg_s == 0.0 else f"{noise_deg_s:g} deg/s"


def largest_errors(runs: DataFrame, parameters: DataFrame) -> Series:
    """Return the largest relative error of each run, in the order of the runs, 1 (not %)."""
    by_run = parameters.groupby("run", sort=False)["relative_error"].max()
    return runs["run"].map(by_run).where(runs["status"] == "done", np.inf).astype(float)


def truths_of(found: DataFrame, parameters: DataFrame) -> dict[str, dict[str, float]]:
    """Return case -> parameter -> truth [SI], of the truths that are known."""
    known = parameters[parameters["truth"].notna()].merge(found[["run", "case"]], on="run")
    rows = known.drop_duplicates(["case", "parameter"])
    truths: dict[str, dict[str, float]] = {}
    for case, parameter, truth in zip(rows["case"], rows["parameter"], rows["truth"], strict=True):
        truths.setdefault(str(case), {})[str(parameter)] = float(truth)
    return truths


def by_parameter(found: DataFrame, parameters: DataFrame) -> DataFrame:
    """Return one row a finished run and free parameter, with case, variant, setting and seed beside."""
    keys = found.loc[found["status"] == "done", ["run", "case", "variant", "setting", "seed", "fitness", "noise_deg_s"]]
    return keys.merge(parameters, on="run", how="inner", sort=False)


class Results(Protocol):
    """Stored results of a study: tidy frames, and the traces one by one."""

    @property
    def runs(self) -> DataFrame:
        """Return one row a run."""
        ...

    @property
    def parameters(self) -> DataFrame:
        """Return one row a run and free parameter."""
        ...

    @property
    def study(self) -> dict[str, Any]:
        """Return what was asked: name, question, cases, identifiers, numbers of runs."""
        ...

    def iter_traces(self) -> Iterator[RunTrace]:
        """Return the traces one after the other."""
        ...


def published_values(study: dict[str, Any]) -> DataFrame:
    """Return case, parameter, truth, published [SI] and relative error of the cases that carry a published result."""
    rows = []
    for case in study["cases"]:
        truth = case.get("truth") or {}
        for parameter, value in (case.get("published") or {}).items():
            true = float(truth.get(parameter, np.nan))
            rows.append((case["name"], parameter, true, float(value), abs(value - true) / abs(true)))
    return DataFrame(rows, columns=["case", "parameter", "truth", "published", "relative_error"])
