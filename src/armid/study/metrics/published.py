"""Values that the paper printed, as the study file repeats them case by case."""

from typing import Any

import numpy as np
from pandas import DataFrame


def published_values(study: dict[str, Any]) -> DataFrame:
    """Return case, parameter, truth, published [SI] and relative error of the cases that carry a published result."""
    rows = []
    for case in study["cases"]:
        truth = case.get("truth") or {}
        for parameter, value in (case.get("published") or {}).items():
            true = float(truth.get(parameter, np.nan))
            rows.append((case["name"], parameter, true, float(value), abs(value - true) / abs(true)))
    return DataFrame(rows, columns=["case", "parameter", "truth", "published", "relative_error"])
