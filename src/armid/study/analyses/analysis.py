"""What an analysis is, and what it is given: the runs of a study with their truths, names and settings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame, Series

from armid.model import Array
from armid.problem.fitness import FITNESS
from armid.report.document import Column, Part, Table
from armid.study.results import StudyResults
from armid.study.spec import NOISES
from armid.study.store import ON, RunTrace
from armid.units import scale_of

Small = NDArray[np.float32]
P = TypeVar("P", bound=Part)
T = TypeVar("T")
# 51 targets, as COCO takes, five a decade: largest relative errors of the parameters from 100 % to 1e-8 %, and shares
# of the way from a first candidate to the best fitness that anyone found.
TARGETS = 10.0 ** (-np.arange(51) / 5.0)
N_OF_CURVE = 61


@dataclass(frozen=True, eq=False)
class Histories:
    """What the traces say, one row a run in the order of the outcomes; shapes (n_runs, n_targets) and (n_runs, n_grid).

    grid: simulations. error_hits: first hits of TARGETS by the largest relative error, value_hits: by the share of the
    way to the best known fitness, infinite for never. errors, values: of the best so far, infinite before the first.
    """

    grid: NDArray[np.int64]
    error_hits: Small
    value_hits: Small
    errors: Small
    values: Small


def histories(
    results: StudyResults, runs: DataFrame, truths: Mapping[str, Mapping[str, float]], floors: Mapping[str, float]
) -> Histories:
    """Read the traces twice, one run at a time: for the first values, then for everything that depends on them.

    Only first hits and values on a common grid are kept, so that the memory does not grow with the traces.
    """
    # from 1 to the most simulations of a run, evenly spread in the logarithm
    most = max(int(runs["used"].max()) if len(runs) else 1, 1)
    grid = np.unique(np.round(np.geomspace(1, most, N_OF_CURVE)).astype(np.int64))
    place = {run: i for i, run in enumerate(runs["run"])}
    firsts = np.full(len(place), np.nan)
    for trace in results.iter_traces():
        if trace.run in place and trace.values.size:
            firsts[place[trace.run]] = trace.values[0]
    # the way of a run starts at the median of the first values of all runs on the same case, setting and fitness, and
    # ends at the best fitness that any of them found with the same seed, that is on the same noise, or at the truth's
    problem = ["case", "setting", "fitness"]
    starts = runs.assign(first=firsts).groupby(problem)["first"].transform("median").to_numpy()
    minima = runs.groupby([*problem, "seed"])["value"].transform("min")
    bests = runs["case"].map(floors).astype(float).fillna(minima).to_numpy()
    cases = runs["case"].to_numpy()
    kept = Histories(grid, *(np.full((len(place), n), np.inf, np.float32)
                             for n in (TARGETS.size, TARGETS.size, grid.size, grid.size)))  # fmt: skip
    for trace in results.iter_traces():
        i = place.get(trace.run)
        if i is None or not trace.evaluations.size:
            continue
        errors = trace_errors(trace, truths.get(str(cases[i]), {}))
        shares = remaining_share(trace.values, starts[i], bests[i])
        kept.error_hits[i] = first_hits(trace.evaluations, errors, TARGETS)
        kept.value_hits[i] = first_hits(trace.evaluations, shares, TARGETS)
        kept.errors[i] = held(trace.evaluations, errors, grid)
        kept.values[i] = held(trace.evaluations, trace.values, grid)
    return kept


def first_hits(evaluations: NDArray[np.int64], distances: Array, targets: Array) -> Array:
    """Return the evaluation at which a trace is first at each target or below, infinite where it never is.

    The distance may rise again: an improvement of the fitness need not be one of the parameters.
    Source: Hansen et al., COCO: performance assessment, arXiv:1605.03560.
    """
    lowest = np.minimum.accumulate(np.where(np.isnan(distances), np.inf, distances))
    place = np.searchsorted(-lowest, -targets, side="left")
    return np.append(evaluations.astype(np.float64), np.inf)[place]


def held(evaluations: NDArray[np.int64], quantity: Array, grid: NDArray[np.int64]) -> Array:
    """Return a quantity of the best candidate so far on a grid of evaluations, infinite before the first."""
    place = np.searchsorted(evaluations, grid, side="right")
    return np.append(np.inf, quantity)[place]


def remaining_share(values: Array, first: float, best: float) -> Array:
    """Return how much of the way from a first value to the best known is left: (f - f_L)/(f_0 - f_L), 1 at the first.

    Source: More and Wild, SIAM J. Optim. 20 (2009) 172, Eq. 2.2.
    """
    if not first > best:
        return np.where(values <= best, 0.0, np.inf)
    return (values - best) / (first - best)


def trace_errors(trace: RunTrace, truth: Mapping[str, float]) -> Array:
    """Return the largest relative error of each candidate over the parameters with a truth, NaN without any."""
    true = np.array([truth.get(name, np.nan) for name in trace.names])
    known = ~np.isnan(trace.X[-1]) & ~np.isnan(true)
    if not known.any():
        return np.full(trace.evaluations.size, np.nan)
    return np.asarray(np.max(np.abs(trace.X[:, known] - true[known]) / np.abs(true[known]), axis=1))


WITHOUT_NOISE, SPEED_UNIT = "noise-free", "rad/s"
PAPER = "the paper's pso"
# Variants that a table of every row and parameter is printed for, with the paper's own method.
MOST_OTHERS = 3
# What a setting is made of.
SETTINGS_APART = ("noise", "window", "budget")
# The columns by which most tables tell their rows apart.
SETTING, VARIANT = Column("setting", "noise"), Column("variant", "identifier")
# The same column in a report of a suite, where budgets take the place of noise levels.
BUDGET_COLUMN = Column("setting", "budget")
PARAMETER, N_RUNS = Column("parameter", "parameter"), Column("n", "runs", ".0f")


@dataclass(frozen=True)
class Analysis:
    """One section of the report of a study, and a line of `armid list analyses`; nothing where it has no parts."""

    name: str
    title: str
    parts: Callable[["Evidence"], Sequence[Part]]
    note: str
    applies: Callable[["Evidence"], bool] = lambda evidence: True


class Evidence:
    """Compute once what several analyses share; the traces are read when one of them first asks.

    runs: outcomes, one row a run, in the order of the study. parameters: one row a run and free parameter. estimates:
    the same of finished runs, with case, variant, setting, seed, fitness and noise added.
    """

    def __init__(self, results: StudyResults) -> None:
        self.results = results
        self._made: dict[Any, Any] = {}
        self.study: dict[str, Any] = results.study
        self.parameters: DataFrame = results.parameters
        self.unit = unit_of(self.study)
        self.runs = ordered(outcomes(results.runs, self.parameters, self.unit), self.study)
        budgets = Series("", index=self.runs.index)
        if self.study.get("budget_per_parameter"):
            budgets = Series(budget_texts(self.runs, self.study), index=self.runs.index)
            as_recorded = self.runs["noise_deg_s"].isna()
            self.runs["setting"] = budgets.where(as_recorded, self.runs["setting"] + ", " + budgets)
        elif (self.runs.groupby(["identifier", "case"])["budget"].nunique() > 1).any():
            budgets = self.runs["budget"].map("{:,}".format)
            self.runs["setting"] += ", " + budgets + " simulations"
        noise = self.runs["noise_deg_s"].map(partial(noise_text, unit=self.unit))
        runs = self.runs.assign(noise=noise, budget=budgets)
        self._apart = runs.drop_duplicates("setting").set_index("setting")[list(SETTINGS_APART)]
        keys = ["run", "case", "variant", "setting", "seed", "fitness", "noise_deg_s"]
        done = self.runs.loc[self.runs["status"] == "done", keys]
        self.estimates = done.merge(self.parameters, on="run", how="inner", sort=False)

    def apart(self, part: P) -> P:
        """Return a table in which noise, window and budget have columns of their own, as far as they differ."""
        keys = [key for key in SETTINGS_APART if self._apart[key].nunique() > 1]
        if not isinstance(part, Table) or not isinstance(part.frame, DataFrame) or not keys:
            return part
        place = next((i for i, column in enumerate(part.columns) if column.key == "setting"), None)
        if place is None:
            return part
        settings = part.frame["setting"]
        columns = {f"setting_{key}": settings.map(self._apart[key]).fillna("") for key in keys}
        # a row of no run of ours, such as the paper's, says itself where it comes from
        columns[f"setting_{keys[0]}"] += settings.where(~settings.isin(self._apart.index), "")
        own = tuple(Column(f"setting_{key}", key) for key in keys)
        kept = (*part.columns[:place], *own, *part.columns[place + 1 :])
        return replace(part, frame=part.frame.assign(**columns), columns=kept)

    @property
    def is_suite(self) -> bool:
        """Whether every case is a problem of the suite, each with a class of difficulty."""
        return all("difficulty" in case for case in self.study["cases"])

    @cached_property
    def variants(self) -> list[str]:
        return list(dict.fromkeys(self.runs["variant"]))

    @cached_property
    def settings(self) -> list[str]:
        """Noise and window, in rising order."""
        return list(dict.fromkeys(self.runs.sort_values(["noise_deg_s", "window", "budget"], kind="stable")["setting"]))

    @cached_property
    def cases(self) -> list[str]:
        names = set(self.runs["case"])
        return [str(c["name"]) for c in self.study["cases"] if c["name"] in names]

    @property
    def knows_truth(self) -> bool:
        return bool(self.parameters["truth"].notna().any())

    @property
    def has_results(self) -> bool:
        return not self.parameters.empty

    @cached_property
    def groups(self) -> dict[str, dict[str, NDArray[np.intp]]]:
        rows = self.runs.groupby(["setting", "variant"], sort=False).indices
        return {s: {v: np.asarray(rows[s, v]) for v in self.variants if (s, v) in rows} for s in self.settings}

    @cached_property
    def histories(self) -> Histories:
        truths = {str(case["name"]): case.get("truth") or {} for case in self.study["cases"]}
        floors = {str(case["name"]): float(case["floor"]) for case in self.study["cases"] if "floor" in case}
        return histories(self.results, self.runs, truths, floors)

    @cached_property
    def used(self) -> NDArray[np.float64]:
        """Simulations of each run, (n_runs,); a failed run, which reports none, counts its budget."""
        return self.runs["used"].where(self.runs["status"] == "done", self.runs["budget"]).to_numpy(float)

    @cached_property
    def n_free(self) -> NDArray[np.integer[Any]]:
        """Number of free parameters of each run, (n_runs,); of a failed run the largest of the others."""
        counts = self.runs["run"].map(self.parameters.groupby("run").size())
        return counts.fillna(counts.max() if counts.notna().any() else 1).to_numpy(np.int64)

    @cached_property
    def published(self) -> DataFrame:
        """Values of the paper with their relative errors, one row a case and parameter."""
        rows = []
        for case in self.study["cases"]:
            truth = case.get("truth") or {}
            for parameter, value in (case.get("published") or {}).items():
                true = float(truth.get(parameter, np.nan))
                rows.append((case["name"], parameter, true, float(value), abs(value - true) / abs(true)))
        return DataFrame(rows, columns=["case", "parameter", "truth", "published", "relative_error"])

    @cached_property
    def colours(self) -> dict[str, int]:
        """Variant -> number of its colour, the same in all figures: those of plug-ins first, then the best."""
        return {name: i for i, name in enumerate(dict.fromkeys([*self.own, *self.best_first]))}

    @cached_property
    def own(self) -> list[str]:
        """Variants of identifiers that the reader brought as plug-ins."""
        names = [str(plugin).rpartition(":")[2] for plugin in self.study.get("plugins", ())]
        return [v for v in self.variants if any(v == n or v.startswith((f"{n} ", f"{n}+")) for n in names)]

    @cached_property
    def best_first(self) -> list[str]:
        """Variants by the rank of their median largest error, mean over the settings; without truths as they come."""
        if not self.knows_truth:
            return self.variants
        medians = self.runs.groupby(["variant", "setting"], sort=False)["largest_error"].median().unstack("setting")
        ranks = medians.rank().mean(axis=1)
        return [str(v) for v in ranks.sort_values(kind="stable").index]

    @cached_property
    def interesting(self) -> list[str]:
        """The paper's own swarm in every form that was run, then the best of the others."""
        own = [v for v in self.variants if is_swarm(v)]
        return own + [v for v in self.best_first if v not in own][:MOST_OTHERS]

    def scale_of_fitness(self, name: str) -> tuple[str, float]:
        """Return the unit of a fitness as it is written behind its name, and its factor from SI."""
        if name not in FITNESS or FITNESS[name].unit != "signal":
            return "", 1.0
        unit, factor = scale_of(self.unit)
        return f" [{unit}]", factor

    def of(self, setting: str) -> DataFrame:
        return self.runs[self.runs["setting"] == setting]

    def once(self, make: Callable[["Evidence", str], T], setting: str) -> T:
        """Return what a function makes of the runs at a setting; section and answer share it."""
        if (make, setting) not in self._made:
            self._made[make, setting] = make(self, setting)
        outcome: T = self._made[make, setting]
        return outcome


