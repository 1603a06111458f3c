"""Success rates: how often all parameters end within a tolerance of the truth."""

from collections.abc import Sequence

from pandas import DataFrame, concat

from armid.report.document import Column, Part, Table
from armid.study.analyses.analysis import N_RUNS, SETTING, VARIANT, Analysis, Evidence

SUCCESS_TOLERANCES = (1e-2, 1e-3, 1e-4)
TABLE_CAPTION = (
    "A run succeeds when the relative errors of all parameters of its result are within the tolerance; a failed run "
    "does not. In brackets the 95 % Wilson interval of the rate. Runs of all cases and seeds count alike."
)


def parts(evidence: Evidence) -> Sequence[Part]:
    if not evidence.knows_truth:
        return ()
    return (success(concat([evidence.of(setting) for setting in evidence.settings])),)


SUCCESS = Analysis("success", "Success rates", parts, "share of runs with all parameters within 1, 0.1 and 0.01 %")


def success(runs: DataFrame) -> Table:
    """Return, per setting, variant and tolerance: runs, successes, rate and its 95 % Wilson interval.

    A failed run is not a success. Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    from statsmodels.stats.proportion import proportion_confint

    names = {f"{100 * tolerance:g}": tolerance for tolerance in SUCCESS_TOLERANCES}
    rows = []
    for key, group in runs.dropna(subset=["largest_error"]).groupby(["setting", "variant"], sort=False):
        row = dict(zip(("setting", "variant", "n"), (*key, len(group)), strict=True))
        for percent, tolerance in names.items():
            n = int((group["largest_error"] <= tolerance).sum())
            rate, (low, high) = n / len(group), proportion_confint(n, len(group), method="wilson")
            shown = {"text": f"{100 * rate:.1f} ({100 * low:.1f} to {100 * high:.1f})", "successes": n, "rate": rate}
            row |= {f"within_{percent}_percent_{k}": v for k, v in {**shown, "low": low, "high": high}.items()}
        rows.append(row)
    columns = (Column(f"within_{percent}_percent_text", f"within {percent} % [% of runs]") for percent in names)
    return Table("success", "Success rates", TABLE_CAPTION, DataFrame(rows), (SETTING, VARIANT, N_RUNS, *columns))
