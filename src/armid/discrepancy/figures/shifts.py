"""Parameters of the declared model before and after, with their intervals."""

from pathlib import Path

from armid.discrepancy.estimates import Estimate
from armid.discrepancy.figures.drawing import AFTER, BEFORE, save, tidy
from armid.discrepancy.result import ClosedLoop
from armid.display import shown, style


def shift_figure(found: ClosedLoop, path: Path) -> None:
    """Draw each identified parameter of the declared model before and after."""
    plt = style()
    later = {e.name: e for e in found.after.estimates}
    both = [(e, later[e.name]) for e in found.before.estimates if e.low is not None or later[e.name].low is not None]
    figure, axes = plt.subplots(1, max(len(both), 1), figsize=(2.6 * max(len(both), 1) + 1.2, 3.4), squeeze=False,
                                layout="constrained")  # fmt: skip
    for axis, pair in zip(axes.flat, both, strict=False):
        for place, (estimate, colour) in enumerate(zip(pair, (BEFORE, AFTER), strict=True)):
            value = shown(estimate.value, estimate.unit)[0]
            axis.errorbar([place], [value], yerr=[[half(estimate)], [half(estimate)]], fmt="o", color=colour, capsize=5,
                          mfc=colour if estimate.trusted else "white")  # fmt: skip
        axis.set_xticks([0, 1], ["before", "after"])
        axis.set_xlim(-0.6, 1.6)
        axis.set_ylabel(f"{pair[0].name} [{shown(0.0, pair[0].unit)[1]}]")
        axis.ticklabel_format(axis="y", useOffset=False)
        tidy(axis)
    if not both:
        axes[0, 0].text(0.5, 0.5, "no parameter is free", ha="center", va="center")
        axes[0, 0].set_axis_off()
    figure.suptitle(f"{found.campaign.name}: parameters, 95 % intervals (open: not to be trusted)", fontsize="medium")
    save(plt, figure, path)


def half(estimate: Estimate) -> float:
    """Return half of the interval in the unit that people read, 0 where there is none."""
    if estimate.low is None or estimate.high is None:
        return 0.0
    return 0.5 * (shown(estimate.high, estimate.unit)[0] - shown(estimate.low, estimate.unit)[0])
