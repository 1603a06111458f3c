"""Figures of an identification: the fit of each record, the search, and ellipses of pairs of parameters."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from armid.estimation.identify import Identification
from armid.estimation.information import Information
from armid.model import Array
from armid.problem.fitness import SIMILARITIES
from armid.problem.problem import Replay, judged_by
from armid.problem.space import Space
from armid.report.document import points, record_axes, small_axes
from armid.report.style import GREY, OKABE_ITO, PALE, entitle, legend_below, panels, pyplot
from armid.units import labelled, scale_of, shown

MOST_FITS_DRAWN = 8
MOST_PAIRS = 6
# Title and caption of the ellipses.
PAIRS = (
    "Pairs of parameters",
    "The most correlated pairs: an ellipse holds both true values in 95 % of all cases, if the intervals hold. Narrow "
    "ones: a change of one parameter is made up for by the other.",
)
# Half axis of the 95 % ellipse of two normal variables, in standard deviations: root of chi2 of 2 degrees of freedom.
ELLIPSE = 2.4477


def figures_of(identification: Identification) -> dict[str, Callable[[], Any]]:
    made: dict[str, Callable[[], Any]] = {"fit": lambda: fit_figure(identification)}
    made |= {"convergence": lambda: convergence_figure(identification)} if len(identification.trace[0]) else {}
    own = identification.candidate[identification.space.free], identification.campaign.truth
    draws = None if identification.scatter is None else identification.scatter.draws
    return made | pairs_of(identification.campaign.name, identification.space, identification.information, *own, draws)


def fit_figure(identification: Identification) -> Any:
    replays = chosen(identification)
    figure, axes = record_axes(len(replays), 4.4, (3, 1.4))
    for pair, replay in zip(axes, replays, strict=True):
        factor, unit = shown(1.0, replay.record.unit)
        curves = curves_of(replay, identification.candidate)
        rms = factor * np.sqrt(np.mean(curves["residual"] ** 2))
        pair[0].set_title(f"{replay.name} ({replay.record.role}), RMSE {rms:.3g} {unit}", fontsize="medium")
        draw_record(pair, {name: (replay.times, y) for name, y in curves.items()}, replay.record.unit)
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="lower center", ncols=2, frameon=False)
    there_are = len(identification.replays)
    model = " + ".join([identification.model.plant.name, *(e.name for e in identification.model.effects)])
    some = "" if len(replays) == there_are else f" ({len(replays)} of {there_are} records)"
    search = f"{identification.identifier} on {identification.fitness.name}"
    entitle(figure, f"{identification.campaign.name}: {model}, {search}{some}", "large")
    return figure


def curves_of(replay: Replay, candidate: Array) -> dict[str, Array]:
    measured, simulated = replay.measured, replay.signal(candidate[np.newaxis])[0]
    return {"measured": measured, "simulated": simulated, "residual": measured - simulated}


def chosen(identification: Identification) -> list[Replay]:
    """Return the records that are drawn: the first of each role where there are too many."""
    train, holdout = list(identification.train_replays), list(identification.holdout_replays)
    n_holdout = min(len(holdout), max(MOST_FITS_DRAWN // 2, MOST_FITS_DRAWN - len(train)))
    return train[: MOST_FITS_DRAWN - n_holdout] + holdout[:n_holdout]


def record_figure(curves: Mapping[str, Mapping[str, Any]], unit: str) -> Any:
    """Draw a stored record for a page. curves: those of `details.json`."""
    figure, pair = small_axes(6.0, 4.0, (3, 1.4))
    draw_record(pair, {name: points(curve) for name, curve in curves.items()}, unit)
    pair[0].legend(frameon=False, fontsize="small")
    return figure


def draw_record(axes: Sequence[Any], curves: Mapping[str, Any], si_unit: str) -> None:
    (upper, lower), (factor, unit) = axes, shown(1.0, si_unit)
    looks = {"measured": {"color": OKABE_ITO["black"], "lw": 1.6},
             "simulated": {"color": OKABE_ITO["vermilion"], "lw": 1.3, "ls": "--"}}  # fmt: skip
    for name, look in looks.items():
        x, y = curves[name]
        upper.plot(x, factor * y, label=name, **look)
    x, y = curves["residual"]
    lower.axhline(0.0, color=GREY, lw=0.8)
    lower.plot(x, factor * y, color=OKABE_ITO["blue"], lw=0.8)
    upper.set_ylabel(f"{'speed' if si_unit in ('rad/s', 'm/s') else 'signal'} [{unit}]")
    upper.tick_params(labelbottom=False)
    lower.set(ylabel=f"residual\n[{unit}]", xlabel="time [s]")
    for axis in axes:
        axis.margins(x=0.01)


def convergence_figure(identification: Identification) -> Any:
    """Draw the best fitness, or for a similarity its degree, against the number of simulations."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    similarity = identification.fitness.name.partition(":")[0] in SIMILARITIES
    evaluations, values = identification.trace
    x, y = np.append(evaluations, identification.used), np.append(values, values[-1:])
    figure, axis = pyplot().subplots(figsize=(6.8, 4.2), layout="constrained")
    # the SI unit of a fitness that has that of the signal, "" for another, or for one of several outputs
    units = {r.record.unit for r in judged_by(identification.fitness, identification.train_replays)}
    si_unit = next(iter(units)) if identification.fitness.unit == "signal" and len(units) == 1 else ""
    factor, unit = shown(1.0, si_unit) if si_unit else (1.0, "")
    height = 1.0 - y if similarity else y * factor
    axis.step(x, height, where="post", color=OKABE_ITO["blue"], lw=1.8)
    if not similarity and np.min(y) > 0.0:
        # plain numbers at 1, 2, 5
        axis.set_yscale("log")
        axis.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.yaxis.set_minor_formatter(StrMethodFormatter("{x:g}"))
    named = labelled(identification.fitness.name, unit)
    axis.set(ylabel="similarity degree of the best" if similarity else f"best {named}", xlabel="simulations")
    text = f"{identification.identifier}, seed {identification.seed}, ends at {height[-1]:.6g} {unit}".rstrip()
    axis.set_title(f"{identification.campaign.name}: {text}", fontsize="medium")
    return figure


