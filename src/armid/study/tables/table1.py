"""Table I of the paper beside ours: row by row, parameter by parameter."""

import numpy as np
from pandas import DataFrame

from armid.display import SHOWN
from armid.study.metrics import median_interval, percentile_among
from armid.study.tables.table import Column, Table

MEAN_ROW = "mean of the rows"
COLUMNS = (
    Column("case", "row"), Column("parameter", "parameter"), Column("unit", "unit"), Column("truth", "truth", ".4f"),
    Column("published", "paper", ".4f"), Column("median", "ours (median)", ".4f"),
    Column("published_error", "paper's error [%]", ".3f", 100.0),
    Column("error_of_median", "error of our median [%]", ".3g", 100.0),
    Column("median_error", "our median error [%]", ".3g", 100.0), Column("low", "95 % from [%]", ".3g", 100.0),
    Column("high", "to [%]", ".3g", 100.0), Column("mean_error", "our mean error [%]", ".3g", 100.0),
    Column("percentile", "paper's error lies at [percentile of ours]", ".0f"), Column("n", "runs", ".0f"),
)  # fmt: skip
WORDS = (
    "truth and paper: Table I as printed. ours: median over the seeds. Errors are abs(value - truth)/truth: of our "
    "median, and the median and mean over the seeds with a 95 % percentile bootstrap interval of the median (2000 "
    "resamples). The percentile says which share of our runs has a smaller error than the paper's value on that row "
    f"(equal ones by half): 90 means that nine in ten of our runs were better. The rows '{MEAN_ROW}' average over the "
    "rows: the paper's errors, the errors of our medians, our median errors, and our mean errors (which is the mean "
    "over rows and seeds). Ours is synthetic: simulated from the truth with the constants of an estimated arm, since "
    "the paper prints none."
)


def table1_rows(estimates: DataFrame, published: DataFrame) -> DataFrame:
    """Return one row per setting, variant, case and parameter, SI, and the mean over the cases.

    estimates: one row a run and parameter; published: the paper's values.
    """
    beside = published[["case", "parameter", "published", "relative_error"]]
    both = estimates.merge(beside.rename(columns={"relative_error": "published_error"}), on=["case", "parameter"])
    keys = ["setting", "variant", "case", "parameter"]
    frame = DataFrame([dict(zip(keys, k, strict=True)) | one_row(g) for k, g in both.groupby(keys, sort=False)])
    return frame if frame.empty else with_means(frame)


def one_row(group: DataFrame) -> dict[str, object]:
    """Return the numbers of one case and parameter."""
    errors = group["relative_error"].to_numpy(float)
    truth, published, published_error = group[["truth", "published", "published_error"]].to_numpy(float)[0]
    middle = float(group["value"].median())
    low, high = median_interval(errors)
    return {
        "unit": group["unit"].iloc[0], "n": len(group), "truth": truth, "published": published, "median": middle,
        "published_error": published_error, "error_of_median": abs(middle - truth) / abs(truth),
        "median_error": float(np.median(errors)), "low": low, "high": high, "mean_error": float(np.mean(errors)),
        "percentile": percentile_among(errors, published_error),
    }  # fmt: skip


def with_means(rows: DataFrame) -> DataFrame:
    """Return the rows with the mean over the cases after each variant's."""
    averaged = ["published_error", "error_of_median", "median_error", "mean_error"]
    keys = ["setting", "variant", "parameter"]
    means = rows.groupby(keys, sort=False)[averaged].mean().reset_index().assign(case=MEAN_ROW, unit="")
    means["n"] = rows.groupby(keys, sort=False)["n"].sum().to_numpy()
    both = [rows, means.reindex(columns=rows.columns).astype({"truth": float})]
    order = {key: i for i, key in enumerate(dict.fromkeys(zip(rows["setting"], rows["variant"], strict=True)))}
    frame = DataFrame([r for part in both for r in part.to_dict("records")], columns=rows.columns)
    place = [order[s, v] for s, v in zip(frame["setting"], frame["variant"], strict=True)]
    return frame.assign(_place=place).sort_values("_place", kind="stable", ignore_index=True).drop(columns="_place")


def table1(rows: DataFrame, setting: str, variant: str, name: str) -> Table:
    """Return the table of one variant under one setting, in the units that people read."""
    chosen = rows[(rows["setting"] == setting) & (rows["variant"] == variant)]
    return Table(name, f"Table I beside ours: {variant}, {setting}", WORDS, in_shown_units(chosen), COLUMNS)


def in_shown_units(rows: DataFrame) -> DataFrame:
    """Return the rows with pressures in MPa, as the paper prints them."""
    factor = rows["unit"].map(lambda u: SHOWN.get(u, (u, 1.0))[1])
    shown = {key: rows[key] * factor for key in ("truth", "published", "median")}
    return rows.assign(**shown, unit=rows["unit"].map(lambda u: SHOWN.get(u, (u, 1.0))[0]))


def table1_all(rows: DataFrame) -> Table:
    """Return every variant and setting in one table, for the CSV file."""
    both = (Column("setting", "noise"), Column("variant", "identifier"))
    title = "Table I beside ours: all identifiers"
    return Table("table1", title, WORDS, in_shown_units(rows), (*both, *COLUMNS), most=0)
