"""Ranking of the candidates at the declared model, and what full fits made of them."""

from pathlib import Path

import numpy as np

from armid.discrepancy.figures.drawing import AFTER, save, tidy
from armid.discrepancy.result import ClosedLoop
from armid.display import GREY, style

MOST_SHOWN = 14


def ranking_figure(found: ClosedLoop, path: Path) -> None:
    """Draw the predicted fall of chi2 of each candidate, as a share, and that of its full fit where there was one."""
    plt = style()
    start = found.before.fit
    best: dict[str, float] = {}
    for s in found.search.trace(start):
        name = found.library.public(s.name)
        best[name] = max(best.get(name, 0.0), s.drop / start.chi2)
    names = sorted(best, key=lambda n: -best[n])[:MOST_SHOWN]
    fitted: dict[str, float] = {}
    for fit in found.search.of_size(1):
        name = found.library.public(fit.active[0])
        fitted[name] = max(fitted.get(name, 0.0), 1.0 - fit.chi2 / start.chi2)
    figure, axis = plt.subplots(figsize=(6.8, 0.34 * len(names) + 1.6), layout="constrained")
    places = np.arange(len(names))
    axis.barh(places, [100.0 * best[n] for n in names], color=GREY, label="predicted by the score")
    known = [i for i, n in enumerate(names) if n in fitted]
    axis.plot([100.0 * fitted[names[i]] for i in known], known, "D", color=AFTER, label="reached by a full fit")
    axis.set_yticks(places, names)
    axis.invert_yaxis()
    axis.set_xlabel("fall of chi2 [%]")
    axis.set_title(f"{found.campaign.name}: candidates for the first effect", fontsize="medium")
    axis.legend(frameon=False, loc="lower right")
    tidy(axis)
    save(plt, figure, path)
