"""Where runs end: deviations from the truth, one row a run."""

from typing import Any

import numpy as np
from pandas import DataFrame

from armid.study.analyses.drawing import COLOURS, MARKERS, PALE, pyplot

# The parameters that stand in for each other on the arm; others where a study has others.
VALLEY = ("p0", "eta3", "n")
MOST = 3


def end_points(estimates: DataFrame) -> DataFrame:
    """Return variant, setting and the deviation (value - truth)/abs(truth) [%] of each parameter, one row a run.

    estimates: one row a run and parameter; runs with an unknown truth are left out. The columns are the p0-eta3-n
    valley where these are free, else the first three parameters.
    """
    known = estimates[estimates["truth"].notna()]
    deviation = 100.0 * (known["value"] - known["truth"]) / known["truth"].abs()
    wide = known.assign(deviation=deviation).pivot(index="run", columns="parameter", values="deviation")
    names = list(dict.fromkeys(known["parameter"]))
    chosen = list(VALLEY) if set(VALLEY) <= set(names) else names[:MOST]
    groups = known.drop_duplicates("run").set_index("run")[["variant", "setting"]]
    return groups.join(wide[chosen].dropna(), how="inner")


MOST_POINTS = 600


def valley_figure(ends: DataFrame, chosen: list[str]) -> Any:
    """Draw the deviations from the truth [%] of each pair of parameters, one mark a run.

    ends: variant, setting and one column a parameter; chosen: the variants with a colour of their own, up to six; all
    others are pale. Of more than 600 runs a variant every n-th is drawn.
    """
    import seaborn as sns

    pyplot()
    names = [c for c in ends.columns if c not in ("variant", "setting")]
    shown = ends.assign(shown=ends["variant"].where(ends["variant"].isin(chosen), OTHERS))
    shown = thinned(shown)
    there = [v for v in (OTHERS, *chosen) if v in set(shown["shown"])]
    palette = {v: PALE if v == OTHERS else COLOURS[chosen.index(v) % len(COLOURS)] for v in there}
    marks = {v: "." if v == OTHERS else MARKERS[chosen.index(v) % len(MARKERS)] for v in there}
    grid = sns.PairGrid(shown, vars=names, hue="shown", hue_order=there, palette=palette, corner=True, height=2.9,
                        hue_kws={"marker": [marks[v] for v in there]})  # fmt: skip
    grid.map_lower(scatter)
    grid.map_diag(sns.histplot, element="step", fill=False, bins=30, common_norm=False)
    for i, name in enumerate(names):
        grid.axes[i, 0].set_ylabel(f"{name}: deviation [%]" if i else "runs")
        grid.axes[-1, i].set_xlabel(f"{name}: deviation [%]")
    grid.add_legend(title="", loc="upper right", bbox_to_anchor=(0.99, 0.98), fontsize=10, markerscale=1.2)
    return grid.figure


OTHERS = "all others"


def scatter(x: np.ndarray, y: np.ndarray, **told: Any) -> None:
    """Draw marks, hollow so that those below stay visible."""
    pyplot().gca().plot(
        x, y, ls="", marker=told["marker"], ms=5, mfc="none", mec=told["color"], mew=0.9, label=told.get("label")
    )


def thinned(ends: DataFrame) -> DataFrame:
    """Return every n-th run of a variant that has very many."""
    parts = [g.iloc[:: -(-len(g) // MOST_POINTS)].index for _, g in ends.groupby("variant", sort=False)]
    return ends.loc[[i for part in parts for i in part]]
