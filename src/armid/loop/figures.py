"""Figures of a closed loop: residuals, where they are, candidates, parameters, the missing signal."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from textwrap import fill
from typing import Any

import numpy as np

from armid.estimation.corrections import rms
from armid.inference.checks import Residuals
from armid.inference.kinds.missing_signal import Dependence, Missing, hats
from armid.loop.result import ClosedLoop, Judgement
from armid.model import Array
from armid.problem.problem import Replay
from armid.report.document import points, record_axes, small_axes, value_text
from armid.report.style import COLOURS, GREY, OKABE_ITO, PALE, entitle, legend_below, log_axis, panels, pyplot
from armid.units import labelled, scale_of, shown

AFTER = OKABE_ITO["blue"]
LOOKS = (("before", OKABE_ITO["vermilion"]), ("after", AFTER))
# Where nothing was added, before and after are one.
UNCHANGED = ("declared model", AFTER)
COLOUR_OF = dict((*LOOKS, UNCHANGED))
KINDS_OF_TEST = {
    "record": "record",
    "stage": "stage of the motion",
    "frequency": "frequency",
    "dependence": "dependence on",
}
MOST_RECORDS_DRAWN, MOST_BARS, MOST_LAGS_DRAWN, MOST_VARIABLES = 8, 14, 150, 5
# Of the mean residual over a variable, and the least bar of the diagnosis.
MOST_BINS, LEAST_RATIO = 30, 1e-3
PARAMETERS_A_ROW = 4


def figures_of(loop: ClosedLoop, report: Mapping[str, Any], details: Mapping[str, Any]) -> dict[str, Callable[[], Any]]:
    """Return name -> what draws a figure: that of a missing signal only where one was sought.

    report, details: what is stored of the loop, see `report_of` and `details_of`.
    """
    made: dict[str, Callable[[], Any]] = {
        "motion": partial(motion_figure, loop),
        "residuals": partial(residual_figure, loop),
        "diagnosis": partial(diagnosis_figure, loop),
        "probabilities": partial(probability_figure, report["campaign"], report["probabilities"]),
        "intervals": partial(interval_figure, report["campaign"], details["models"], report["parameters"]["after"]),
        "parameters": partial(parameter_figure, report["campaign"], report["parameters"], loop.campaign.truth),
        "autocorrelation": partial(autocorrelation_figure, loop),
    }
    made |= {"against": partial(against_figure, loop)} if moved(loop) else {}
    return made if loop.missing is None else made | {"missing": partial(missing_figure, loop, loop.missing)}


def drawn_of(loop: ClosedLoop) -> list[tuple[str, str, Judgement]]:
    """Return the models that are drawn, each with its name and colour: the declared one alone where nothing is new."""
    if loop.before is loop.after:
        return [(*UNCHANGED, loop.after)]
    return [(*look, judged) for look, judged in zip(LOOKS, (loop.before, loop.after), strict=True)]


def shown_records(loop: ClosedLoop) -> list[tuple[Replay, list[Array]]]:
    """Return the records that are drawn, each with its residual by each model that is drawn."""
    judged = [j for *_, j in drawn_of(loop)]
    views = ([j.train for j in judged], [j.holdout for j in judged if j.holdout is not None])
    return [(replay, list(raw)) for view in views if view
            for replay, *raw in zip(view[0].replays, *(v.raw for v in view), strict=True)
            ][-MOST_RECORDS_DRAWN:]  # fmt: skip


def names_of(loop: ClosedLoop, what: str) -> str:
    """Return what figures of records are titled."""
    added = " + ".join(loop.effects) or "faults of records undone"
    return f"{what}, declared model" if loop.before is loop.after else f"{what}, before and after ({added})"


def motion_figure(loop: ClosedLoop) -> Any:
    """Draw the measured motion of each record, and the simulated one."""
    rows = shown_records(loop)
    figure, axes = record_axes(len(rows), 2.9)
    for (axis,), (replay, residuals) in zip(axes, rows, strict=True):
        factor, unit = shown(1.0, replay.record.unit)
        axis.plot(replay.times, factor * replay.measured, color=PALE, lw=3.5, label="measured")
        for residual, (name, colour, _) in zip(residuals, drawn_of(loop), strict=True):
            axis.plot(replay.times, factor * (replay.measured - residual), color=colour, lw=1.1, label=name)
        axis.set(ylabel=f"{replay.record.output or 'output'} [{unit}]", xlabel="time [s]")
        axis.margins(x=0.01)
        axis.set_title(f"{replay.name} ({replay.record.role})", fontsize="medium")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="lower center", ncols=3, frameon=False)
    entitle(figure, f"{loop.campaign.name}: {names_of(loop, 'measured and simulated')}")
    return figure


def residual_figure(loop: ClosedLoop) -> Any:
    """Draw measured minus simulated of each record, with the noise as a band."""
    rows, names = shown_records(loop), [name for name, *_ in drawn_of(loop)]
    figure, axes = record_axes(len(rows), 2.9)
    for (axis,), (replay, residuals) in zip(axes, rows, strict=True):
        curves = {name: (replay.times, residual) for name, residual in zip(names, residuals, strict=True)}
        factor, unit = shown(1.0, replay.record.unit)
        noise = loop.outputs.get(replay.record.output, {"noise_rms": loop.noise_rms})["noise_rms"]
        draw_residuals(axis, curves, noise, replay.record.unit)
        errors = [f"{factor * rms(x):.3g}" for x in residuals]
        title = f"{replay.name} ({replay.record.role}), RMSE {' to '.join(errors)} {unit}"
        axis.set_title(title, fontsize="medium")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="lower center", ncols=3, frameon=False)
    entitle(figure, f"{loop.campaign.name}: {names_of(loop, 'residual')}")
    return figure


def record_figure(record: Mapping[str, Any], unit: str) -> Any:
    """Draw a stored record for a page, before and after as layers. record: of `details.json`."""
    figure, (axis,) = small_axes(6.0, 2.5)
    curves = {name: points(curve) for name, curve in record["curves"].items()}
    draw_residuals(axis, curves, record["noise_rms"], unit)
    return figure


def draw_residuals(axis: Any, curves: Mapping[str, Any], noise: float | None, si_unit: str) -> None:
    factor, unit = shown(1.0, si_unit)
    if noise is not None:
        band = 2.0 * noise * factor
        axis.axhspan(-band, band, color=GREY, alpha=0.35, lw=0, label="noise, 2 sigma")
    for name, (x, y) in curves.items():
        axis.plot(x, factor * y, color=COLOUR_OF[name], lw=0.9, label=name, gid=name)
    axis.set(ylabel=f"residual [{unit}]", xlabel="time [s]")
    axis.margins(x=0.01)


def diagnosis_figure(loop: ClosedLoop) -> Any:
    """Draw a bar for each part of the residual, from 1, which is noise, to its mean square; the largest come first."""
    before, drawn = loop.before.diagnosis, drawn_of(loop)
    kinds = {k: sorted(before.of_kind(k), key=lambda f: -f.ratio) for k in KINDS_OF_TEST if before.of_kind(k)}
    heights = [len(findings) + 1 for findings in kinds.values()]
    size = (7.6, 0.34 * sum(heights) + 1.4)
    figure, axes = pyplot().subplots(len(kinds), 1, figsize=size, height_ratios=heights, squeeze=False, sharex=True,
                                     layout="constrained")  # fmt: skip
    for axis, (kind, findings) in zip(axes.flat, kinds.items(), strict=True):
        rows = np.arange(len(findings))
        for i, (label, colour, judged) in enumerate(drawn):
            ratios = {f.where: f.ratio for f in judged.diagnosis.of_kind(kind)}
            ends = np.array([ratios.get(f.where, 1.0) for f in findings])
            places = rows + 0.38 * (i - 0.5 * (len(drawn) - 1))
            axis.barh(places, np.maximum(ends, LEAST_RATIO) - 1.0, 0.36, left=1.0, color=colour, label=label)
        axis.axvline(1.0, color=GREY, lw=1.0)
        axis.set_yticks(rows, [f.where for f in findings], fontsize="small")
        axis.set_ylim(len(findings) - 0.5, -0.5)
        log_axis(axis)
        axis.set_title(KINDS_OF_TEST[kind], fontsize="medium", loc="left")
    of = "noise" if before.noise_known else "the residual"
    axes[-1, 0].set_xlabel(f"mean square / that of {of}")
    legend_below(figure, 2)
    entitle(figure, f"{loop.campaign.name}: where the discrepancy is (1 is noise)")
    return figure


def against_figure(loop: ClosedLoop) -> Any:
    """Draw the residual of the train records against speed and position, with its mean over equally many samples."""
    first = loop.before.train
    names, places, model = moved(loop), sorted({r.place for r in first.replays}), first.model
    figure, axes = panels(len(names) * len(places), len(names), 5.6, 3.6)
    for axis, (place, name) in zip(axes, product(places, names), strict=True):
        factor, unit = shown(1.0, model.plant.unit_of(name))
        height, signal_unit = shown(1.0, model.plant.outputs[place].unit)
        for label, colour, judged in drawn_of(loop):
            x, y = sorted_by(judged.train, name, place)
            axis.plot(factor * x, height * y, ".", ms=1.5, alpha=0.25, color=colour)
            means = [np.array([part.mean() for part in np.array_split(values, MOST_BINS)]) for values in (x, y)]
            axis.plot(factor * means[0], height * means[1], color=colour, lw=2.0, label=label)
        axis.axhline(0.0, color=GREY, lw=0.8)
        axis.set(xlabel=labelled(name, unit), ylabel=f"residual [{signal_unit}]")
    legend_below(figure, 2)
    entitle(figure, f"{loop.campaign.name}: residual against speed and position")
    return figure


def sorted_by(seen: Residuals, name: str, place: int) -> tuple[Array, Array]:
    """Return a variable and the residual of an output, samples that are no data left out, in the variable's order."""
    of = np.repeat([r.place for r in seen.replays], np.diff(seen.data.edges)) == place
    kept = np.flatnonzero(of & (seen.data.sound > 0.0))
    order = kept[np.argsort(seen.variables[name][kept], kind="stable")]
    return seen.variables[name][order], np.concatenate(seen.raw)[order]