def is_swarm(variant: str) -> bool:
    """Tell whether a variant is the paper's swarm, in whatever form and with nothing after it."""
    return variant.startswith("pso") and "+" not in variant


def wide_runs(evidence: Evidence) -> DataFrame:
    """Return one row a run with its parameters: what an analysis of a user is given.

    ==================================  ==========================================================================
    study, run                          names of the study and of the run
    case, identifier, fitness           what was identified, who searched, what was minimised
    noise_deg_s, window, seed           noise that the study added (NaN: records' own), part of the motion
    variant, setting                    identifier (with its fitness where it ran on several); noise in words
    status, error, stopped              "done" or "failed" and why; why the search stopped
    budget, used, n_failed              simulations: allowed, used, diverged
    value                               best fitness
    train_rmse, holdout_rmse            errors of the result, SI
    train_s, train_s1, train_s2         similarity degrees of the result
    seconds                             duration
    largest_error                       largest relative error of a parameter; inf: failed, NaN: truth not known
    NAME                                value of each free parameter, SI
    NAME_truth, NAME_error              its truth, and abs(value - truth)/abs(truth), NaN where it is not known
    NAME_deviation, NAME_at_bound       its Cramer-Rao standard deviation; whether it ended on its bound
    ==================================  ==========================================================================
    """
    columns = {"value": "", "truth": "_truth", "relative_error": "_error", "deviation": "_deviation",
               "at_bound": "_at_bound"}  # fmt: skip
    wide = evidence.runs.drop(columns=["started_at", "model", "versions"], errors="ignore")
    wide = wide.rename(columns={"noise_deg_s": f"noise_{NOISES.get(evidence.unit, NOISES[SPEED_UNIT])}"})
    wide.insert(0, "study", str(evidence.study["name"]))
    values: dict[str, Series[Any]] = {}
    for name, rows in evidence.parameters.groupby("parameter", sort=False):
        own = rows.set_index("run")
        values |= {f"{name}{end}": wide["run"].map(own[key]) for key, end in columns.items()}
    # at once: column by column, those of 40 parameters leave a table in pieces
    return wide.join(DataFrame(values, index=wide.index))


