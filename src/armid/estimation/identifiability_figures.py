"""Figures of an examination: the profiles, and what the records see of each parameter."""

from collections.abc import Callable, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.estimation.design import identity
from armid.estimation.examine import Examination
from armid.estimation.information import level_weights, sensitivities
from armid.estimation.profile import THRESHOLD, Profile
from armid.report.style import GREY, OKABE_ITO, look, pyplot
from armid.units import SHOWN

Array = NDArray[np.float64]
CURVE, QUADRATIC, LIMIT = OKABE_ITO["blue"], OKABE_ITO["vermilion"], OKABE_ITO["black"]
# The top of a profile's panel, and by how much its sides go beyond what was tried, as a share.
TOP, SIDE = 6.5, 0.04
MOST_RECORDS, MOST_PANELS = 4, 12
LINE = 60


def figures_of(found: Examination) -> dict[str, Callable[[], Any]]:
    """Return name -> what draws a figure."""
    return {"profiles": lambda: profile_figure(found), "sensitivities": lambda: sensitivity_figure(found)}


def profile_figure(found: Examination) -> Any:
    """Draw the rise of chi2 along each parameter, the 95 % threshold, the parabola, and the bounds of the box."""
    shown = found.profiles[:MOST_PANELS]
    columns = min(len(shown), 2 if len(shown) <= 4 else 3)
    rows = -(-len(shown) // columns)
    size = (4.6 * columns, 3.3 * rows + 1.0)
    figure, axes = pyplot().subplots(rows, columns, figsize=size, squeeze=False, sharey=True, layout="constrained")
    for axis, profile in zip(axes.flat, shown, strict=False):
        draw_profile(axis, profile)
    for axis in axes.flat[len(shown) :]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel("rise of $\\chi^2$")
    handles = dict(pair for axis in axes.flat for pair in zip(*axis.get_legend_handles_labels()[::-1], strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle(fill(f"{title(found)}: profile likelihood", LINE * columns // 2 + 15), fontsize="large")
    return figure


def draw_profile(axis: Any, profile: Profile) -> None:
    """Draw one profile into an axis."""
    unit, factor = SHOWN.get(profile.unit, (profile.unit, 1.0))
    left, right = view(profile)
    grid = np.linspace(left, right, 200)
    if np.isfinite(profile.deviation):
        parabola = ((grid - profile.estimate) / profile.deviation) ** 2
        axis.plot(grid * factor, parabola, color=QUADRATIC, ls="--", lw=1.5, zorder=3, label="by curvature")
    axis.plot(*smooth(profile, factor), color=CURVE, lw=2.0, label="profile")
    axis.plot(profile.values * factor, profile.rise, color=CURVE, marker="o", ms=4.0, ls="none", label="fitted again")
    axis.axhline(THRESHOLD, color=LIMIT, lw=1.0, ls=":", label="95 % threshold")
    axis.axvspan(profile.low * factor, profile.high * factor, color=CURVE, alpha=0.10, lw=0, label="95 % interval")
    for bound in profile.box:
        if left <= bound <= right:
            axis.axvline(bound * factor, color=GREY, lw=3.0, label="bound of the box")
    axis.plot(profile.estimate * factor, 0.0, color=LIMIT, marker="D", ms=6, ls="none", clip_on=False, zorder=5,
              label="estimate")  # fmt: skip
    name = f"{profile.name} [{unit}]" if unit != "1" else profile.name
    axis.set(xlim=(left * factor, right * factor), ylim=(0.0, TOP), xlabel=name)
    axis.ticklabel_format(axis="x", useOffset=False, style="plain")
    axis.locator_params(axis="x", nbins=4)


def smooth(profile: Profile, factor: float) -> tuple[Array, Array]:
    """Return a smooth curve through a profile: its signed root, which is next to straight, between the points."""
    from scipy.interpolate import PchipInterpolator

    side = np.sign(profile.values - profile.estimate)
    values, first = np.unique(profile.values, return_index=True)
    root = (side * np.sqrt(np.maximum(profile.rise, 0.0)))[first]
    if len(values) < 3:
        return values * factor, root**2
    grid = np.linspace(values[0], values[-1], 400)
    return grid * factor, PchipInterpolator(values, root)(grid) ** 2


def view(profile: Profile) -> tuple[float, float]:
    """Return from where to where a profile is drawn: as far as its curve is within the panel."""
    inside = profile.values[profile.rise <= 1.2 * TOP]
    left, right = min(float(inside.min()), profile.low), max(float(inside.max()), profile.high)
    room = SIDE * (right - left) or 1e-3 * (profile.box[1] - profile.box[0])
    return left - room, right + room


def sensitivity_figure(found: Examination) -> Any:
    """Draw correlations, which record tells of which parameter, and the sensitivities of the records that tell most.

    With one record its sensitivities stand beside the correlations.
    """
    weights = level_weights(found.information.levels)
    # d signal / d parameter of each record in units of its level, (n_samples, n_free) each
    jacobians = [w * sensitivities(r, found.space, found.x) for w, r in zip(weights, found.replays, strict=True)]
    order = telling(found, jacobians)
    n = len(found.space.free_names)
    height, rows = max(3.2, 0.55 * n + 1.6), 0 if len(jacobians) == 1 else -(-len(order) // 2)
    figure = pyplot().figure(figsize=(11.2, height + 2.6 * rows + 0.8), layout="constrained")
    parts = figure.subfigures(2, 1, height_ratios=(height, 2.6 * rows)) if rows else [figure]
    left, right = parts[0].subplots(1, 2)
    font = {"size": 11 if n <= 6 else 8}
    draw_map(left, found, found.information.correlation, found.space.free_names, "correlation of estimates",
             vmin=-1, vmax=1, cmap="vlag", annot=True, fmt=".2f", annot_kws=font, square=True)  # fmt: skip
    axes = list(parts[1].subplots(rows, 2, squeeze=False).flat) if rows else [right]
    if rows:
        # how much of the information on each parameter comes from each record
        squares = np.array([np.sum(j**2, axis=0) for j in jacobians])
        shares = 100 * squares / np.where(squares.sum(axis=0) > 0.0, squares.sum(axis=0), 1.0)
        files = [r.record.file.removesuffix(".csv") for r in found.replays]
        draw_map(right, found, shares, files, "share of the information [%]", vmin=0, vmax=100, cmap="Blues", fmt=".0f",
                 annot=len(files) <= 14, annot_kws={"size": 11 if len(files) <= 8 else 8})  # fmt: skip
    for axis, i in zip(axes, order, strict=False):
        draw_sensitivities(axis, found, i, jacobians[i])
    for axis in axes[len(order) :]:
        axis.set_visible(False)
    parts[-1].legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=min(n, 6), frameon=False)
    figure.suptitle(fill(f"{title(found)}: what the records see", 2 * LINE), fontsize="large")
    return figure


def telling(found: Examination, jacobians: list[Array]) -> list[int]:
    """Return the records that tell most, the most telling first, repeats of one manoeuvre once."""
    order = np.argsort([-np.sum(j**2) for j in jacobians], kind="stable")
    seen: dict[object, int] = {}
    for i in order:
        seen.setdefault(identity(found.replays[i].record.manoeuvre), int(i))
    return list(seen.values())[:MOST_RECORDS]


def draw_map(axis: Any, found: Examination, values: Array, rows: Sequence[str], label: str, **looks: Any) -> None:
    """Draw a map with numbers, (n_rows, n_free), names turned so that the longest stays off its neighbours."""
    import seaborn as sns

    names = found.space.free_names
    sns.heatmap(values, xticklabels=names, yticklabels=rows, cbar_kws={"label": label}, ax=axis, **looks)
    axis.tick_params(axis="both", labelrotation=0, length=0)
    if max(len(n) for n in names) > 8 or len(names) > 8:
        axis.set_xticklabels(names, rotation=30, ha="right", rotation_mode="anchor")


def draw_sensitivities(axis: Any, found: Examination, i: int, jacobian: Array) -> None:
    """Draw the sensitivities of one record, each scaled to its own largest: curves that look alike are collinear."""
    replay = found.replays[i]
    for j, name in enumerate(found.space.free_names):
        largest = float(np.abs(jacobian[:, j]).max())
        curve = jacobian[:, j] / largest if largest > 0.0 else jacobian[:, j]
        axis.plot(replay.times, curve, lw=1.7, label=name, **look(j))
    axis.axhline(0.0, color=GREY, lw=0.8, zorder=0)
    axis.set_title(f"{replay.record.file}: sensitivities, each scaled to 1", fontsize="medium")
    axis.set(xlabel="time [s]", ylabel="scaled, 1", ylim=(-1.08, 1.08))
    axis.margins(x=0.01)


def title(found: Examination) -> str:
    """Return campaign and model."""
    return f"{found.campaign.name}: {' + '.join([found.model.plant.name, *(e.name for e in found.model.effects)])}"
