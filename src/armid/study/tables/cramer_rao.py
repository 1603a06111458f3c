"""Scatter over the Cramer-Rao bound as a table."""

from pandas import DataFrame

from armid.study.metrics import EFFICIENT, efficiencies
from armid.study.tables.table import Column, Table

COLUMNS = (
    Column("setting", "noise"), Column("variant", "identifier"), Column("case", "case"),
    Column("parameter", "parameter"), Column("n", "runs", ".0f"), Column("ratio", "deviation/bound", ".3f"),
    Column("low", "95 % from", ".3f"), Column("high", "to", ".3f"), Column("robust", "from quartiles", ".3f"),
    Column("bias", "bias/bound", "+.3f"), Column("bias_half_width", "+-", ".3f"),
    Column("n_at_bound", "at a bound", ".0f"), Column("verdict", "0.9 to 1.1"),
)  # fmt: skip
SUMMARY_COLUMNS = (
    Column("setting", "noise"), Column("variant", "identifier"), Column("parameter", "parameter"),
    Column("n_cases", "cases", ".0f"), Column("n", "runs", ".0f"), Column("rms", "deviation/bound", ".3f"),
    Column("smallest", "smallest", ".3f"), Column("largest", "largest", ".3f"),
    Column("within", "cases in 0.9 to 1.1", ".0f"), Column("bias", "largest bias/bound", ".3f"),
)  # fmt: skip
SUMMARY_WORDS = (
    "The table below in short: root mean square over the cases of deviation/bound, its smallest and largest, how many "
    "cases lie between 0.9 and 1.1, and the largest absolute bias/bound."
)
WORDS = (
    "deviation/bound: sample standard deviation of the estimates over the noise realisations (seeds), divided by the "
    "Cramer-Rao bound (median over the runs of the bound at the solution); its 95 % interval from the chi-square "
    "distribution, right for normal estimates. 1 is the best that an unbiased estimate can do. from quartiles: the "
    "same ratio from the distance of the quartiles, which single lost runs do not move. bias/bound: (mean - "
    "truth)/bound with the half width of its 95 % interval. yes: the ratio lies between 0.9 and 1.1. Runs on a bound "
    "of the box make the ratio too small."
)


def cramer_rao(estimates: DataFrame) -> Table:
    """Return one line per setting, variant, case and parameter with at least 20 noise realisations."""
    frame = efficiencies(estimates)
    within = frame["ratio"].between(*EFFICIENT)
    verdict = within.map({True: "yes", False: "no"})
    return Table("cramer_rao", "Scatter against the Cramer-Rao bound", WORDS, frame.assign(verdict=verdict), COLUMNS)


def cramer_rao_summary(rows: DataFrame) -> Table:
    """Return one line per setting, variant and parameter. rows: of the table of every case."""
    keys = ["setting", "variant", "parameter"]
    marked = rows.assign(square=rows["ratio"] ** 2, size=rows["bias"].abs(), inside=rows["ratio"].between(*EFFICIENT))
    frame = marked.groupby(keys, sort=False).agg(
        n_cases=("case", "nunique"), n=("n", "sum"), square=("square", "mean"), smallest=("ratio", "min"),
        largest=("ratio", "max"), within=("inside", "sum"), bias=("size", "max"),
    ).reset_index()  # fmt: skip
    frame["rms"] = frame.pop("square") ** 0.5
    return Table("cramer_rao_summary", "Scatter against the bound, in short", SUMMARY_WORDS, frame, SUMMARY_COLUMNS)
