"""The document of an identification, and what of it is stored: result.json and details.json."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.estimation.identify import Errors, Identification, record_errors, versions_of
from armid.estimation.information import MISFIT, collinear
from armid.problem.fitness import SIMILARITIES
from armid.problem.problem import Replay
from armid.report.document import (
    ERROR_NOTE,
    MOST_RECORDS,
    Column,
    Document,
    Figure,
    Gallery,
    Section,
    Sentences,
    Table,
    Text,
    curve_entry,
    error_table,
    finite,
    listing,
    made_section,
    points,
    record_axes,
    records_note,
    rmse_text,
    small_axes,
    table,
    value_text,
)
from armid.report.style import GREY, OKABE_ITO, pyplot
from armid.units import SHOWN, shown

MOST_FITS_DRAWN = 8
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
    n_holdout = min(len(holdout), max(MOST_FITS_DRAWN // 2, MOST_FITS_DRAWN - len(train)))
    return train[: MOST_FITS_DRAWN - n_holdout] + holdout[:n_holdout]


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


Array = NDArray[np.float64]
PACKAGES = ("armid", "numpy", "scipy", "pandas", "numba", "pymoo", "nlopt")
# Figures that a page takes as they are stored: name -> title and caption.
FIGURES = {"convergence": ("The search", "Best so far against the number of simulations.")}
OLD = (
    "details.json is not in this folder: an earlier version of armid wrote it, so the curves, what is to be known, the "
    "settings and the command are not on this page; the same `armid identify` again writes them."
)
# S2 below the first with S1 above the second: landmarks that do not match, not signals that differ.
SHAPE_FALLS, NUMBERS_AGREE = 0.9, 0.95
# A least-squares step of more standard deviations than this: a search by another fitness ends within a few.
FAR_FROM_MINIMUM = 4.0
# A mean square on held-out records of more times that on the fitted ones than this.
CARRIES_OVER = 1.5
# Of more records than this one sentence tells.
MOST_NAMED = 6


def identify_document(
    result: Mapping[str, Any], details: Mapping[str, Any], svgs: Mapping[str, str], again: str
) -> Document:
    """Build the document of an identification from what is stored of it.

    Parameters
    ----------
    result, details : dict
        result.json and details.json (empty where an earlier version of armid wrote none).
    svgs : dict
        Name -> SVG of those of `FIGURES` that are stored.
    again : str
        The command that makes the page again.
    """
    unit = result["unit"]
    parameters, errors = parameter_table(result), train_and_holdout(result)
    said = [text for text in details.get("remarks", ()) if text not in details["warnings"]]
    remarks = (Sentences(tuple(said)),) if said else ()
    correlated = (correlation_table(result["correlation"]),) if len(result["correlation"]) > 1 else ()
    each = [(file, e["role"], e) for file, e in result["error_by_record"].items()]
    value = result["fitness_value"]
    search = [
        ("identifier", result["identifier"]),
        ("fitness", f"{result['fitness']}, at the end {'not finite' if value is None else format(value, '.6g')}"),
        ("simulations", f"{result['used']} of {result['budget']}"), ("diverged", str(result["failed"])),
        ("seed", str(result["seed"])), ("stopped", result["stopped"]),
        ("engine's error [rad/s or m/s]", f"{result['engine_error']:.2g}"),
    ]  # fmt: skip
    figures = tuple(Figure(name, *FIGURES[name], svg=svg) for name, svg in svgs.items())
    sections = (
        Section("Parameters", (parameters, *correlated)),
        *(Section("What must be known", (part,)) for part in remarks),
        Section("Errors", (errors, error_table("Each record", ["record", "role"], each, unit))),
        *([fit_section(details, unit)] if details else []),
        Section("Search", (table("How it went", ["what", "value"], search), *figures)),
        Section("Equations", (listing("The model that was identified", result["model"]),)),
        made_section(details.get("made_by", {}), result["versions"], again),
    )
    effects = f" with {', '.join(result['effects'])}" if result["effects"] else ""
    ended = f"{result['used']} of {result['budget']} simulations used, {result['stopped']}; seed {result['seed']}."
    return Document(
        result["campaign"], "Identification", f"Which parameters of {result['plant']}{effects} do these records show?",
        answer(result, details), sections, warning="" if details else OLD,
        main=(parameters, errors, *remarks, Text(ended)),
    )  # fmt: skip


def answer(result: Mapping[str, Any], details: Mapping[str, Any]) -> tuple[str, ...]:
    """Return parameters, errors, and what stands against them."""
    free = {name: p for name, p in result["parameters"].items() if p["bound_low"] is not None}
    first = "; ".join(f"{name} = {value_text(p)}" for name, p in free.items()) + "." if free else "Nothing was free."
    train, holdout = result["error"]["train"], result["error"]["holdout"]
    out = "no record was held out"
    if holdout is not None:
        out = f"{rmse_text(holdout, result['unit'])} on those held out"
    noise, unit = shown(float(np.mean([n["rms"] for n in result["noise"].values()])), result["unit"])
    second = (f"Error (RMSE): {rmse_text(train, result['unit'])} {unit} on the records fitted, {out}; "
              f"the noise is {noise:.3g} {unit}.")  # fmt: skip
    held = [name for name, p in free.items() if p["bound_active"]]
    lost = [name for name, p in free.items() if p["low"] is None]
    doubts = [f"Held by a bound, and not to be trusted: {', '.join(held)}."] if held else []
    doubts += [f"Not determined by these records: {', '.join(lost)}."] if lost else []
    doubts += details.get("warnings", ())
    trusted = "No parameter is held by a bound, and the search has come to the minimum." if free else ""
    third = " ".join(doubts) or trusted
    return (first, second, third) if third else (first, second)


def parameter_table(result: Mapping[str, Any]) -> Table:
    """Return the parameters: value, unit, 95 % interval, bounds, remark."""
    rows = []
    for name, p in result["parameters"].items():
        unit, factor = SHOWN.get(p["unit"], (p["unit"], 1.0))
        if p["bound_low"] is None:
            rows.append((name, factor * p["value"], unit, "", "", "fixed"))
            continue
        interval = "not determined" if p["low"] is None else f"{factor * p['low']:.6g} to {factor * p['high']:.6g}"
        bounds = f"{factor * p['bound_low']:.4g} to {factor * p['bound_high']:.4g}"
        rows.append((name, factor * p["value"], unit, interval, bounds, "AT ITS BOUND" if p["bound_active"] else ""))
    value, remark = Column("value", "value", ".6g"), Column("remark", "")
    return table("Parameters", ["parameter", value, "unit", "95 % interval", "bounds", remark], rows)


def correlation_table(correlation: Mapping[str, Mapping[str, float | None]]) -> Table:
    """Return the correlations of the estimates."""
    rows = [(name, *row.values()) for name, row in correlation.items()]
    note = "Near +1 or -1: a change of one is made up for by the other."
    columns = ["parameter", *(Column(name, name, "+.3f") for name in correlation)]
    return table("Correlation of the estimates", columns, rows, note)


def train_and_holdout(result: Mapping[str, Any]) -> Table:
    roles = [e["role"] for e in result["error_by_record"].values()]
    rows = [(f"{role}: none" if e is None else f"{role} ({roles.count(role)})", e)
            for role, e in result["error"].items()]  # fmt: skip
    return error_table("Errors", ["records"], rows, result["unit"], ERROR_NOTE)


def fit_section(details: Mapping[str, Any], unit: str) -> Section:
    figures = tuple(
        Figure(f"r{i}", f"{r['file']} ({r['role']})", "", partial(record_figure, r["curves"], unit))
        for i, r in enumerate(details["records"])
    )  # fmt: skip
    text = (
        "Measured and simulated speed, the residual (measured minus simulated) below. Of long records the least and "
        "the largest sample of each short interval are drawn. "
    )
    gallery = Gallery(figures, name="fit")
    return Section("Fit of each record", (gallery,), text + records_note(len(figures), details["n_records"]))


def result_of(found: Identification) -> dict[str, Any]:
    """Return everything of an identification that JSON can hold, SI throughout; what is not known is null."""
    names, correlation = found.information.names, found.information.correlation
    replays = (*found.train_replays, *found.holdout_replays)
    by_record = {r.record.file: {"role": r.record.role, **errors(record_errors(r, found.candidate))} for r in replays}
    noises = {r.record.file: r.record.noise for r in replays}
    return {
        "campaign": found.campaign.name,
        "plant": found.model.plant.name,
        "effects": [e.name for e in found.model.effects],
        "parameters": {name: entry(found, i) for i, name in enumerate(found.space.names)},
        "error": {"train": errors(found.train), "holdout": None if found.holdout is None else errors(found.holdout)},
        "error_by_record": by_record,
        "correlation": {a: {b: finite(correlation[i, j]) for j, b in enumerate(names)} for i, a in enumerate(names)},
        "unit": found.campaign.unit,
        "fitness": found.fitness.name,
        "fitness_value": finite(found.value),
        "identifier": found.identifier,
        "budget": found.budget,
        "used": found.used,
        "failed": found.n_failed,
        "stopped": found.stopped,
        "seed": found.seed,
        "noise": {file: {"rms": n.rms, "mean": n.mean, "source": n.source} for file, n in noises.items()},
        "engine_error": max(r.engine_error for r in found.train_replays),
        "model": str(found.model),
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Return package -> version, of Python too."""
    return versions_of(PACKAGES)


