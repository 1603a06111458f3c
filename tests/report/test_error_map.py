"""Heat map of errors."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from armid.study.analyses.outcomes import outcomes

from armid.study.analyses.errors import brief, error_map, error_map_figure


def test_medians_in_the_orders_given(made):
    results = made(seeds=5, noises=(0.0,))
    found = outcomes(results.runs, results.parameters)
    errors = error_map(found, ["de+bobyqa", "pso", "unknown"], ["row 2", "row 1"])
    assert list(errors.index) == ["de+bobyqa", "pso"]
    assert list(errors.columns) == ["row 2", "row 1"]
    own = found[(found["variant"] == "pso") & (found["case"] == "row 1")]
    assert errors.loc["pso", "row 1"] == np.median(own["largest_error"])
    figure = error_map_figure({"noise-free": errors})
    assert brief(100.0 * errors.loc["pso", "row 1"]) in {t.get_text() for t in figure.axes[0].texts}
    plt.close(figure)


@pytest.mark.parametrize(("percent", "text"), [(np.inf, "failed"), (1.234, "1.2"), (3.2e-7, "3e-07"), (0.0, "0")])
def test_brief(percent, text):
    assert brief(percent) == text
