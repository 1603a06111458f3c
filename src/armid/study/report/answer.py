"""The answer of a study in two sentences."""

import numpy as np
from pandas import DataFrame

from armid.study.report.evidence import Evidence
from armid.study.tables.overview import PAPER

MOST_SETTINGS = 2


def answer(evidence: Evidence) -> tuple[str, ...]:
    """Return who came nearest to the truth (without truths: to the best fitness), and how the others stand to that."""
    if evidence.knows_truth:
        return nearest_to_truth(evidence), beside_the_paper(evidence)
    return (lowest_fitness(evidence),)


def nearest_to_truth(evidence: Evidence) -> str:
    """Return the identifier with the smallest median largest error, of each setting."""
    said = []
    for setting in evidence.settings[:MOST_SETTINGS]:
        errors = by_variant(evidence.of(setting))
        best = min(errors, key=lambda v: float(median(errors[v])))
        p95 = np.quantile(errors[best], 0.95, method="inverted_cdf")
        said.append(f"{setting}: {best}, median largest error of a run {percent(median(errors[best]))}, "
                    f"95 % of its {len(errors[best])} runs within {percent(float(p95))}")  # fmt: skip
    more = len(evidence.settings) - MOST_SETTINGS
    return f"Nearest to the truth: {'; '.join(said)}{f'; {more} more settings below' if more > 0 else ''}."


def beside_the_paper(evidence: Evidence) -> str:
    """Return how many identifiers are better than the paper's published result, or the range of all medians."""
    errors = by_variant(evidence.of(evidence.settings[0]))
    medians = {variant: median(values) for variant, values in errors.items()}
    if not evidence.published.empty and evidence.study.get("report") == "table1":
        own = float(np.median(evidence.published.groupby("case")["relative_error"].max()))
        better = [v for v, value in medians.items() if value < own]
        return (f"{PAPER[0].upper()}{PAPER[1:]}, from its printed values on its own data, has {percent(own)}; "
                f"{len(better)} of {len(medians)} identifiers are below that.")  # fmt: skip
    worst = max(medians, key=lambda v: medians[v])
    return f"Of {len(medians)} identifiers the furthest is {worst} with {percent(medians[worst])}."


def lowest_fitness(evidence: Evidence) -> str:
    """Return who came to the lowest median fitness, of each fitness."""
    done = evidence.found[evidence.found["status"] == "done"]
    if done.empty:
        return "No run has a result."
    medians = done.groupby(["fitness", "variant"], sort=False)["value"].median()
    said = []
    for fitness in dict.fromkeys(done["fitness"]):
        own = medians.loc[fitness]
        said.append(f"{own.idxmin()}, {own.min():.6g} of {fitness}")
    return f"No truth is known. Lowest median fitness: {'; '.join(said)}."


def by_variant(found: DataFrame) -> dict[str, np.ndarray]:
    """Return variant -> largest relative error of each run; infinite for a failed one."""
    return {str(v): g["largest_error"].to_numpy(float) for v, g in found.groupby("variant", sort=False)}


def median(values: np.ndarray) -> float:
    """Return the median as the tables have it: a value that occurs."""
    return float(np.quantile(values, 0.5, method="inverted_cdf"))


def percent(value: float) -> str:
    """Return a share in per cent."""
    return "not finite" if not np.isfinite(value) else f"{100.0 * value:.3g} %"