def moved(loop: ClosedLoop) -> list[str]:
    """Return the names of the speed and the position of the plant, those that it has and that move."""
    seen = loop.before.train
    names = (seen.model.plant.aliases.get(a, a) for a in ("omega", "theta"))
    return [n for n in names if np.ptp(seen.variables.get(n, 0.0)) > 0.0]


def probability_figure(campaign: str, chances: Mapping[str, Any]) -> Any:
    """Draw the probability of each effect and fault, of nothing and of something unknown. chances: of `report.json`."""
    named = [(n, p, AFTER) for kind in ("effects", "records", "drifts") for n, p in chances[kind].items()]
    named = sorted(named, key=lambda row: -row[1])[:MOST_BARS]
    ends = (("nothing", OKABE_ITO["green"]), ("unknown", OKABE_ITO["vermilion"]))
    rows = [*named, *((n, chances[n], colour) for n, colour in ends)]
    figure, axis = pyplot().subplots(figsize=(6.8, 0.34 * len(rows) + 1.3), layout="constrained")
    axis.barh(range(len(rows)), [p for _, p, _ in rows], color=[c for *_, c in rows])
    for i, (_, p, _) in enumerate(rows):
        axis.text(p + 0.01, i, f"{p:.2f}", va="center", fontsize="small")
    axis.set_yticks(range(len(rows)), [n for n, *_ in rows])
    axis.invert_yaxis()
    axis.set(xlim=(0.0, 1.1), xticks=np.linspace(0.0, 1.0, 6), xlabel="probability")
    axis.set_title(f"{campaign}: what the declared model may lack", fontsize="medium")
    return figure