def unit_of(study: dict[str, Any]) -> str:
    """Return the unit of the records of a study, SI; older ones do not tell it."""
    return str(study.get("unit", SPEED_UNIT))


def outcomes(runs: DataFrame, parameters: DataFrame, unit: str) -> DataFrame:
    """Return the runs with `variant`, `setting` (noise, and the window of several) and `largest_error`.

    variant: label of the identifier, and the fitness where a label ran on several. largest_error: relative, over the
    free parameters whose truth is known; infinite for a failed run, NaN where no truth is known. unit: of the records.
    """
    on_a_case = runs.groupby(["identifier", "case"])["fitness"].transform("nunique")
    several = on_a_case.groupby(runs["identifier"]).transform("max") > 1
    noise = runs["noise_deg_s"].map(partial(noise_text, unit=unit))
    largest = runs["run"].map(parameters.groupby("run", sort=False)["relative_error"].max())
    return runs.assign(
        variant=runs["identifier"].where(~several, runs["identifier"] + ON + runs["fitness"]),
        setting=noise if runs["window"].nunique() < 2 else noise + ", " + runs["window"],
        largest_error=largest.where(runs["status"] == "done", np.inf).astype(float),
    )


def budget_texts(runs: DataFrame, study: dict[str, Any]) -> list[str]:
    """Return the budget of each run in simulations a free parameter; one that was cut counts as the next larger."""
    n_free = runs["case"].map({case["name"]: len(case["bounds"]) for case in study["cases"]})
    known = study["budget_per_parameter"]
    factors = [next((m for m in known if m * n >= b), known[-1]) for n, b in zip(n_free, runs["budget"], strict=True)]
    cut = (runs["budget"] < n_free * factors).to_numpy()
    most = {m: f", at most {b:,}" for m, b, is_cut in zip(factors, runs["budget"], cut, strict=True) if is_cut}
    return [f"{factor} D{most.get(factor, '')}" for factor in factors]


def noise_text(level: float, unit: str) -> str:
    """Return a level of noise in words; unit: of the records, SI."""
    if np.isnan(level):
        return "as recorded"
    return WITHOUT_NOISE if level == 0.0 else f"{level:g} {NOISES[unit].replace('_s', '/s')}"


def ordered(runs: DataFrame, study: dict[str, Any]) -> DataFrame:
    """Return the runs in the order of the study; the store holds them in the order in which they ended."""
    label = {str(name): i for i, name in enumerate(study["identifiers"])}
    case = {str(c["name"]): i for i, c in enumerate(study["cases"])}
    keys = runs.assign(_label=runs["identifier"].map(label), _case=runs["case"].map(case))
    by = ["_label", "identifier", "fitness", "_case", "case", "noise_deg_s", "window", "budget", "seed", "run"]
    return keys.sort_values(by, kind="stable", ignore_index=True).drop(columns=["_label", "_case"])


def every_nth(rows: DataFrame, most: int) -> DataFrame:
    return rows.iloc[:: max(1, -(-len(rows) // most))]
