"""What was found, where no truth is known."""

from pandas import DataFrame

from armid.study.tables.table import Column, Table

WORDS = (
    "No truth is known. Median and population standard deviation of each parameter over all finished runs [SI], "
    "Cramer-Rao standard deviation at the solution (median), the errors of the result on the train and the holdout "
    "records (medians, in the unit of the signal), and runs of which the parameter ended on its bound."
)


def values(found: DataFrame, estimates: DataFrame) -> Table:
    """Return one line a setting, variant and parameter. found: outcomes; estimates: a row a run and parameter."""
    by = ["setting", "variant", "parameter", "unit"]
    joined = estimates.merge(found[["run", "train_rmse", "holdout_rmse"]], on="run")
    frame = joined.groupby(by, sort=False).agg(
        n=("run", "size"), median=("value", "median"), deviation=("value", lambda v: v.std(ddof=0)),
        bound=("deviation", "median"), train=("train_rmse", "median"), holdout=("holdout_rmse", "median"),
        n_at_bound=("at_bound", "sum"),
    ).reset_index()  # fmt: skip
    columns = (
        Column("setting", "noise"), Column("variant", "identifier"), Column("parameter", "parameter"),
        Column("unit", "unit"), Column("n", "runs", ".0f"), Column("median", "median", ".6g"),
        Column("deviation", "standard deviation", ".2g"), Column("bound", "Cramer-Rao", ".2g"),
        Column("train", "RMSE train", ".4g"), Column("holdout", "RMSE holdout", ".4g"),
        Column("n_at_bound", "at a bound", ".0f"),
    )  # fmt: skip
    return Table("values", "Parameters found", WORDS, frame, columns)
