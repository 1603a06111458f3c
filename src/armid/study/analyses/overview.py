"""The table that answers a study's question: every identifier on one line, or every campaign of closed loops.

Also the last table of every report: what was run, and why runs stopped.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pandas import DataFrame, Series, concat, factorize

from armid.report.document import Column, Table
from armid.study.analyses.analysis import N_RUNS, PAPER, PARAMETER, SETTING, VARIANT, Analysis, Evidence
from armid.units import scale_of

OVERVIEW_CAPTION = (
    "Relative error abs(value - truth)/abs(truth) in %, mean and median over all finished runs; simulations: median "
    "of a run. 'largest' is the largest error among the parameters of one run: its median, 95th percentile and worst "
    "over the runs, where a failed run counts as infinite."
)
PAPER_CAPTION = (
    f" The line '{PAPER}' is computed from the values that the paper printed, one run a row, on its own data."
)
VALUES_CAPTION = (
    "Median and population standard deviation of each parameter over all finished runs. Cramer-Rao, RMSE: medians at "
    "the solution; at a bound: runs whose parameter ended on its bound."
)
RUNS_CAPTION = (
    "used: simulations of a run, median; diverged: share of these that gave no finite record. failed: runs without a "
    "result; at a bound: runs that ended with a parameter on a bound of the box."
)
VALUES_COLUMNS = (
    SETTING, VARIANT, PARAMETER, Column("unit", "unit"), N_RUNS, Column("median", "median", ".6g"),
    Column("deviation", "standard deviation", ".2g"), Column("bound", "Cramer-Rao", ".2g"),
    Column("train", "RMSE train", ".4g"), Column("holdout", "RMSE holdout", ".4g"),
    Column("n_at_bound", "at a bound", ".0f"),
)  # fmt: skip
RUNS_COLUMNS = (
    SETTING, VARIANT, N_RUNS, Column("failed", "failed", ".0f"), Column("budget", "budget", ".0f"),
    Column("used", "used", ".0f"), Column("diverged", "diverged [%]", ".2g", 100.0),
    Column("held", "at a bound", ".0f"),
)  # fmt: skip


def main_table(evidence: Evidence) -> Table:
    if not evidence.knows_truth:
        return values(evidence.runs, evidence.estimates, evidence.unit)
    is_table1 = evidence.study.get("report") == "table1"
    return overview(evidence.runs, evidence.estimates, evidence.published if is_table1 else evidence.published[:0])


OVERVIEW = Analysis("overview", "Overview", lambda evidence: (main_table(evidence),),
                    "errors of all identifiers, without truths their values")  # fmt: skip
RUNS_ANALYSIS = Analysis("runs", "Runs", lambda evidence: (
    runs_table(evidence.runs, evidence.parameters), reasons(evidence.runs),
), "what was run, and why runs stopped")  # fmt: skip


def overview(runs: DataFrame, estimates: DataFrame, published: DataFrame) -> Table:
    """Return mean and median relative error of each parameter, and the tail of the largest, one line a variant."""
    names, by = list(dict.fromkeys(estimates["parameter"])), ["setting", "variant"]
    if len(published):
        # the paper's rows are runs of one identifier more
        paper = published.assign(setting="", variant=PAPER)
        largest = paper.groupby(["case", *by], sort=False)["relative_error"].max().rename("largest_error").reset_index()
        runs = concat([largest.assign(status="done", used=np.nan), runs])
        estimates = concat([paper, estimates])
    of_each = estimates.groupby([*by, "parameter"], sort=False)["relative_error"].agg(["mean", "median"]).unstack()
    frame = runs.groupby(by, sort=False).agg(
        n=("status", "size"), n_failed_runs=("status", lambda s: int((s != "done").sum())), used=("used", "median"),
        largest_median=("largest_error", lambda e: e.median(skipna=False)),
        largest_p95=("largest_error", lambda e: np.quantile(e, 0.95, method="inverted_cdf")),
        largest_worst=("largest_error", lambda e: e.max(skipna=False)),
    )  # fmt: skip
    frame = frame.assign(**{f"{name}_{kind}": of_each[kind, name] for name in names for kind in ("mean", "median")})
    # rows of a setting stand together, settings in the order of their first row
    frame = frame.reset_index().sort_values("setting", key=lambda s: Series(factorize(s)[0], s.index), kind="stable")
    columns = [Column("used", "simulations", ",.0f")]
    columns += [Column(f"largest_{key}", f"largest {text}", ".3g", 100.0)
                for key, text in (("median", "median"), ("worst", "worst"), ("p95", "95 %"))]  # fmt: skip
    columns += [N_RUNS] + [Column(f"{n}_{kind}", f"{n} {kind}", ".3g", 100.0)
                           for n in names for kind in ("median", "mean")]  # fmt: skip
    caption = OVERVIEW_CAPTION + (PAPER_CAPTION if len(published) else "")
    return Table("overview", "Relative errors of all identifiers [%]", caption, frame,
                 (SETTING, VARIANT, *columns), grouped=True)  # fmt: skip


def values(runs: DataFrame, estimates: DataFrame, unit: str) -> Table:
    """Return what the parameters are, in units that people read; unit: of the records, SI."""
    joined = estimates.merge(runs[["run", "train_rmse", "holdout_rmse"]], on="run")
    frame = joined.groupby(["setting", "variant", "parameter", "unit"], sort=False).agg(
        n=("run", "size"), median=("value", "median"), deviation=("value", lambda v: v.std(ddof=0)),
        bound=("deviation", "median"), train=("train_rmse", "median"), holdout=("holdout_rmse", "median"),
        n_at_bound=("at_bound", "sum"),
    ).reset_index()  # fmt: skip
    scales, (signal, factor) = list(map(scale_of, frame["unit"], frame["median"])), scale_of(unit)
    frame = frame.assign(unit=[name for name, _ in scales], **{
        key: frame[key] * [scale for _, scale in scales] for key in ("median", "deviation", "bound")
    })  # fmt: skip
    columns = tuple(replace(c, header=f"{c.header} [{signal}]", factor=factor) if c.key in ("train", "holdout") else c
                    for c in VALUES_COLUMNS)  # fmt: skip
    return Table("values", "Parameters found", VALUES_CAPTION, frame, columns, grouped=True)


def runs_table(runs: DataFrame, parameters: DataFrame) -> Table:
    held = set(parameters.loc[parameters["at_bound"].astype(bool), "run"])
    marked = runs.assign(done=runs["status"] == "done", held=runs["run"].isin(held))
    frame = marked.groupby(["setting", "variant"], sort=False).agg(
        n=("run", "size"), done=("done", "sum"), budget=("budget", "max"), used=("used", "median"),
        total=("used", "sum"), lost=("n_failed", "sum"), held=("held", "sum"),
    ).reset_index()  # fmt: skip
    frame["failed"] = frame["n"] - frame["done"]
    frame["diverged"] = frame["lost"] / frame["total"].where(frame["total"] > 0)
    return Table("runs", "Runs", RUNS_CAPTION, frame, RUNS_COLUMNS)


def reasons(runs: DataFrame) -> Table:
    failed = runs["status"] != "done"
    reason = runs["stopped"].where(~failed, "failed: " + runs["error"].map(first_line))
    frame = runs.assign(reason=reason).groupby(["variant", "reason"], sort=False).size().reset_index(name="n")
    columns = (VARIANT, Column("reason", "reason"), N_RUNS)
    return Table("reasons", "Why runs stopped", "Counted over all cases, noise levels and seeds.", frame, columns)


def first_line(text: str) -> str:
    line = str(text).strip().partition("\n")[0]
    return line if len(line) <= 120 else f"{line[:117]}..."


VERDICTS_CAPTION = "Campaigns by verdict and by what was added to the declared model."
CAMPAIGNS_CAPTION = (
    "Error on the records held out: RMSE over the rms noise of the campaign, before and after the effects were added "
    "to the declared model; 1 where only noise is left, empty without such records. CPU: processor time of the loop."
)
VERDICTS_COLUMNS = Column("verdict", "verdict"), Column("effects", "effects"), Column("n", "campaigns", ".0f")
CAMPAIGNS_COLUMNS = (
    Column("case", "campaign"), Column("verdict", "verdict"), Column("effects", "effects"),
    Column("before", "held-out error before [noise]", ".3f"), Column("after", "after [noise]", ".3f"),
    Column("cpu_seconds", "CPU [s]", ".1f"),
)  # fmt: skip


def loop_runs(loops: DataFrame) -> DataFrame:
    """Return one row a campaign that was closed: verdict, effects, error on the records held out over the noise."""
    reports = loops["report"]
    runs = loops[["case", "verdict"]].assign(
        plant=[report["plant"] for report in reports],
        effects=[" + ".join(report["effects"]) or "nothing" for report in reports],
        before=[over_noise(report, "before") for report in reports],
        after=[over_noise(report, "after") for report in reports],
    )
    return runs.join(loops[["cpu_seconds", "seconds"]])


def over_noise(report: Mapping[str, Any], when: str) -> float:
    error = report["error"][when]["holdout"]
    return np.nan if error is None else float(error["rmse"] / report["noise_rms"])


def verdicts(runs: DataFrame) -> Table:
    frame = runs.groupby(["verdict", "effects"]).size().rename("n").reset_index()
    return Table("verdicts", "What was found", VERDICTS_CAPTION, frame, VERDICTS_COLUMNS, grouped=True)


def campaigns(runs: DataFrame) -> Table:
    return Table("campaigns", "Campaigns", CAMPAIGNS_CAPTION, runs, CAMPAIGNS_COLUMNS)


def counted(runs: DataFrame) -> str:
    if runs.empty:
        return "No campaign was closed."
    counts = [f"{n} {str(verdict).replace('_', ' ')}" for verdict, n in runs["verdict"].value_counts().items()]
    return f"Of {len(runs)} campaigns: {', '.join(counts)}."