def entry(found: Identification, i: int) -> dict[str, Any]:
    """Return value, interval, bounds and flag of one parameter; a fixed one has neither interval nor bounds."""
    space, value, ends = (
        found.space,
        float(found.candidate[i]),
        dict.fromkeys(("low", "high", "bound_low", "bound_high")),
    )
    if space.free[i]:
        half = found.information.half_width[found.information.names.index(space.names[i])]
        ends = {"low": finite(value - half), "high": finite(value + half),
                "bound_low": float(space.low[i]), "bound_high": float(space.high[i])}  # fmt: skip
    return {"value": value, "unit": space.units[i], **ends, "bound_active": bool(found.at_bound[i])}


def errors(found: Errors) -> dict[str, float | None]:
    """Return errors with null for what is not finite."""
    return {k: finite(v) for k, v in asdict(found).items()}


def details_of(found: Identification) -> dict[str, Any]:
    """Return details as JSON can hold them, SI; the command adds `made_by`, its line and options.

    Of long records each curve keeps the samples that `thinned` chooses.
    """
    replays, records = (*found.train_replays, *found.holdout_replays), []
    for replay in replays[:MOST_RECORDS]:
        measured, simulated = replay.measured, replay.signal(found.candidate[np.newaxis])[0]
        curves = {"measured": measured, "simulated": simulated, "residual": measured - simulated}
        records.append({
            "file": replay.record.file, "role": replay.record.role, "noise_rms": replay.record.noise.rms,
            "n_samples": len(measured), "curves": {name: curve_entry(replay.times, y) for name, y in curves.items()},
        })  # fmt: skip
    return {
        "remarks": remarks(found),
        "warnings": convergence_remarks(found),
        "records": records,
        "n_records": len(replays),
        "search": curve_entry(found.trace[0].astype(float), found.trace[1]),
    }


