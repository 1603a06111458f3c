"""A report: what is said, in order, before it becomes a page."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.analyses.drawing import Figure
from armid.study.analyses.histories import Histories, histories
from armid.study.analyses.outcomes import Results, by_parameter, outcomes, published_values, truths_of
from armid.study.analyses.ranks import RankTests, rank_tests
from armid.study.analyses.table import Table


@dataclass(frozen=True, eq=False)
class ReportSection:
    """Hold one heading with what stands under it."""

    title: str
    words: str = ""
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()


@dataclass(frozen=True, eq=False)
class Report:
    """Hold a whole report.

    question: what the study asks; state: how much of it was run, one sentence; facts: how it was made, one sentence
    each; main: the table that answers the question; sections: everything, the main table's first; answer: the answer in
    at most two sentences, empty where only the tables give one.
    """

    name: str
    question: str
    state: str
    facts: tuple[str, ...]
    main: Table
    sections: tuple[ReportSection, ...]
    answer: tuple[str, ...] = ()

    @property
    def tables(self) -> tuple[Table, ...]:
        """All tables in order."""
        return tuple(t for s in self.sections for t in s.tables)

    @property
    def figures(self) -> tuple[Figure, ...]:
        """All figures in order."""
        return tuple(f for s in self.sections for f in s.figures)


# Variants that a table of every row and parameter is printed for, beside the paper's own method.
MOST_OTHERS = 3


class Evidence:
    """Compute once what tables and figures share; the traces are read when a figure first asks for them."""

    def __init__(self, results: Results) -> None:
        self.results = results
        self.study: dict[str, Any] = results.study
        self.parameters: DataFrame = results.parameters
        self.found = ordered(outcomes(results.runs, self.parameters), self.study)
        self.estimates = by_parameter(self.found, self.parameters)

    @cached_property
    def variants(self) -> list[str]:
        """Names that are compared, in the order of the study."""
        return list(dict.fromkeys(self.found["variant"]))

    @cached_property
    def settings(self) -> list[str]:
        """Noise and window, in rising order."""
        return list(dict.fromkeys(self.found.sort_values(["noise_deg_s", "window"], kind="stable")["setting"]))

    @cached_property
    def cases(self) -> list[str]:
        """Cases that were run, in the order of the study."""
        there = set(self.found["case"])
        return [str(c["name"]) for c in self.study["cases"] if c["name"] in there]

    @cached_property
    def names(self) -> list[str]:
        """Parameters, in the order of the model."""
        return list(dict.fromkeys(self.parameters["parameter"]))

    @property
    def knows_truth(self) -> bool:
        """Whether any truth is known, so that errors exist."""
        return bool(self.parameters["truth"].notna().any())

    @cached_property
    def truths(self) -> dict[str, dict[str, float]]:
        """Case -> parameter -> truth, SI."""
        return truths_of(self.found, self.parameters)

    @cached_property
    def histories(self) -> Histories:
        """What the traces say."""
        return histories(self.results, self.found, self.truths)

    @cached_property
    def used(self) -> np.ndarray:
        """Simulations of each run, (n_runs,); a failed run, which tells none, counts its budget."""
        return self.found["used"].where(self.found["status"] == "done", self.found["budget"]).to_numpy(float)

    @cached_property
    def n_free(self) -> np.ndarray:
        """Number of free parameters of each run, (n_runs,); of a failed run that of its fellows."""
        counts = self.found["run"].map(self.parameters.groupby("run").size())
        return counts.fillna(counts.max() if counts.notna().any() else 1).to_numpy(np.int64)

    @cached_property
    def published(self) -> DataFrame:
        """Published values case by case, empty without any."""
        return published_values(self.study)

    @cached_property
    def order(self) -> dict[str, int]:
        """Variant -> number of its colour."""
        return {name: i for i, name in enumerate(self.variants)}

    @cached_property
    def best_first(self) -> list[str]:
        """Variants by the rank of their median largest error, mean over the settings; without truths as they come."""
        if not self.knows_truth:
            return self.variants
        medians = self.found.groupby(["variant", "setting"], sort=False)["largest_error"].median().unstack("setting")
        ranks = medians.rank().mean(axis=1)
        return [str(v) for v in ranks.sort_values(kind="stable").index]

    @cached_property
    def interesting(self) -> list[str]:
        """The paper's own swarm in every form that was run, then the best of the others."""
        own = [v for v in self.variants if v.startswith("pso") and "+" not in v]
        return own + [v for v in self.best_first if v not in own][:MOST_OTHERS]

    @cached_property
    def ranks(self) -> dict[str, RankTests]:
        """Setting -> rank tests over the cases."""
        return {s: rank_tests(self.of(s)) for s in self.settings}

    def of(self, setting: str) -> DataFrame:
        """Return the outcomes of one setting."""
        return self.found[self.found["setting"] == setting]

    def rows(self, setting: str, variant: str) -> np.ndarray:
        """Return which runs belong to a setting and a variant, (n_runs,)."""
        return ((self.found["setting"] == setting) & (self.found["variant"] == variant)).to_numpy()


def ordered(found: DataFrame, study: dict[str, Any]) -> DataFrame:
    """Return the runs in the order of the study: identifier, fitness, case, noise, window, seed.

    The store holds them in the order in which they ended, which two runners do not repeat.
    """
    label = {str(name): i for i, name in enumerate(study["identifiers"])}
    case = {str(c["name"]): i for i, c in enumerate(study["cases"])}
    keys = found.assign(_label=found["identifier"].map(label), _case=found["case"].map(case))
    by = ["_label", "identifier", "fitness", "_case", "case", "noise_deg_s", "window", "seed", "run"]
    return keys.sort_values(by, kind="stable", ignore_index=True).drop(columns=["_label", "_case"])
