"""Closed loops: what was found on each campaign of a study that closes the loop, without any truth."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.report.document import Column, Table

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
