"""How often closed loops are right, silent or wrong, class by class; false alarms; sizes of groups."""

from typing import Any

import numpy as np
from pandas import DataFrame

from armid.display import OKABE_ITO
from armid.study.figures.loop_errors import plain_ticks
from armid.study.figures.style import COLOURS, panels, pyplot

# Judgements that readers may lump together, from good to bad.
LUMPS: dict[str, tuple[tuple[str, ...], str]] = {
    "right": (("right",), OKABE_ITO["green"]),
    "in a group": (("group",), OKABE_ITO["sky"]),
    "right and one more": (("right_with_extra",), OKABE_ITO["blue"]),
    "one of two": (("half", "half_with_extra"), OKABE_ITO["purple"]),
    "unnamed term": (("empirical",), OKABE_ITO["yellow"]),
    "part by a name": (("partial",), OKABE_ITO["orange"]),
    "nothing, or cannot tell": (("none", "cannot_tell"), "0.75"),
    "wrong or false": (("wrong", "claimed", "false_alarm"), OKABE_ITO["vermilion"]),
    "no report": (("missing",), "0.3"),
}


def rates_figure(answers: DataFrame) -> Any:
    """Draw one bar a class, split by judgement. answers: class, n, and a column of numbers for each judgement."""
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(9.6, 1.9 + 0.46 * len(answers)), layout="constrained")
    left = np.zeros(len(answers))
    for label, (words, colour) in LUMPS.items():
        there = [w for w in words if w in answers]
        share = 100.0 * answers[there].sum(axis=1).to_numpy(float) / answers["n"].to_numpy(float)
        if share.any():
            axis.barh(range(len(answers)), share, left=left, color=colour, label=label, edgecolor="white", lw=0.6)
            left += share
    names = [f"{c} ({n})" for c, n in zip(answers["class"], answers["n"], strict=True)]
    axis.set_yticks(range(len(answers)), names)
    axis.set(ylim=(len(answers) - 0.5, -0.5), xlim=(0, 100), xlabel="campaigns [%]")
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure


def alarms_figure(alarms: DataFrame, limit: float) -> Any:
    """Draw false alarms with their Wilson intervals. alarms: noise, n, rate, low, high; limit: what is aimed at."""
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(7.2, 1.5 + 0.42 * len(alarms)), layout="constrained")
    rate, low, high = (100.0 * alarms[key].to_numpy(float) for key in ("rate", "low", "high"))
    errors = np.array([rate - low, high - rate]).clip(min=0.0)
    axis.axvline(100.0 * limit, color=COLOURS[1], ls="--", lw=1.3, label=f"target {100 * limit:g} %")
    axis.errorbar(rate, range(len(alarms)), xerr=errors, fmt="o", ms=6, lw=1.6, color=COLOURS[0])
    axis.set_yticks(range(len(alarms)), [f"{k} noise ({n})" for k, n in zip(alarms["noise"], alarms["n"], strict=True)])
    axis.set(ylim=(len(alarms) - 0.5, -0.5), xlabel="false alarms [%], with 95 % interval")
    axis.set_xlim(left=-0.3)
    axis.legend(frameon=False, loc="upper right")
    return figure


def sizes_and_times_figure(groups: DataFrame, seconds: DataFrame) -> Any:
    """Draw the sizes of groups, and the times to close a campaign. seconds: class, seconds, cpu_seconds."""
    figure, (left, right) = panels(2, 2, 5.6, 3.6)
    width = 0.38
    place = np.arange(len(groups))
    left.bar(place - width / 2, groups["right"], width, color=OKABE_ITO["green"], label="holds the truth")
    left.bar(place + width / 2, groups["wrong"], width, color=OKABE_ITO["vermilion"], label="does not")
    left.set_xticks(place, [str(s) for s in groups["size"]])
    left.set(xlabel="effects in the group", ylabel="campaigns")
    left.legend(frameon=False)
    for i, (key, label) in enumerate((("seconds", "wall"), ("cpu_seconds", "processor"))):
        values = np.sort(seconds[key].to_numpy(float))
        shares = 100.0 * np.arange(1, values.size + 1) / max(values.size, 1)
        right.step(values, shares, where="post", color=COLOURS[i], label=label)
    right.axvline(30.0, color="0.4", ls="--", lw=1.2)
    right.set(xlabel="time to close a campaign, one thread [s]", ylabel="campaigns [%]", xscale="log", ylim=(0, 102))
    plain_ticks(right.xaxis)
    right.legend(frameon=False, loc="lower right")
    return figure
