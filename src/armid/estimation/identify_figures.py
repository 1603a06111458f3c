"""Figures of an identification: the fit (as the paper's Fig. 10) and the convergence (as Fig. 11)."""

from collections.abc import Callable, Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np

from armid.estimation.identify import Identification
from armid.problem.fitness import SIMILARITIES
from armid.problem.replay import Replay
from armid.report.common import points, record_axes, small_axes
from armid.report.style import GREY, OKABE_ITO, pyplot
from armid.units import SHOWN

MOST_RECORDS = 8
# Letters of a title that fit above one column.
LINE = 60


def figures_of(found: Identification) -> dict[str, Callable[[], Any]]:
    """Return name -> what draws a figure; nothing converges where nothing was searched."""
    convergence = {"convergence": lambda: convergence_figure(found)} if len(found.trace[0]) else {}
    return {"fit": lambda: fit_figure(found), **convergence}


def fit_figure(found: Identification) -> Any:
    """Draw measured and simulated signal of each record, the residual below."""
    replays = chosen(found)
    figure, axes = record_axes(len(replays), 4.4, 0.6, (3, 1.4))
    unit, factor = SHOWN[found.campaign.unit]
    for pair, replay in zip(axes, replays, strict=True):
        measured, simulated = replay.measured, replay.signal(found.candidate[np.newaxis])[0]
        rms = factor * np.sqrt(np.mean((measured - simulated) ** 2))
        pair[0].set_title(f"{replay.record.file} ({replay.record.role}), RMSE {rms:.3g} {unit}", fontsize="medium")
        curves = {"measured": measured, "simulated": simulated, "residual": measured - simulated}
        draw_record(pair, {name: (replay.times, y) for name, y in curves.items()}, found.campaign.unit)
    figure.align_ylabels()
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    there_are = len(found.train_replays) + len(found.holdout_replays)
    model = " + ".join([found.model.plant.name, *(e.name for e in found.model.effects)])
    some = "" if len(replays) == there_are else f" ({len(replays)} of {there_are} records)"
    title = f"{found.campaign.name}: {model}, {found.identifier} on {found.fitness.name}{some}"
    figure.suptitle(fill(title, LINE * (1 if len(replays) == 1 else 2)), fontsize="large")
    return figure


def chosen(found: Identification) -> list[Replay]:
    """Return the records that are drawn: the first of each role where there are too many."""
    train, holdout = list(found.train_replays), list(found.holdout_replays)
    n_holdout = min(len(holdout), max(MOST_RECORDS // 2, MOST_RECORDS - len(train)))
    return train[: MOST_RECORDS - n_holdout] + holdout[:n_holdout]


def record_figure(curves: Mapping[str, Mapping[str, Any]], unit: str) -> Any:
    """Draw a stored record for a page. curves: those of `details.json`."""
    figure, pair = small_axes(6.0, 4.0, (3, 1.4))
    draw_record(pair, {name: points(curve) for name, curve in curves.items()}, unit)
    pair[0].legend(frameon=False, fontsize="small")
    return figure


def draw_record(axes: Sequence[Any], curves: Mapping[str, Any], si_unit: str) -> None:
    (upper, lower), (unit, factor) = axes, SHOWN[si_unit]
    looks = {"measured": {"color": OKABE_ITO["black"], "lw": 1.6},
             "simulated": {"color": OKABE_ITO["vermilion"], "lw": 1.3, "ls": "--"}}  # fmt: skip
    for name, look in looks.items():
        x, y = curves[name]
        upper.plot(x, factor * y, label=name, **look)
    x, y = curves["residual"]
    lower.axhline(0.0, color=GREY, lw=0.8)
    lower.plot(x, factor * y, color=OKABE_ITO["blue"], lw=0.8)
    upper.set_ylabel(f"speed [{unit}]")
    upper.tick_params(labelbottom=False)
    lower.set(ylabel=f"residual\n[{unit}]", xlabel="time [s]")
    for axis in axes:
        axis.margins(x=0.01)


def convergence_figure(found: Identification) -> Any:
    """Draw the best fitness, or for a similarity its degree, against the number of simulations."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    similarity = found.fitness.name in SIMILARITIES
    evaluations, values = found.trace
    x, y = np.append(evaluations, found.used), np.append(values, values[-1:])
    figure, axis = pyplot().subplots(figsize=(6.8, 4.2), layout="constrained")
    unit, factor = SHOWN[found.campaign.unit] if found.fitness.unit == "signal" else ("", 1.0)
    shown = 1.0 - y if similarity else y * factor
    axis.step(x, shown, where="post", color=OKABE_ITO["blue"], lw=1.8)
    if not similarity and np.min(y) > 0.0:
        # plain numbers at 1, 2, 5
        axis.set_yscale("log")
        axis.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.yaxis.set_minor_formatter(StrMethodFormatter("{x:g}"))
    named = f"{found.fitness.name} [{unit}]" if unit else found.fitness.name
    axis.set(ylabel="similarity degree of the best" if similarity else f"best {named}", xlabel="simulations")
    text = f"{found.campaign.name}: {found.identifier}, seed {found.seed}, ends at {shown[-1]:.6g} {unit}"
    axis.set_title(text.rstrip(), fontsize="medium")
    return figure
