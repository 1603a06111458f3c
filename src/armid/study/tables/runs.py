"""What was run: counts, simulations, failures, reasons to stop."""

from pandas import DataFrame

from armid.study.tables.table import Column, Table

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
