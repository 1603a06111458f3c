"""Figures of one identification: the fit (as the paper's Fig. 10) and the convergence (as Fig. 11)."""

from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from armid.estimation.identify import Identification
from armid.problem.fitness import SIMILARITIES
from armid.problem.replay import Replay
from armid.report.style import save, style
from armid.units import SHOWN

# Okabe-Ito: told apart by colour-blind readers.
MEASURED, SIMULATED, RESIDUAL = "#000000", "#D55E00", "#0072B2"
MOST_RECORDS = 8
# Letters of a title that fit above one column.
LINE = 60


def fit_figure(found: Identification, path: Path) -> None:
    """Draw measured and simulated signal of each record, the residual below."""
    plt = style()
    replays = [*found.train_replays, *found.holdout_replays]
    shown = replays if len(replays) <= MOST_RECORDS else chosen(found)
    columns = 1 if len(shown) == 1 else 2
    rows = -(-len(shown) // columns)
    ratios = [h for _ in range(rows) for h in (3, 1.4)]
    size = (6.8 * columns, 4.4 * rows + 0.6)
    grid = {"figsize": size, "squeeze": False, "height_ratios": ratios, "layout": "constrained"}
    figure, axes = plt.subplots(2 * rows, columns, **grid)
    for i, replay in enumerate(shown):
        row, column = 2 * (i // columns), i % columns
        draw_record(axes[row, column], axes[row + 1, column], replay, found)
    for unused in axes.T.reshape(columns, rows, 2).transpose(1, 0, 2).reshape(-1, 2)[len(shown) :]:
        for axis in unused:
            axis.set_visible(False)
    figure.align_ylabels()
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(fill(title(found, len(shown), len(replays)), LINE * columns), fontsize="large")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def chosen(found: Identification) -> list[Replay]:
    """Return the first records of each role, when there are too many to draw."""
    half = MOST_RECORDS // 2
    train, holdout = list(found.train_replays), list(found.holdout_replays)
    n_holdout = min(len(holdout), max(half, MOST_RECORDS - len(train)))
    return train[: MOST_RECORDS - n_holdout] + holdout[:n_holdout]


def title(found: Identification, drawn: int, there_are: int) -> str:
    """Return what the figure shows."""
    model = " + ".join([found.model.plant.name, *(e.name for e in found.model.effects)])
    some = "" if drawn == there_are else f" ({drawn} of {there_are} records)"
    return f"{found.campaign.name}: {model}, {found.identifier} on {found.fitness.name}{some}"


def draw_record(upper: Any, lower: Any, replay: Replay, found: Identification) -> None:
    """Draw one record into a pair of axes."""
    unit, factor = SHOWN[found.campaign.unit]
    times, measured = replay.times, replay.measured * factor
    simulated = replay.signal(found.candidate[np.newaxis])[0] * factor
    upper.plot(times, measured, color=MEASURED, lw=1.6, label="measured")
    upper.plot(times, simulated, color=SIMULATED, lw=1.3, ls="--", label="simulated")
    lower.axhline(0.0, color="0.6", lw=0.8)
    lower.plot(times, measured - simulated, color=RESIDUAL, lw=0.8)
    rms = np.sqrt(np.mean((measured - simulated) ** 2))
    upper.set_title(f"{replay.record.file} ({replay.record.role}), RMSE {rms:.3g} {unit}", fontsize="medium")
    upper.set_ylabel(f"speed [{unit}]")
    upper.tick_params(labelbottom=False)
    lower.set_ylabel(f"residual\n[{unit}]")
    lower.set_xlabel("time [s]")
    for axis in (upper, lower):
        axis.margins(x=0.01)
        axis.spines[["top", "right"]].set_visible(False)


def convergence_figure(found: Identification, path: Path) -> None:
    """Draw the best fitness, or for a similarity its degree, against the number of simulations."""
    plt = style()
    similarity = found.fitness.name in SIMILARITIES
    evaluations, values = found.trace
    x, y = np.append(evaluations, found.used), np.append(values, values[-1:])
    figure, axis = plt.subplots(figsize=(6.8, 4.2), layout="constrained")
    unit, factor = SHOWN[found.campaign.unit] if found.fitness.unit == "signal" else ("", 1.0)
    shown = 1.0 - y if similarity else y * factor
    axis.step(x, shown, where="post", color=RESIDUAL, lw=1.8)
    if not similarity and np.min(y) > 0.0:
        set_log_scale(axis)
    named = f"{found.fitness.name} [{unit}]" if unit else found.fitness.name
    axis.set_ylabel("similarity degree of the best" if similarity else f"best {named}")
    axis.set_xlabel("simulations")
    text = f"{found.campaign.name}: {found.identifier}, seed {found.seed}, ends at {shown[-1]:.6g} {unit}"
    axis.set_title(text.rstrip(), fontsize="medium")
    axis.spines[["top", "right"]].set_visible(False)
    save(figure, path)


def set_log_scale(axis: Any) -> None:
    """Make the upright axis logarithmic with plain numbers at 1, 2, 5."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    axis.set_yscale("log")
    axis.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
    axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.yaxis.set_minor_formatter(StrMethodFormatter("{x:g}"))
