"""Success rates as a table."""

from pandas import DataFrame

from armid.study.metrics import success_rates
from armid.study.tables.table import Column, Table

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
