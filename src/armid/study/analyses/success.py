"""Success rates: how often all parameters end within a tolerance of the truth."""

from collections.abc import Sequence

import numpy as np
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
    return (success(success_rates(concat([evidence.of(setting) for setting in evidence.settings]))),)


SUCCESS = Analysis("success", "Success rates", parts, "share of runs with all parameters within 1, 0.1 and 0.01 %")


def success_rates(runs: DataFrame, tolerances: Sequence[float] = SUCCESS_TOLERANCES) -> DataFrame:
    """Return, per setting, variant and tolerance: runs, successes, rate and its 95 % Wilson interval.

    A failed run is not a success. Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    from statsmodels.stats.proportion import proportion_confint

    rows = []
    for key, group in runs.dropna(subset=["largest_error"]).groupby(["setting", "variant"], sort=False):
        errors = group["largest_error"].to_numpy()
        for tolerance in tolerances:
            n = int(np.count_nonzero(errors <= tolerance))
            interval = proportion_confint(n, errors.size, method="wilson")
            rows.append((*key, tolerance, errors.size, n, n / errors.size, *interval))
    return DataFrame(rows, columns=["setting", "variant", "tolerance", "n", "successes", "rate", "low", "high"])


def success(rates: DataFrame) -> Table:
    keys = ["setting", "variant", "n"]
    frame = rates.drop_duplicates(keys)[keys].reset_index(drop=True)
    columns = [SETTING, VARIANT, N_RUNS]
    for tolerance, own in rates.groupby("tolerance", sort=False):
        percent = f"{100 * float(str(tolerance)):g}"
        name = f"within_{percent}_percent"
        shares = zip(*(100 * own[key] for key in ("rate", "low", "high")), strict=True)
        frame[f"{name}_text"] = [f"{rate:.1f} ({low:.1f} to {high:.1f})" for rate, low, high in shares]
        for key in ("successes", "rate", "low", "high"):
            frame[f"{name}_{key}"] = own[key].to_numpy()
        columns.append(Column(f"{name}_text", f"within {percent} % [% of runs]"))
    return Table("success", "Success rates", TABLE_CAPTION, frame, tuple(columns))
