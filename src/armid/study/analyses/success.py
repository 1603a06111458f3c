"""How often all parameters end within a tolerance of the truth."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.analyses.drawing import COLOURS, MARKERS, panels
from armid.study.analyses.table import Column, Table

TOLERANCES = (1e-2, 1e-3, 1e-4)


def success_rates(found: DataFrame, tolerances: Sequence[float] = TOLERANCES) -> DataFrame:
    """Return, per setting, variant and tolerance: runs, successes, rate and its 95 % Wilson interval.

    A run succeeds when the largest relative error of its result is at the tolerance or below; a failed run does not.
    found: outcomes of runs; tolerances: relative errors, 1. Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    known = found.dropna(subset=["largest_error"])
    rows = []
    for (setting, variant), group in known.groupby(["setting", "variant"], sort=False):
        errors = group["largest_error"].to_numpy()
        for tolerance in tolerances:
            successes = int(np.count_nonzero(errors <= tolerance))
            low, high = wilson(successes, errors.size)
            rows.append((setting, variant, tolerance, errors.size, successes, successes / errors.size, low, high))
    return DataFrame(rows, columns=["setting", "variant", "tolerance", "n", "successes", "rate", "low", "high"])


def wilson(successes: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the Wilson interval of a proportion."""
    from statsmodels.stats.proportion import proportion_confint

    low, high = proportion_confint(successes, n, alpha=1.0 - confidence, method="wilson")
    return float(low), float(high)


WORDS = (
    "A run succeeds when the relative errors of all parameters of its result are within the tolerance; a failed run "
    "does not. In brackets the 95 % Wilson interval of the rate. Runs of all cases and seeds count alike."
)


def success(found: DataFrame) -> Table:
    """Return one line a setting and variant, one column a tolerance. found: outcomes of runs."""
    rates = success_rates(found)
    rates["text"] = [
        f"{100 * r:.1f} ({100 * low:.1f} to {100 * high:.1f})"
        for r, low, high in zip(rates["rate"], rates["low"], rates["high"], strict=True)
    ]
    tolerances = list(dict.fromkeys(rates["tolerance"]))
    keys = ["setting", "variant", "n"]
    frame = rates.drop_duplicates(keys)[keys].reset_index(drop=True)
    for tolerance in tolerances:
        own = rates[rates["tolerance"] == tolerance].reset_index(drop=True)
        name = f"within_{100 * tolerance:g}_percent"
        frame[f"{name}_text"] = own["text"]
        for key in ("successes", "rate", "low", "high"):
            frame[f"{name}_{key}"] = own[key]
    shown = [Column(f"within_{100 * t:g}_percent_text", f"within {100 * t:g} % [% of runs]") for t in tolerances]
    first = (Column("setting", "noise"), Column("variant", "identifier"), Column("n", "runs", ".0f"))
    return Table("success", "Success rates", WORDS, frame, (*first, *shown))


APART = 0.24


def success_figure(rates: DataFrame) -> Any:
    """Draw one panel a setting, one line a variant, one colour a tolerance, with Wilson intervals.

    rates: setting, variant, tolerance, rate, low, high.
    """
    settings = list(dict.fromkeys(rates["setting"]))
    variants = sorted_variants(rates)
    figure, axes = panels(len(settings), 2, 6.8, 1.6 + 0.36 * len(variants))
    for i, (axis, setting) in enumerate(zip(axes, settings, strict=True)):
        own = rates[rates["setting"] == setting]
        for j, (tolerance, group) in enumerate(own.groupby("tolerance", sort=False)):
            draw(axis, group, variants, j, f"within {100 * float(str(tolerance)):g} %")
        axis.set_yticks(range(len(variants)), variants if i % 2 == 0 else [""] * len(variants))
        axis.set_ylim(len(variants) - 0.5, -0.5)
        axis.set_xlim(-2, 102)
        axis.set_xlabel("runs that succeed [%]")
        axis.set_title(setting)
        axis.grid(axis="x", alpha=0.4)
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=3, frameon=False)
    return figure


def sorted_variants(rates: DataFrame) -> list[str]:
    """Return the variants, the most successful first."""
    sums = rates.groupby("variant", sort=False)["rate"].mean()
    return [str(v) for v in sums.sort_values(ascending=False, kind="stable").index]


def draw(axis: Any, group: DataFrame, variants: list[str], j: int, label: str) -> None:
    """Draw the rates of one tolerance."""
    heights = group["variant"].map({v: i for i, v in enumerate(variants)}).to_numpy(float) + APART * (j - 1)
    rate, low, high = (100.0 * group[key].to_numpy() for key in ("rate", "low", "high"))
    errors = np.array([rate - low, high - rate]).clip(min=0.0)
    axis.errorbar(rate, heights, xerr=errors, fmt=MARKERS[j], ms=5, lw=1.4, color=COLOURS[j], label=label)