def interval_figure(campaign: str, models: Sequence[Mapping[str, Any]], averaged: Mapping[str, Any]) -> Any:
    """Draw each parameter by the most probable models and over all. models: of `details.json`."""
    names = [n for n, p in averaged.items() if p["low"] is not None and n in models[0]["parameters"]]
    columns = min(max(len(names), 1), PARAMETERS_A_ROW)
    rows = -(-max(len(names), 1) // columns)
    size = (2.6 * columns + 2.0, (0.3 * len(models) + 1.4) * rows + 0.5)
    figure, axes = pyplot().subplots(rows, columns, figsize=size, squeeze=False, layout="constrained", sharey=True)
    for axis in axes.flat[len(names) :]:
        axis.set_axis_off()
    labels = [fill(f"{m['model']} ({m['probability']:.2f})", 34) for m in models] + ["all models"]
    for axis, name in zip(axes.flat, names, strict=False):
        unit, factor = scale_of(averaged[name]["unit"], averaged[name]["value"])
        entries = [*(m["parameters"][name] for m in models), averaged[name]]
        for i, p in enumerate(entries):
            axis.errorbar([factor * p["value"]], [i], xerr=ends_of(p, factor), fmt="o", capsize=4,
                          color=AFTER if i == len(models) else GREY)  # fmt: skip
        axis.set_yticks(range(len(labels)), labels, fontsize="small")
        axis.set(xlabel=labelled(name, unit), ylim=(len(labels) - 0.5, -0.5))
        axis.ticklabel_format(axis="x", useOffset=False)
        axis.tick_params(axis="x", labelrotation=30, labelsize="small")
    entitle(figure, f"{campaign}: 95 % intervals by model, and over all")
    return figure


def ends_of(p: Mapping[str, Any], factor: float) -> list[list[float]]:
    """Return how far an interval reaches below and above its value, [[below], [above]]; 0 without an interval.

    The interval counts all models, and the value is that of one: it need not lie in the middle, nor inside.
    """
    if p["low"] is None or p["high"] is None:
        return [[0.0], [0.0]]
    return [[max(factor * (p["value"] - p["low"]), 0.0)], [max(factor * (p["high"] - p["value"]), 0.0)]]


def parameter_figure(campaign: str, parameters: Mapping[str, Mapping[str, Any]], truth: Mapping[str, float]) -> Any:
    """Draw each identified parameter before and after in % of its value after, those of effects after alone.

    parameters: of `report.json`; one whose value is 0 has no share. truth: true values that are known, SI.
    """
    before, after = parameters["before"], parameters["after"]
    entries = [(name, before.get(name), p) for name, p in after.items() if p["value"]
               and (p["low"] is not None or (name in before and before[name]["low"] is not None))]  # fmt: skip
    figure, axes = panels(max(len(entries), 1), PARAMETERS_A_ROW, 2.8, 3.0)
    for axis, (name, *pair) in zip(axes, entries, strict=False):
        value, factor = pair[1]["value"], 100.0 / abs(pair[1]["value"])
        for place, (p, (_, colour)) in enumerate(zip(pair, LOOKS, strict=True)):
            if p is None:
                continue
            axis.errorbar([place], [factor * (p["value"] - value)], yerr=ends_of(p, factor), fmt="o", color=colour,
                          capsize=5, mfc=colour if p["trusted"] else "white")  # fmt: skip
        if name in truth:
            axis.axhline(factor * (truth[name] - value), color=OKABE_ITO["black"], lw=1.0, ls="--")
        axis.set_xticks([0, 1], ["before", "after"])
        axis.set(xlim=(-0.6, 1.6), ylabel="deviation [%]")
        axis.set_title(f"{name}\n{value_text(pair[1] | {'low': None})}", fontsize="small")
    if not entries:
        axes[0].text(0.5, 0.5, "no parameter is free", ha="center", va="center")
        axes[0].set_axis_off()
    known = "; dashed: true" if any(name in truth for name, *_ in entries) else ""
    title = f"{campaign}: deviation from the value after, 95 % intervals (open: not trusted{known})"
    entitle(figure, title)
    return figure


def autocorrelation_figure(loop: ClosedLoop) -> Any:
    figure, axis = pyplot().subplots(figsize=(6.8, 3.6), layout="constrained")
    interval = loop.campaign.train[0].spacing
    for name, colour, judged in drawn_of(loop):
        values = correlation(judged.train)
        axis.plot(1e3 * interval * np.arange(len(values)), values, color=colour, lw=1.6, label=name)
    band = 1.96 / np.sqrt(len(loop.after.train.residual))
    axis.axhspan(-band, band, color=GREY, alpha=0.35, lw=0, label="white noise, 95 %")
    axis.set(xlabel="lag [ms]", ylabel="autocorrelation")
    axis.set_title(f"{loop.campaign.name}: whitened residual of the train records", fontsize="medium")
    axis.legend(frameon=False)
    axis.margins(x=0.01)
    return figure


def correlation(residuals: Residuals) -> Array:
    """Return the autocorrelation at lags from 0 on, pooled over records, (n_lags,)."""
    parts = residuals.data.by_record(residuals.residual)
    lags = min(MOST_LAGS_DRAWN, *(len(p) - 1 for p in parts))
    table = [[float(p[: len(p) - k] @ p[k:]) for k in range(lags)] for p in parts]
    total = np.sum(table, axis=0)
    return np.asarray(total / total[0])


def missing_figure(loop: ClosedLoop, missing: Missing) -> Any:
    best = missing.dependences[0]
    variables = [best.variable, *(v for v in missing.segments[0].variables if v != best.variable)][:MOST_VARIABLES]
    figure, axes = panels(1 + len(variables), (len(variables) + 2) // 2, 4.0, 3.2)
    share_panel(axes[0], missing)
    for axis, variable in zip(axes[1:], variables, strict=True):
        signal_panel(axis, missing, best, variable)
    figure.suptitle(f"{loop.campaign.name}: the missing signal, recovered without a form at port {best.port}\n"
                    "(less what the free parameters can take up)", fontsize="medium")  # fmt: skip
    return figure


def share_panel(axis: Any, missing: Missing) -> None:
    ports = [s.port for s in missing.signals]
    curves = [max((d.share for d in missing.dependences if d.port == p), default=0.0) for p in ports]
    rows = np.arange(len(ports))
    axis.barh(rows - 0.19, [max(100.0 * s.share, 0.0) for s in missing.signals], 0.36, color=OKABE_ITO["sky"],
              label="free signal: removes")  # fmt: skip
    axis.barh(rows + 0.19, [max(100.0 * c, 0.0) for c in curves], 0.36, color=AFTER, label="best curve: predicts")
    axis.set_yticks(rows, ports)
    axis.invert_yaxis()
    axis.set(xlim=(0, 100), xlabel="share of the squared residual [%]")
    axis.legend(fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


def signal_panel(axis: Any, missing: Missing, best: Dependence, variable: str) -> None:
    """Draw the signal of every record against one variable, with the curve where it is the one that was fitted."""
    model, signal = missing.lacking.records.replays[0].model, next(s for s in missing.signals if s.port == best.port)
    factor, name = shown(1.0, model.plant.unit_of(variable))
    largest = float(np.max(np.abs(np.concatenate(signal.signals)), initial=0.0))
    unit, scale = scale_of(model.plant.ports[best.port], largest)
    for segment, values in zip(missing.segments, signal.signals, strict=True):
        colour = COLOURS[segment.group % len(COLOURS)]
        axis.plot(factor * segment.variables[variable], scale * values, ".", ms=3, color=colour)
    if variable == best.variable and best.factor == "1":
        knots = np.linspace(best.first, best.last, len(best.heights))
        seen = np.concatenate([m.variables[variable] for m in missing.segments])
        heights = np.linalg.lstsq(hats(seen, best.first, best.last), np.concatenate(signal.signals), rcond=None)[0]
        axis.plot(factor * knots, scale * heights, "-", color="black", label="curve through it")
        axis.legend(fontsize="small")
    axis.set(xlabel=labelled(variable, name), ylabel=labelled(f"missing at {best.port}", unit))