def remarks(found: Identification) -> list[str]:
    """Return what a reader must know, one sentence each."""
    information, (unit, factor) = found.information, SHOWN[found.campaign.unit]
    said = [bound_remark(found, int(i)) for i in np.flatnonzero(found.at_bound)] + convergence_remarks(found)
    for a, b, r in collinear(information):
        said.append(f"{a} and {b} can hardly be told apart on these records (correlation {r:+.3f}): a change of one is "
                    "made up for by the other.")  # fmt: skip
    deviations = zip(information.names, information.deviation, strict=True)
    said += [f"{name} is not determined by these records." for name, d in deviations if not np.isfinite(d)]
    if found.n_failed:
        said.append(f"{found.n_failed} of {found.used} candidates diverged and were given a penalty.")
    replays = (*found.train_replays, *found.holdout_replays)
    said += [text for replay in replays if (text := shape_remark(replay, found.candidate))]
    said += [
        f"{r.record.file}: the engine is off by up to {factor * r.engine_error:.2g} {unit} even at its "
        "finest steps: the equations are stiff there, or switch somewhere without a guard."
        for r in replays if not all(c.reached for c in r.calibrations)
    ]  # fmt: skip
    return said + noise_remarks(found)


def shape_remark(replay: Replay, candidate: Array) -> str:
    """Return a sentence where S2 falls though the residual is no more than noise, else "".

    S2 pairs few intervals between landmarks; one landmark that is only noise, near an end, can unpair them all.
    """
    e = record_errors(replay, candidate)
    only_noise = e.chi2_per_sample is not None and e.chi2_per_sample < MISFIT
    if not (e.s2 < SHAPE_FALLS and e.s1 > NUMBERS_AGREE and only_noise):
        return ""
    return (f"{replay.record.file}: S2 is {e.s2:.3f} though S1 is {e.s1:.3f}: the shape similarity pairs a few "
            "intervals by order, and a landmark of noise unpairs them; look at S1 and RMSE.")  # fmt: skip


