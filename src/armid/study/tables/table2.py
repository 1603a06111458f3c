"""Table II of the paper beside ours: how far repeated identifications scatter."""

import numpy as np
from pandas import DataFrame

from armid.display import SHOWN
from armid.study.metrics import spread
from armid.study.tables.table import Column, Table

PAPER = "the paper's pso"
COLUMNS = (
    Column("setting", "noise, window"), Column("variant", "identifier"), Column("parameter", "parameter"),
    Column("unit", "unit"), Column("truth", "truth", ".4f"), Column("n", "runs", ".0f"), Column("mean", "mean", ".4f"),
    Column("deviation", "standard deviation", ".2g"), Column("between", "between records", ".2g"),
    Column("within", "within a record", ".2g"), Column("bound", "Cramer-Rao", ".2g"), Column("low", "low", ".4g"),
    Column("high", "high", ".4g"), Column("n_at_bound", "at a bound", ".0f"),
)  # fmt: skip
IN_UNIT = ("truth", "mean", "deviation", "between", "within", "bound", "low", "high")
WORDS = (
    "mean and standard deviation: over all runs (records and repeats together); standard deviations are those of the "
    "population, sqrt(mean (x - mean)^2), which is what the paper calls mean square error. between records: of the "
    "means of the records, which the noise of the records makes; within a record: root mean square over the records "
    "of the deviation among repeats on the same record, which the search makes. Cramer-Rao: median over the runs of "
    "the bound at the solution for one record; where the misfit is far above the noise, the residual stands for the "
    "noise and makes it wider. low, high: the box; at a bound: runs that ended on it, where the box and not the record "
    "decides the value, and the other parameters scatter less than they would without it. The paper's lines are "
    "computed from its five printed identifications of a real arm; ours are of records whose truth is known (a test "
    "stand's, synthetic), so the two need not agree."
)


def table2(estimates: DataFrame, published: DataFrame) -> Table:
    """Return one row per setting, variant and parameter, the paper's first.

    estimates: one row a run and parameter, a case being a record; published: the paper's identification of each record,
    one row a record and parameter, SI.
    """
    units = dict(zip(estimates["parameter"], estimates["unit"], strict=True))
    box = estimates.drop_duplicates("parameter").set_index("parameter")[["low", "high"]]
    paper = published[published["parameter"].isin(units)].groupby("parameter", sort=False)["published"]
    rows = [paper_row(str(name), values.to_numpy(), box) for name, values in paper]
    keys = ["setting", "variant", "parameter"]
    rows += [dict(zip(keys, k, strict=True)) | one_row(g) for k, g in estimates.groupby(keys, sort=False)]
    frame = DataFrame(rows)
    factor = frame["parameter"].map(lambda p: SHOWN.get(units[p], ("", 1.0))[1])
    shown = {key: frame[key] * factor for key in IN_UNIT}
    frame = frame.assign(**shown, unit=frame["parameter"].map(lambda p: SHOWN.get(units[p], (units[p], 1.0))[0]))
    return Table("table2", "Table II beside ours", WORDS, frame[[c.key for c in COLUMNS]], COLUMNS)


def paper_row(name: str, values: np.ndarray, box: DataFrame) -> dict[str, object]:
    """Return the paper's line of one parameter; a value on the bound of our box, which is the paper's, is counted."""
    found = spread(values)
    low, high = box.loc[name, ["low", "high"]].to_numpy(float)
    at_bound = int(np.count_nonzero(np.isclose(values, low) | np.isclose(values, high)))
    return {
        "setting": "measured arm", "variant": PAPER, "parameter": name, "n": found.n, "mean": found.mean,
        "deviation": found.deviation, "low": low, "high": high, "n_at_bound": at_bound,
    }  # fmt: skip


def one_row(group: DataFrame) -> dict[str, object]:
    """Return the numbers of one setting, variant and parameter."""
    found = spread(group["value"])
    records = [spread(v) for _, v in group.groupby("case", sort=False)["value"]]
    truths = group["truth"].dropna().unique()
    return {
        "truth": float(truths[0]) if truths.size == 1 else np.nan, "n": found.n, "mean": found.mean,
        "deviation": found.deviation, "between": spread([r.mean for r in records]).deviation,
        "within": float(np.sqrt(np.mean([r.deviation**2 for r in records]))), "bound": group["deviation"].median(),
        "low": group["low"].iloc[0], "high": group["high"].iloc[0], "n_at_bound": int(group["at_bound"].sum()),
    }  # fmt: skip


def table2_records(estimates: DataFrame) -> Table:
    """Return mean, deviation and bound of each record, SI, for the CSV file."""
    keys = ["setting", "variant", "case", "parameter", "unit"]
    rows = [
        dict(zip(keys, k, strict=True)) | spread(g["value"])._asdict()
        | {"bound": g["deviation"].median(), "n_at_bound": int(g["at_bound"].sum())}
        for k, g in estimates.groupby(keys, sort=False)
    ]  # fmt: skip
    columns = (*(Column(k, k) for k in keys), *(Column(k, k, ".6g") for k in ("n", "mean", "deviation", "bound")))
    return Table("table2_records", "Table II, record by record", WORDS, DataFrame(rows), columns, most=0)
