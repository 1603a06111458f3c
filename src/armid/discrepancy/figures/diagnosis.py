"""Where the discrepancy is: by record, stage, frequency and variable of the motion, before and after."""

from pathlib import Path
from typing import Any

import numpy as np

from armid.discrepancy.diagnose import Diagnosis
from armid.discrepancy.figures.drawing import AFTER, BEFORE, save, tidy
from armid.discrepancy.result import ClosedLoop
from armid.display import GREY, style

KINDS = {"record": "record", "stage": "stage of the motion", "frequency": "frequency", "dependence": "dependence on"}


def diagnosis_figure(found: ClosedLoop, path: Path) -> None:
    """Draw the mean square of the residual in units of the noise's, part by part."""
    plt = style()
    kinds = [k for k in KINDS if found.before.diagnosis.of_kind(k)]
    rows = -(-len(kinds) // 2)
    figure, axes = plt.subplots(rows, 2, figsize=(11.0, 3.9 * rows + 0.8), squeeze=False, layout="constrained")
    for axis, kind in zip(axes.flat, kinds, strict=False):
        draw(axis, kind, found.before.diagnosis, found.after.diagnosis)
    for axis in axes.flat[len(kinds) :]:
        axis.set_visible(False)
    of = "noise" if found.before.diagnosis.noise_known else "the residual"
    figure.supylabel(f"mean square / that of {of}", fontsize="medium")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(f"{found.campaign.name}: where the discrepancy is (1 is noise)", fontsize="large")
    save(plt, figure, path)


def draw(axis: Any, kind: str, before: Diagnosis, after: Diagnosis) -> None:
    """Draw one kind of tests."""
    names = [f.where for f in before.findings if f.kind == kind]
    places = np.arange(len(names))
    for diagnosis, colour, name, shift in ((before, BEFORE, "before", -0.12), (after, AFTER, "after", 0.12)):
        ratios = {f.where: f.ratio for f in diagnosis.findings if f.kind == kind}
        known = [i for i, n in enumerate(names) if n in ratios]
        heights = [max(ratios[names[i]], 1e-3) for i in known]
        axis.plot([i + shift for i in known], heights, "o", color=colour, label=name)
    axis.axhline(1.0, color=GREY, lw=1.0)
    axis.set_yscale("log")
    axis.set_xticks(places, names, rotation=45, ha="right", fontsize="small")
    axis.set_title(KINDS[kind], fontsize="medium")
    axis.margins(x=0.1)
    tidy(axis)
