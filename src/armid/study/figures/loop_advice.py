"""Advised records against random ones."""

from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.figures.style import COLOURS, pyplot

APART = 0.14


def advice_figure(found: DataFrame, limit: float) -> Any:
    """Draw one row a pair: share told apart by the advised and by the random record, with Wilson intervals.

    found: pair, n, and advised, random with _low and _high. limit: what is aimed at.
    """
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(8.6, 1.8 + 0.5 * len(found)), layout="constrained")
    axis.axvline(100.0 * limit, color="0.4", ls="--", lw=1.2, label=f"target {100 * limit:g} %")
    for i, choice in enumerate(("advised", "random")):
        rate, low, high = (100.0 * found[f"{choice}{end}"].to_numpy(float) for end in ("", "_low", "_high"))
        place = np.arange(len(found)) + APART * (2 * i - 1)
        errors = np.array([rate - low, high - rate]).clip(min=0.0)
        axis.errorbar(rate, place, xerr=errors, fmt="os"[i], ms=6, lw=1.6, color=COLOURS[i], label=f"{choice} record")
    axis.set_yticks(range(len(found)), [f"{p} ({n})" for p, n in zip(found["pair"], found["n"], strict=True)])
    axis.set(ylim=(len(found) - 0.5, -0.5), xlim=(-2, 102), xlabel="told apart [%], with 95 % interval")
    figure.get_layout_engine().set(w_pad=0.12)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure
