"""Residual of each record before and after."""

from pathlib import Path
from typing import Any

import numpy as np

from armid.discrepancy.figures.drawing import AFTER, BEFORE, save, tidy
from armid.discrepancy.result import ClosedLoop
from armid.discrepancy.view import View
from armid.display import GREY, SHOWN, style

MOST_RECORDS = 8


def residual_figure(found: ClosedLoop, path: Path) -> None:
    """Draw measured minus simulated of each record, before and after, with the noise as a band."""
    plt = style()
    rows = [r for name in ("train", "holdout") for r in pairs(getattr(found.before, name), getattr(found.after, name))]
    shown = rows[-MOST_RECORDS:] if len(rows) > MOST_RECORDS else rows
    columns = 1 if len(shown) == 1 else 2
    high = -(-len(shown) // columns)
    figure, axes = plt.subplots(high, columns, figsize=(6.8 * columns, 2.9 * high + 0.9), squeeze=False,
                                layout="constrained")  # fmt: skip
    for axis, row in zip(axes.flat, shown, strict=False):
        draw(axis, found, *row)
    for axis in axes.flat[len(shown) :]:
        axis.set_visible(False)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    names = " + ".join(found.effects) or "no effect added"
    figure.suptitle(f"{found.campaign.name}: residual before and after ({names})", fontsize="large")
    save(plt, figure, path)


def pairs(before: View | None, after: View | None) -> list[tuple[Any, ...]]:
    """Return record, times and residuals before and after, of each record."""
    if before is None or after is None:
        return []
    return [(r.record, r.times, b, a) for r, b, a in zip(before.replays, before.raw, after.raw, strict=True)]


def draw(axis: Any, found: ClosedLoop, record: Any, times: Any, before: Any, after: Any) -> None:
    """Draw one record."""
    unit, factor = SHOWN[found.campaign.unit]
    noise = factor * found.noise_rms
    axis.axhspan(-2.0 * noise, 2.0 * noise, color=GREY, alpha=0.35, lw=0, label="noise, 2 sigma")
    axis.plot(times, factor * before, color=BEFORE, lw=1.0, label="before")
    axis.plot(times, factor * after, color=AFTER, lw=0.8, label="after")
    errors = [factor * float(np.sqrt(np.mean(x**2))) for x in (before, after)]
    axis.set_title(f"{record.file} ({record.role}), RMSE {errors[0]:.3g} to {errors[1]:.3g} {unit}", fontsize="medium")
    axis.set_ylabel(f"residual [{unit}]")
    axis.set_xlabel("time [s]")
    axis.margins(x=0.01)
    tidy(axis)
