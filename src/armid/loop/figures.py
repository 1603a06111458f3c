"""The figures there are: file name -> what draws it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.loop.diagnose import Diagnosis, Residuals
from armid.loop.missing_signal import Dependence, Missing, hats
from armid.loop.result import ClosedLoop, Estimate
from armid.report.style import GREY, OKABE_ITO, style
from armid.report.style import save as save_figure
from armid.units import SHOWN, shown

BEFORE, AFTER = OKABE_ITO["vermilion"], OKABE_ITO["blue"]


def tidy(axis: Any) -> None:
    """Leave only the axes that are read."""
    axis.spines[["top", "right"]].set_visible(False)


def save(plt: Any, figure: Any, path: Path) -> None:
    """Write a figure and forget it."""
    save_figure(figure, path)


MOST_RECORDS = 8


def residual_figure(found: ClosedLoop, path: Path) -> None:
    """Draw measured minus simulated of each record, before and after, with the noise as a band."""
    plt = style()
    rows = [r for name in ("train", "holdout") for r in pairs(getattr(found.before, name), getattr(found.after, name))]
    shown = rows[-MOST_RECORDS:] if len(rows) > MOST_RECORDS else rows
    columns = 1 if len(shown) == 1 else 2
    high = -(-len(shown) // columns)
    figure, axes = plt.subplots(high, columns, figsize=(6.8 * columns, 2.9 * high + 0.9), squeeze=False,
                                layout="constrained")  # fmt: skip
    for axis, row in zip(axes.flat, shown, strict=False):
        draw(axis, found, *row)
    for axis in axes.flat[len(shown) :]:
        axis.set_visible(False)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    names = " + ".join(found.effects) or "no effect added"
    figure.suptitle(f"{found.campaign.name}: residual before and after ({names})", fontsize="large")
    save(plt, figure, path)


def pairs(before: Residuals | None, after: Residuals | None) -> list[tuple[Any, ...]]:
    """Return record, times and residuals before and after, of each record."""
    if before is None or after is None:
        return []
    return [(r.record, r.times, b, a) for r, b, a in zip(before.replays, before.raw, after.raw, strict=True)]


def draw(axis: Any, found: ClosedLoop, record: Any, times: Any, before: Any, after: Any) -> None:
    """Draw one record."""
    unit, factor = SHOWN[found.campaign.unit]
    noise = factor * found.noise_rms
    axis.axhspan(-2.0 * noise, 2.0 * noise, color=GREY, alpha=0.35, lw=0, label="noise, 2 sigma")
    axis.plot(times, factor * before, color=BEFORE, lw=1.0, label="before")
    axis.plot(times, factor * after, color=AFTER, lw=0.8, label="after")
    errors = [factor * float(np.sqrt(np.mean(x**2))) for x in (before, after)]
    axis.set_title(f"{record.file} ({record.role}), RMSE {errors[0]:.3g} to {errors[1]:.3g} {unit}", fontsize="medium")
    axis.set_ylabel(f"residual [{unit}]")
    axis.set_xlabel("time [s]")
    axis.margins(x=0.01)
    tidy(axis)


KINDS = {"record": "record", "stage": "stage of the motion", "frequency": "frequency", "dependence": "dependence on"}


def diagnosis_figure(found: ClosedLoop, path: Path) -> None:
    """Draw the mean square of the residual in units of the noise's, part by part."""
    plt = style()
    kinds = [k for k in KINDS if found.before.diagnosis.of_kind(k)]
    rows = -(-len(kinds) // 2)
    figure, axes = plt.subplots(rows, 2, figsize=(11.0, 3.9 * rows + 0.8), squeeze=False, layout="constrained")
    for axis, kind in zip(axes.flat, kinds, strict=False):
        draw_findings(axis, kind, found.before.diagnosis, found.after.diagnosis)
    for axis in axes.flat[len(kinds) :]:
        axis.set_visible(False)
    of = "noise" if found.before.diagnosis.noise_known else "the residual"
    figure.supylabel(f"mean square / that of {of}", fontsize="medium")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(f"{found.campaign.name}: where the discrepancy is (1 is noise)", fontsize="large")
    save(plt, figure, path)


def draw_findings(axis: Any, kind: str, before: Diagnosis, after: Diagnosis) -> None:
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


MOST_SHOWN = 14


def ranking_figure(found: ClosedLoop, path: Path) -> None:
    """Draw the predicted fall of chi2 of each candidate, as a share, and that of its full fit where there was one."""
    plt = style()
    start = found.before.fit
    best: dict[str, float] = {}
    for s in found.search.scores_at(start):
        name = s.key.public
        best[name] = max(best.get(name, 0.0), s.drop / start.chi2)
    names = sorted(best, key=lambda n: -best[n])[:MOST_SHOWN]
    fitted: dict[str, float] = {}
    for fit in found.search.of_size(1):
        name = fit.active[0].public
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


Array = NDArray[np.float64]
MOST_LAGS = 150


def autocorrelation_figure(found: ClosedLoop, path: Path) -> None:
    """Draw the autocorrelation of the whitened residual of the train records, with the 95 % band of white noise."""
    plt = style()
    figure, axis = plt.subplots(figsize=(6.8, 3.6), layout="constrained")
    interval = found.campaign.train[0].manoeuvre.interval
    for judged, colour, name in ((found.before, BEFORE, "before"), (found.after, AFTER, "after")):
        values = correlation(judged.train)
        axis.plot(1e3 * interval * np.arange(len(values)), values, color=colour, lw=1.6, label=name)
    band = 1.96 / np.sqrt(len(found.after.train.residual))
    axis.axhspan(-band, band, color=GREY, alpha=0.35, lw=0, label="white noise, 95 %")
    axis.set_xlabel("lag [ms]")
    axis.set_ylabel("autocorrelation")
    axis.set_title(f"{found.campaign.name}: whitened residual of the train records", fontsize="medium")
    axis.legend(frameon=False)
    axis.margins(x=0.01)
    tidy(axis)
    save(plt, figure, path)


def correlation(view: Residuals) -> Array:
    """Return the autocorrelation at lags from 0 on, pooled over records, (n_lags,)."""
    parts = view.data.by_record(view.residual)
    lags = min(MOST_LAGS, *(len(p) - 1 for p in parts))
    table = [[float(p[: len(p) - k] @ p[k:]) for k in range(lags)] for p in parts]
    total = np.sum(table, axis=0)
    return np.asarray(total / total[0])


MOST_VARIABLES = 5


def missing_figure(found: ClosedLoop, path: Path) -> None:
    """Draw the shares at the ports, and the signal at the best of them against each variable of the motion."""
    plt, missing = style(), found.missing
    assert missing is not None
    best = found.term.dependence if found.term is not None else missing.dependences[0]
    variables = [best.variable, *(v for v in missing.moved[0].variables if v != best.variable)][:MOST_VARIABLES]
    columns = (len(variables) + 2) // 2
    figure, axes = plt.subplots(2, columns, figsize=(4.0 * columns, 6.4), squeeze=False, layout="constrained")
    share_panel(axes.flat[0], missing)
    for axis, variable in zip(axes.flat[1:], variables, strict=False):
        signal_panel(axis, missing, best, variable)
    for axis in axes.flat[1 + len(variables) :]:
        axis.set_axis_off()
    figure.suptitle(f"{found.campaign.name}: the missing signal, recovered without a form at port {best.port}\n"
                    "(less what the free parameters can take up)", fontsize="medium")  # fmt: skip
    save(plt, figure, path)


def share_panel(axis: Any, missing: Missing) -> None:
    """Draw what a free signal removes at each port, and what the best curve there predicts on left-out parts."""
    ports = [s.port for s in missing.signals]
    curves = [max((d.share for d in missing.dependences if d.port == p), default=0.0) for p in ports]
    rows = np.arange(len(ports))
    axis.barh(rows - 0.19, [max(100.0 * s.share, 0.0) for s in missing.signals], 0.36, color=OKABE_ITO["sky"],
              label="free signal: removes")  # fmt: skip
    axis.barh(rows + 0.19, [max(100.0 * c, 0.0) for c in curves], 0.36, color=AFTER, label="best curve: predicts")
    axis.set_yticks(rows, ports)
    axis.invert_yaxis()
    axis.set_xlim(0, 100)
    axis.set_xlabel("share of the squared residual [%]")
    axis.legend(fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    tidy(axis)


def signal_panel(axis: Any, missing: Missing, best: Dependence, variable: str) -> None:
    """Draw the signal of every record against one variable, with the curve where it is the one that was fitted."""
    model, signal = missing.lacking.records.replays[0].model, missing.signal_at(best.port)
    colours = list(OKABE_ITO.values())
    if signal is not None:
        for motion, values in zip(missing.moved, signal.signals, strict=True):
            place = shown_values(motion.variables[variable], unit_of(variable, model))
            axis.plot(place, values, ".", ms=3, color=colours[motion.segment.group % len(colours)])
    if signal is not None and variable == best.variable and best.factor == "1":
        knots = np.linspace(best.first, best.last, len(best.heights))
        seen = np.concatenate([m.variables[variable] for m in missing.moved])
        heights = np.linalg.lstsq(hats(seen, best.first, best.last), np.concatenate(signal.signals), rcond=None)[0]
        axis.plot(shown_values(knots, unit_of(variable, model)), heights, "-", color="black", label="curve through it")
        axis.legend(fontsize="small")
    name = shown(0.0, unit_of(variable, model))[1]
    axis.set_xlabel(f"{variable} [{name}]")
    axis.set_ylabel(f"missing at {best.port} [{model.plant.ports[best.port]}]")
    tidy(axis)


def unit_of(variable: str, model: Any) -> str:
    """Return the unit of a variable of the motion."""
    units = {s.name: s.unit for s in model.plant.states} | {i.name: i.unit for i in model.plant.inputs}
    return str(units.get(variable, "s" if variable == "time" else model.plant.scales.effort_unit))


def shown_values(values: Any, unit: str) -> Any:
    """Return values in the unit that people read."""
    return values * shown(1.0, unit)[0]


FIGURES: dict[str, Callable[[ClosedLoop, Path], None]] = {
    "residuals.png": residual_figure,
    "diagnosis.png": diagnosis_figure,
    "ranking.png": ranking_figure,
    "parameters.png": shift_figure,
    "autocorrelation.png": autocorrelation_figure,
}

MISSING = {"missing.png": missing_figure}


def figures_of(found: ClosedLoop) -> dict[str, Callable[[ClosedLoop, Path], None]]:
    """Return the figures that a result has: that of a missing signal only where one was sought."""
    return FIGURES | (MISSING if found.missing is not None else {})