def pairs_of(
    campaign: str, space: Space, information: Information, x: Array, truth: Mapping[str, float],
    draws: Array | None = None,
) -> dict[str, Callable[[], Any]]:  # fmt: skip
    """Return what draws ellipses, by the name of the figure; nothing where no two parameters are determined.

    x: SI, (n_free,). draws: estimates of a bootstrap, whose scatter decides then, SI, (n_draws, n_free). truth: known
    true values, SI.
    """
    covariance = information.correlation * np.outer(information.deviation, information.deviation)
    draws = None if draws is None or len(draws) < 2 else draws
    if draws is not None:
        covariance = np.atleast_2d(np.cov(draws.T))
    known = np.flatnonzero(np.isfinite(np.diag(covariance)) & (np.diag(covariance) > 0.0)).tolist()
    if len(known) < 2:
        return {}
    return {"pairs": partial(pair_figure, campaign, space, covariance, known, x, truth, draws)}


def pair_figure(
    campaign: str, space: Space, covariance: Array, known: Sequence[int], x: Array, truth: Mapping[str, float],
    draws: Array | None,
) -> Any:  # fmt: skip
    """Draw the 95 % ellipses of the pairs that are correlated most, see `pairs_of`."""
    units = [unit for unit, free in zip(space.units, space.free, strict=True) if free]
    scales = [scale_of(unit, value) for unit, value in zip(units, x, strict=True)]
    labels = [labelled(name, unit) for name, (unit, _) in zip(space.free_names, scales, strict=True)]
    factor, deviation = np.array([factor for _, factor in scales]), np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):  # of those that are not known
        correlation = covariance / np.outer(deviation, deviation)
    true = np.array([truth.get(name, np.nan) for name in space.free_names])
    layers = [(x, {"marker": "o", "color": OKABE_ITO["blue"], "ms": 5, "label": "estimate"})]
    if draws is not None:
        layers += [(draws, {"marker": ".", "color": PALE, "ms": 3, "zorder": 0, "label": "draws of the noise"})]
    if not np.isnan(true).all():
        layers += [(true, {"marker": "*", "color": OKABE_ITO["black"], "ms": 10, "label": "true value"})]
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    pairs = sorted(combinations(known, 2), key=lambda pair: -abs(correlation[pair]))[:MOST_PAIRS]
    figure, axes = panels(len(pairs), 3, 3.8, 3.4)
    for axis, pair in zip(axes, map(list, pairs), strict=True):
        r = correlation[tuple(pair)]
        ring = np.array([np.cos(angle), r * np.cos(angle) + np.sqrt(max(1.0 - r**2, 0.0)) * np.sin(angle)]).T
        ellipse = factor[pair] * (x[pair] + ELLIPSE * deviation[pair] * ring)
        axis.fill(*ellipse.T, fc="none", ec=OKABE_ITO["blue"], lw=1.6, label="95 % ellipse")
        for values, look in layers:
            axis.plot(*(factor * np.atleast_2d(values))[:, pair].T, ls="", **look)
        axis.set(xlabel=labels[pair[0]], ylabel=labels[pair[1]])
        axis.ticklabel_format(useOffset=False)
        axis.locator_params(nbins=3)
        axis.tick_params(axis="x", labelrotation=30, labelsize="small")  # values may have five digits
        axis.set_title(f"correlation {r:+.3f}", fontsize="small")
    legend_below(figure, 4)
    figure.suptitle(f"{campaign}: pairs of parameters", fontsize="medium")
    return figure