def bound_remark(found: Identification, i: int) -> str:
    name, value = found.space.names[i], found.candidate[i]
    null = found.model.parameters[name].null
    margin = 1e-3 * (found.space.high[i] - found.space.low[i])
    if null is not None and abs(value - null) <= margin:
        return f"{name} sits at its null value: no such effect is seen on these records by this search."
    return (f"{name} sits on its bound: the search was held there, so neither it nor its interval, nor what is "
            "correlated with it, can be trusted.")  # fmt: skip


def convergence_remarks(found: Identification) -> list[str]:
    """Return what is to be said of a search that has not come to the minimum, or of one that does not carry over."""
    said = []
    steps = np.abs(np.nan_to_num(found.information.step))
    if len(steps) and steps.max() > FAR_FROM_MINIMUM:
        name = found.information.names[int(np.argmax(steps))]
        said.append(f"The search has not come to the least-squares minimum: a step from here would move {name} by "
                    f"{steps.max():.3g} of its standard deviations, so the intervals do not hold; a larger budget, "
                    "another seed, fitness rmse or --option velocity_limit=0.2 may get there.")  # fmt: skip
    train, holdout = found.train.chi2_per_sample, None if found.holdout is None else found.holdout.chi2_per_sample
    if train is not None and holdout is not None and holdout > CARRIES_OVER * max(train, 1.0):
        said.append(f"The fit does not carry over: its mean square is {holdout:.3g} times that of the noise on the "
                    f"held-out records, {train:.3g} times on those fitted.")  # fmt: skip
    return said


def noise_remarks(found: Identification) -> list[str]:
    replays, unit = found.train_replays, found.campaign.unit
    said = [noise_remark(r, unit) for r in replays if len(replays) <= MOST_NAMED]
    if not said:
        values = [shown(r.record.noise.rms, unit)[0] for r in replays]
        said.append(f"{len(replays)} records: noise {min(values):.3g} to {max(values):.3g} {SHOWN[unit][0]} rms.")
    above = [(r.record, level.rms) for r, level in zip(replays, found.information.levels, strict=True)
             if level.from_residual]  # fmt: skip
    why = "the model, in which nothing is free, lacks something."
    if found.space.free.any():
        why = (
            "the model lacks something, or the search has not come to the minimum; the intervals are widened to the "
            "residual and its correlation in time, and hold only as far as what is lacking averages out."
        )
    for record, rms in above[:MOST_NAMED]:
        times = rms / record.noise.rms if record.noise.rms else np.inf
        said.append(f"{record.file}: the residual is {times:.3g} times the noise: {why}")
    if len(above) > MOST_NAMED:
        said.append(f"So it is with {len(above) - MOST_NAMED} more records.")
    return said


def noise_remark(replay: Replay, unit: str) -> str:
    noise = replay.record.noise
    value, name = shown(noise.rms, unit)
    text = f"{replay.record.file}: noise {value:.3g} {name} rms"
    if noise.source == "rest":
        mean = shown(noise.mean or 0.0, unit)[0]
        return f"{text} and mean {mean:+.3g} {name} (shown, not subtracted) from {noise.n_samples} samples at rest."
    return f"{text} from high-frequency differences of the motion, as fewer than 50 samples were recorded at rest."
