"""Error against the similarity reached, to see whether a high similarity means right parameters."""

from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.figures.style import COLOURS, MARKERS, panels

FLOOR = 1e-16
MOST_POINTS = 800


def fitness_quality_figure(found: DataFrame) -> Any:
    """Draw one panel a setting: largest error of each run [%] against 1 - S, a colour a fitness.

    found: outcomes of runs. Failed runs are left out.
    """
    settings = list(dict.fromkeys(found["setting"]))
    names = list(dict.fromkeys(found["fitness"]))
    figure, axes = panels(len(settings), 2, 6.8, 5.2)
    for axis, setting in zip(axes, settings, strict=True):
        own = found[(found["setting"] == setting) & (found["status"] == "done")]
        for k, name in enumerate(names):
            group = own[own["fitness"] == name]
            group = group.iloc[:: max(1, -(-len(group) // MOST_POINTS))]
            misfit = np.maximum(1.0 - group["train_s"].to_numpy(float), FLOOR)
            error = np.maximum(100.0 * group["largest_error"].to_numpy(float), 100.0 * FLOOR)
            axis.plot(misfit, error, MARKERS[k % 7], ms=4.5, mfc="none", mew=0.9, color=COLOURS[k % 7], label=name)
        axis.set(xscale="log", yscale="log", title=setting)
        axis.set_xlabel("1 - S reached (similarity degree on the train records)")
        axis.set_ylabel("largest relative error [%]")
        axis.grid(alpha=0.3)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure
