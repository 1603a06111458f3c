"""Heat map of errors: identifiers by cases."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.figures.style import pyplot

# Shown in %: better than the lower end is all the same colour.
LOWEST, HIGHEST = 1e-6, 1e2
MOST_NUMBERS = 12


def error_map_figure(maps: Mapping[str, DataFrame]) -> Any:
    """Draw one panel a setting: median over the seeds of the largest relative error [%], variants by cases.

    maps: setting -> errors [1], one row a variant and one column a case, infinite where the median run failed.
    """
    import seaborn as sns  # noqa: PLC0415 - takes time to import, and only figures need it
    from matplotlib.colors import LogNorm  # noqa: PLC0415

    plt = pyplot()
    n_rows = sum(len(m) for m in maps.values())
    n_columns = max(m.shape[1] for m in maps.values())
    numbers = n_columns <= MOST_NUMBERS
    size = (3.4 + (0.95 if numbers else 0.36) * n_columns, 1.3 * len(maps) + 0.36 * n_rows + 0.4)
    figure, axes = plt.subplots(len(maps), 1, figsize=size, squeeze=False, layout="constrained")
    norm = LogNorm(LOWEST, HIGHEST)
    for axis, (setting, errors) in zip(axes.ravel(), maps.items(), strict=True):
        percent = 100.0 * errors
        colours = percent.clip(LOWEST, HIGHEST)
        text = percent.map(brief) if numbers else False
        sns.heatmap(colours, ax=axis, norm=norm, cmap="cividis_r", annot=text, fmt="", cbar=False, linewidths=0.4,
                    annot_kws={"fontsize": 8.5}, xticklabels=True, yticklabels=True)  # fmt: skip
        axis.set(title=setting, xlabel="", ylabel="")
        axis.tick_params(length=0)
    beside = {"ax": list(axes.ravel()), "pad": 0.02, "fraction": 0.05, "shrink": 1.0 / len(maps), "aspect": 25}
    bar = figure.colorbar(axes[0, 0].collections[0], extend="both", **beside)
    bar.set_label("largest relative error [%]")
    return figure


def brief(percent: float) -> str:
    """Return a number that fits into a cell."""
    if not np.isfinite(percent):
        return "failed"
    return f"{percent:.2g}" if percent >= 1e-3 or percent == 0.0 else f"{percent:.0e}"
