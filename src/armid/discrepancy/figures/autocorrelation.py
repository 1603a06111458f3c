"""Correlation in time of the whitened residual, before and after."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.figures.drawing import AFTER, BEFORE, save, tidy
from armid.discrepancy.result import ClosedLoop
from armid.discrepancy.view import View
from armid.display import GREY, style

Array = NDArray[np.float64]
MOST_LAGS = 150


def autocorrelation_figure(found: ClosedLoop, path: Path) -> None:
    """Draw the autocorrelation of the whitened residual of the train records, with the 95 % band of white noise."""
    plt = style()
    figure, axis = plt.subplots(figsize=(6.8, 3.6), layout="constrained")
    interval = found.campaign.train[0].manoeuvre.interval
    for judged, colour, name in ((found.before, BEFORE, "before"), (found.after, AFTER, "after")):
        values = correlation(judged.train)
        axis.plot(1e3 * interval * np.arange(len(values)), values, color=colour, lw=1.6, label=name)
    band = 1.96 / np.sqrt(len(found.after.train.residual))
    axis.axhspan(-band, band, color=GREY, alpha=0.35, lw=0, label="white noise, 95 %")
    axis.set_xlabel("lag [ms]")
    axis.set_ylabel("autocorrelation")
    axis.set_title(f"{found.campaign.name}: whitened residual of the train records", fontsize="medium")
    axis.legend(frameon=False)
    axis.margins(x=0.01)
    tidy(axis)
    save(plt, figure, path)


def correlation(view: View) -> Array:
    """Return the autocorrelation at lags from 0 on, pooled over records, (n_lags,)."""
    parts = view.evidence.by_record(view.residual)
    lags = min(MOST_LAGS, *(len(p) - 1 for p in parts))
    table = [[float(p[: len(p) - k] @ p[k:]) for k in range(lags)] for p in parts]
    total = np.sum(table, axis=0)
    return np.asarray(total / total[0])
