"""How the scatter of an estimate compares with the Cramer-Rao bound."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pandas import DataFrame

from armid.study.analyses.drawing import COLOURS, MARKERS, panels
from armid.study.analyses.table import Column, Table

Array = NDArray[np.float64]
# A standard deviation within these is what an efficient estimate has.
EFFICIENT = (0.9, 1.1)
# Fewer noise realisations say too little about a standard deviation: its interval is +-30 % wide.
LEAST_REALISATIONS = 20
# Half the distance between the quartiles of a normal distribution, in standard deviations.
QUARTILE = 0.674489750196


class Efficiency(NamedTuple):
    """Scatter and bias over the bound.

    n: noise realisations; bound: Cramer-Rao standard deviation, SI; ratio: sample standard deviation over bound, with
    the 95 % interval low to high; robust: from the quartiles; bias: (mean - truth) over bound, with the half width of
    its 95 % interval.
    """

    n: int
    bound: float
    ratio: float
    low: float
    high: float
    robust: float
    bias: float
    bias_half_width: float


def efficiency(values: ArrayLike, truth: float, bound: float) -> Efficiency:
    """Compare estimates under as many noise realisations with the truth and the Cramer-Rao bound.

    ratio = s/sigma with s^2 = sum (x - mean)^2/(n - 1); its interval from the chi-square distribution of
    (n - 1) s^2/sigma^2, exact for normal estimates. values: SI, (n,), n of at least 2; bound: SI.
    Source: Kay, Fundamentals of Statistical Signal Processing I (1993), ch. 3.
    """
    from scipy.stats import chi2, t

    x = np.asarray(values, np.float64)
    free = x.size - 1
    s = x.std(ddof=1)
    low, high = np.sqrt(free / chi2.ppf([0.975, 0.025], free))
    quartiles = np.quantile(x, [0.25, 0.75])
    half_width = t.ppf(0.975, free) * s / np.sqrt(x.size)
    return Efficiency(
        x.size, bound, s / bound, s / bound * low, s / bound * high,
        (quartiles[1] - quartiles[0]) / (2.0 * QUARTILE) / bound,
        (x.mean() - truth) / bound, half_width / bound,
    )  # fmt: skip


def efficiencies(estimates: DataFrame) -> DataFrame:
    """Return the efficiency per setting, variant, case and parameter, of those with enough noise realisations.

    The bound is the median over the runs of the bound at the solution. estimates: one row a run and parameter with a
    known truth and a finite bound.
    """
    usable = estimates[np.isfinite(estimates["deviation"]) & (estimates["deviation"] > 0) & estimates["truth"].notna()]
    keys = ["setting", "variant", "case", "parameter"]
    rows = []
    for key, group in usable.groupby(keys, sort=False):
        if len(group) >= LEAST_REALISATIONS:
            bound, truth = float(group["deviation"].median()), float(group["truth"].iloc[0])
            rows.append((*key, *efficiency(group["value"], truth, bound), int(group["at_bound"].sum())))
    return DataFrame(rows, columns=[*keys, *Efficiency._fields, "n_at_bound"])


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


# Ratios above it ask for a logarithmic axis.
LARGEST_LINEAR = 4.0


def cramer_rao_figure(found: DataFrame) -> Any:
    """Draw one panel a parameter: standard deviation over bound with its 95 % interval, a colour a case.

    found: setting, variant, case, parameter, ratio, low, high. The band is 0.9 to 1.1.
    """
    names = list(dict.fromkeys(found["parameter"]))
    groups = list(dict.fromkeys(zip(found["variant"], found["setting"], strict=True)))
    cases = list(dict.fromkeys(found["case"]))
    figure, axes = panels(len(names), 2, 6.8, 1.6 + 0.5 * len(groups))
    for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
        axis.axvspan(*EFFICIENT, color="0.88", lw=0, zorder=0)
        axis.axvline(1.0, color="0.4", lw=1.0, zorder=1)
        for k, case in enumerate(cases):
            draw_case(axis, found[(found["parameter"] == name) & (found["case"] == case)], groups, k, len(cases))
        labels = [f"{v}\n{s}" for v, s in groups]
        axis.set_yticks(range(len(groups)), labels if i % 2 == 0 else [""] * len(groups))
        axis.set(ylim=(len(groups) - 0.5, -0.5), xlabel=f"{name}: standard deviation / bound")
        if found["high"].max() > LARGEST_LINEAR:
            log_with_plain_ticks(axis)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(8, len(cases)), frameon=False)
    return figure


def draw_case(axis: Any, own: DataFrame, groups: list[tuple[str, str]], k: int, n: int) -> None:
    """Draw the ratios of one case, a little apart from those of the others."""
    place = {group: i for i, group in enumerate(groups)}
    y = [place[v, s] + 0.7 * ((k + 0.5) / n - 0.5) for v, s in zip(own["variant"], own["setting"], strict=True)]
    ratio, low, high = (own[key].to_numpy() for key in ("ratio", "low", "high"))
    errors = np.array([ratio - low, high - ratio])
    axis.errorbar(ratio, y, xerr=errors, fmt=MARKERS[k % 7], ms=4.5, lw=1.3, color=COLOURS[k % 7],
                  label=str(own["case"].iloc[0]) if len(own) else None)  # fmt: skip


def log_with_plain_ticks(axis: Any) -> None:
    """Make the axis logarithmic and write ratios as plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())
