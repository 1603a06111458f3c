"""The compact table: every identifier on one line."""

import numpy as np
from pandas import DataFrame

from armid.study.analyses.table import Column, Table

PAPER = "the paper's pso"


def overview(found: DataFrame, estimates: DataFrame, published: DataFrame) -> Table:
    """Return mean and median relative error of each parameter, and the tail of the largest, one line a variant.

    found: outcomes of runs; estimates: one row a run and parameter; published: the paper's values, empty without any.
    """
    names = list(dict.fromkeys(estimates["parameter"]))
    rows = [paper_row(published, names)] if len(published) else []
    by = ["setting", "variant"]
    groups = estimates.groupby([*by, "parameter"], sort=False)["relative_error"].agg(["mean", "median"])
    for key, group in found.groupby(by, sort=False):
        row = dict(zip(by, key, strict=True)) | counts(group) | tail(group["largest_error"].to_numpy())
        for name in names:
            there = (*key, name) in groups.index
            both = groups.loc[(*key, name)] if there else {"mean": np.nan, "median": np.nan}
            row |= {f"{name}_mean": both["mean"], f"{name}_median": both["median"]}
        rows.append(row)
    frame = DataFrame(rows)
    return Table(
        "overview", "Relative errors of all identifiers [%]", words(len(published) > 0), frame.sort_values(
            "setting", key=lambda s: s.map({v: i for i, v in enumerate(dict.fromkeys(s))}), kind="stable"
        ), columns(names),
    )  # fmt: skip


def counts(group: DataFrame) -> dict[str, int]:
    """Return how many runs there are, and how many of them failed."""
    return {"n": len(group), "n_failed_runs": int((group["status"] != "done").sum())}


def tail(errors: np.ndarray) -> dict[str, float]:
    """Return median, 95th percentile and worst of the largest error of a run; infinite where failed runs reach in."""
    middle, p95 = np.quantile(errors, [0.5, 0.95], method="inverted_cdf")
    return {"largest_median": float(middle), "largest_p95": float(p95), "largest_worst": float(errors.max())}


def paper_row(published: DataFrame, names: list[str]) -> dict[str, object]:
    """Return the paper's line: errors recomputed from its printed values."""
    errors = published.pivot(index="case", columns="parameter", values="relative_error")
    largest = errors.max(axis=1).to_numpy()
    row: dict[str, object] = {"setting": "", "variant": PAPER, "n": len(errors), "n_failed_runs": 0} | tail(largest)
    for name in names:
        if name in errors:
            row |= {f"{name}_mean": errors[name].mean(), f"{name}_median": errors[name].median()}
    return row


def columns(names: list[str]) -> tuple[Column, ...]:
    """Return what is shown."""
    of_names = [Column(f"{n}_{kind}", f"{n} {kind}", ".3g", 100.0) for n in names for kind in ("mean", "median")]
    ends = [Column(f"largest_{k}", f"largest {text}", ".3g", 100.0)
            for k, text in (("median", "median"), ("p95", "95 %"), ("worst", "worst"))]  # fmt: skip
    first = (Column("setting", "noise"), Column("variant", "identifier"), Column("n", "runs", ".0f"))
    return (*first, *of_names, *ends)


def words(with_paper: bool) -> str:
    """Return what the table says and how."""
    paper = (
        f" The line '{PAPER}' is computed from the values that the paper printed, one run a row, on its own data."
        if with_paper else ""
    )  # fmt: skip
    return (
        "Relative error abs(value - truth)/abs(truth) in %, mean and median over all finished runs (cases and seeds "
        "together). 'largest' is the largest error among the parameters of one run: its median, 95th percentile and "
        f"worst over the runs; a failed run counts as infinite there.{paper}"
    )


WORDS = (
    "One line a noise and identifier. budget, used: simulations of a run (median used); diverged: share of the used "
    "simulations that gave no finite record. failed: runs that ended in an error and hold no result. at a bound: runs "
    "of which at least one parameter ended on a bound of the box."
)


def runs(found: DataFrame, parameters: DataFrame) -> Table:
    """Return the counts. found: outcomes of runs; parameters: one row a run and parameter."""
    held = set(parameters.loc[parameters["at_bound"].astype(bool), "run"])
    marked = found.assign(done=found["status"] == "done", held=found["run"].isin(held))
    groups = marked.groupby(["setting", "variant"], sort=False)
    frame = groups.agg(
        n=("run", "size"), done=("done", "sum"), budget=("budget", "max"), used=("used", "median"),
        total=("used", "sum"), lost=("n_failed", "sum"), held=("held", "sum"),
    ).reset_index()  # fmt: skip
    frame["failed"] = frame["n"] - frame["done"]
    frame["diverged"] = frame["lost"] / frame["total"].where(frame["total"] > 0)
    columns = (
        Column("setting", "noise"), Column("variant", "identifier"), Column("n", "runs", ".0f"),
        Column("failed", "failed", ".0f"), Column("budget", "budget", ".0f"), Column("used", "used", ".0f"),
        Column("diverged", "diverged [%]", ".2g", 100.0), Column("held", "at a bound", ".0f"),
    )  # fmt: skip
    return Table("runs", "Runs", WORDS, frame, columns)


def reasons(found: DataFrame) -> Table:
    """Return why runs stopped, or failed, with counts."""
    failed = found["status"] != "done"
    reason = found["stopped"].where(~failed, "failed: " + found["error"].map(first_line))
    frame = found.assign(reason=reason).groupby(["variant", "reason"], sort=False).size().reset_index(name="n")
    columns = (Column("variant", "identifier"), Column("reason", "reason"), Column("n", "runs", ".0f"))
    return Table("reasons", "Why runs stopped", "Counted over all cases, noise levels and seeds.", frame, columns)


def first_line(text: str) -> str:
    """Return the beginning of an error."""
    line = str(text).strip().partition("\n")[0]
    return line if len(line) <= 120 else f"{line[:117]}..."
