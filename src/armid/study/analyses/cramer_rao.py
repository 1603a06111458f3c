"""Scatter of the estimates over noise realisations against its Cramer-Rao bound."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pandas import DataFrame

from armid.report.document import Column, Figure, Part, Table
from armid.report.style import legend_below, line_look, log_axis, mark_handles, marker_of, panels, row_names
from armid.study.analyses.analysis import N_RUNS, PARAMETER, SETTING, VARIANT, Analysis, Evidence

# A standard deviation within these, in units of the bound, is what an efficient estimate has.
EFFICIENT = (0.9, 1.1)
# Fewer noise realisations say too little about a standard deviation: its interval is +-30 % wide.
LEAST_REALISATIONS = 20
# Half the distance between the quartiles of a normal distribution, in standard deviations.
QUARTILE = 0.674489750196
# Ratios above it ask for a logarithmic axis.
LARGEST_LINEAR = 4.0
COLUMNS = (
    SETTING, VARIANT, Column("case", "case"), PARAMETER, N_RUNS, Column("ratio", "deviation/bound", ".3f"),
    Column("low", "95 % from", ".3f"), Column("high", "to", ".3f"), Column("robust", "from quartiles", ".3f"),
    Column("bias", "bias/bound", "+.3f"), Column("bias_half_width", "+-", ".3f"),
    Column("n_at_bound", "at a bound", ".0f"), Column("verdict", "0.9 to 1.1"),
)  # fmt: skip
SUMMARY_COLUMNS = (
    SETTING, VARIANT, PARAMETER, Column("n_cases", "cases", ".0f"), N_RUNS, Column("rms", "deviation/bound", ".3f"),
    Column("smallest", "smallest", ".3f"), Column("largest", "largest", ".3f"),
    Column("within", "cases in 0.9 to 1.1", ".0f"), Column("bias", "largest bias/bound", ".3f"),
)  # fmt: skip
SUMMARY_CAPTION = (
    "The table below in short: root mean square over the cases of deviation/bound, its smallest and largest, how many "
    "cases lie between 0.9 and 1.1, and the largest absolute bias/bound."
)
TABLE_CAPTION = (
    "deviation/bound: sample standard deviation over the noise realisations (seeds), divided by the Cramer-Rao bound "
    "at the solution, with its 95 % interval (chi-square); 1 is the best of an unbiased estimate. from quartiles: the"
    " same from the distance of the quartiles, which lost runs do not move. bias/bound: (mean - truth)/bound with the"
    " half width of its 95 % interval. Runs on a bound of the box make the ratio too small."
)
FIGURE_CAPTION = (
    "Standard deviation over the noise realisations divided by the Cramer-Rao bound, with its 95 % interval. The band"
    " spans 0.9 to 1.1; a mark is a case, a colour an identifier."
)
TITLE = "Scatter against the Cramer-Rao bound"


def parts(evidence: Evidence) -> Sequence[Part]:
    # seeds on one recorded noise are no noise realisations
    rows = efficiencies(evidence.estimates[evidence.estimates["noise_deg_s"] > 0.0])
    if rows.empty:
        return ()
    table = Table("cramer_rao", TITLE, TABLE_CAPTION, rows, COLUMNS)
    return summary(rows), table, Figure("cramer_rao", TITLE, FIGURE_CAPTION,
                                         lambda: cramer_rao_figure(rows, evidence.colours))  # fmt: skip


CRAMER_RAO = Analysis("cramer_rao", TITLE, parts, "standard deviation and bias over the Cramer-Rao bound")


def efficiency(values: ArrayLike, truth: float, bound: float) -> dict[str, float]:
    """Return scatter and bias of estimates under as many noise realisations, in units of the Cramer-Rao bound [SI].

    ratio = s/bound, from low to high, with s^2 = sum (x - mean)^2/(n - 1); robust: the same from the quartiles; bias:
    mean - truth. Intervals are of 95 %, that of the ratio from the chi-square distribution, exact for normal estimates.
    Source: Kay, Fundamentals of Statistical Signal Processing I, ch. 3.
    """
    from scipy.stats import chi2, t

    x = np.asarray(values, np.float64)
    free = x.size - 1
    s = x.std(ddof=1)
    low, high = np.sqrt(free / chi2.ppf([0.975, 0.025], free))
    quartiles = np.quantile(x, [0.25, 0.75])
    half_width = t.ppf(0.975, free) * s / np.sqrt(x.size)
    return {
        "n": x.size, "bound": bound, "ratio": s / bound, "low": s / bound * low, "high": s / bound * high,
        "robust": (quartiles[1] - quartiles[0]) / (2.0 * QUARTILE) / bound, "bias": (x.mean() - truth) / bound,
        "bias_half_width": half_width / bound,
    }  # fmt: skip


def efficiencies(estimates: DataFrame) -> DataFrame:
    """Return one row per setting, variant, case and parameter with a truth, a finite bound and enough realisations."""
    usable = estimates[np.isfinite(estimates["deviation"]) & (estimates["deviation"] > 0) & estimates["truth"].notna()]
    keys = ["setting", "variant", "case", "parameter"]
    rows = []
    for key, group in usable.groupby(keys, sort=False):
        if len(group) >= LEAST_REALISATIONS:
            bound, truth = float(group["deviation"].median()), float(group["truth"].iloc[0])
            statistics = efficiency(group["value"], truth, bound)
            verdict = "yes" if EFFICIENT[0] <= statistics["ratio"] <= EFFICIENT[1] else "no"
            more = {"n_at_bound": int(group["at_bound"].sum()), "verdict": verdict}
            rows.append(dict(zip(keys, key, strict=True)) | statistics | more)
    return DataFrame(rows)


def summary(rows: DataFrame) -> Table:
    keys = ["setting", "variant", "parameter"]
    marked = rows.assign(square=rows["ratio"] ** 2, size=rows["bias"].abs(), inside=rows["ratio"].between(*EFFICIENT))
    frame = marked.groupby(keys, sort=False).agg(
        n_cases=("case", "nunique"), n=("n", "sum"), square=("square", "mean"), smallest=("ratio", "min"),
        largest=("ratio", "max"), within=("inside", "sum"), bias=("size", "max"),
    ).reset_index()  # fmt: skip
    frame["rms"] = frame.pop("square") ** 0.5
    return Table("cramer_rao_summary", "Scatter against the bound, in short", SUMMARY_CAPTION, frame, SUMMARY_COLUMNS)


def cramer_rao_figure(rows: DataFrame, colours: Mapping[str, int]) -> Any:
    names, cases = (list(dict.fromkeys(rows[key])) for key in ("parameter", "case"))
    places = {group: i for i, group in enumerate(dict.fromkeys(zip(rows["variant"], rows["setting"], strict=True)))}
    figure, axes = panels(len(names), 2, 6.8, 1.6 + 0.5 * len(places))
    for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
        axis.axvspan(*EFFICIENT, color="0.88", lw=0, zorder=0)
        axis.axvline(1.0, color="0.4", lw=1.0, zorder=1)
        for k, case in enumerate(cases):
            own = rows[(rows["parameter"] == name) & (rows["case"] == case)]
            # the cases of a row a little apart from each other
            aside = 0.7 * ((k + 0.5) / len(cases) - 0.5)
            y = [places[group] + aside for group in zip(own["variant"], own["setting"], strict=True)]
            ratio, low, high = (own[key].to_numpy() for key in ("ratio", "low", "high"))
            look = [line_look(i)["color"] for i in own["variant"].map(colours)]
            axis.errorbar(ratio, y, xerr=[ratio - low, high - ratio], fmt="none", ecolor=look, elinewidth=1.4)
            axis.scatter(ratio, y, c=look, marker=marker_of(k), s=26, zorder=3)
        row_names(axis, i, [f"{v}\n{s}" for v, s in places])
        axis.set(ylim=(len(places) - 0.5, -0.5), xlabel=f"{name}: standard deviation / bound")
        if rows["high"].max() > LARGEST_LINEAR:
            log_axis(axis)
    legend_below(figure, min(8, len(cases)), mark_handles(cases))
    return figure
