"""The document of an identification with its figures, and what of it is stored: result.json and details.json."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from armid.engine.calibrate import NOISE_HIDES
from armid.estimation.identify import MOST_GAIN, Identification, errors_by_file, versions_of
from armid.estimation.information import Information, collinear
from armid.model import Array
from armid.problem.fitness import SIMILARITIES
from armid.problem.problem import Replay, judged_by
from armid.problem.space import Space
from armid.report.document import (
    ERROR_NOTE,
    MOST_RECORDS,
    Column,
    Document,
    Figure,
    Gallery,
    Section,
    Struck,
    Table,
    Text,
    correlation_tables,
    curve_entry,
    error_table,
    listed,
    listing,
    made_section,
    may_be_inputs,
    moved_of,
    moved_text,
    noise_text,
    others_text,
    plain,
    points,
    record_axes,
    records_note,
    rmse_text,
    small_axes,
    stored_figures,
    table,
    titled,
    value_text,
)
from armid.report.result import Parts
from armid.report.style import GREY, OKABE_ITO, PALE, entitle, legend_below, panels, pyplot
from armid.units import labelled, scale_of, shown

PACKAGES_OF_IDENTIFY = ("armid", "numpy", "scipy", "pandas", "numba", "pymoo", "nlopt")
# Title and caption of the ellipses.
PAIRS = (
    "Pairs of parameters",
    "The most correlated pairs: an ellipse holds both true values in 95 % of all cases, if the intervals hold. Narrow "
    "ones: a change of one parameter is made up for by the other.",
)
# Figures that a page takes as they are stored: name -> title and caption.
FIGURES = {"convergence": ("The search", "Best so far against the number of simulations."), "pairs": PAIRS}
MOST_KNOWN_FIRST = 3
# Constants within tolerances that a sentence names.
MOST_TOLERANCES = 6
# A mean square on held-out records of more times that on the fitted ones than this.
CARRIES_OVER = 1.5
# Of more records than this one sentence tells.
MOST_REMARKS = 6
MOST_FITS_DRAWN, MOST_PAIRS = 8, 6
# Half axis of the 95 % ellipse of two normal variables, in standard deviations: root of chi2 of 2 degrees of freedom.
ELLIPSE = 2.4477


def identify_document(
    result: Mapping[str, Any], details: Mapping[str, Any], svgs: Mapping[str, str], again: str
) -> Document:
    """Build the document of an identification from result.json and details.json.

    svgs: name -> SVG of those of `FIGURES` that are stored. again: the command that makes the page again.
    """
    unit = result["unit"]
    parameters, by_file = parameter_table(result), result["error_by_record"]
    roles = [e["role"] for e in by_file.values()]
    pooled = [(f"{role}: none" if e is None else f"{role} ({roles.count(role)})", e)
              for role, e in result["error"].items()]  # fmt: skip
    errors = error_table("Errors", ["records"], pooled, unit, ERROR_NOTE)
    rows = [(file, e["role"], e) for file, e in by_file.items()]
    by_record = error_table("Each record", ["record", "role"], rows, unit)
    texts = [text for text in details["remarks"] if text not in details["warnings"]]
    first = [text for text in details["known_first"] if text in texts]
    correlated = correlation_tables(result["correlation"])
    rest = [text for text in texts if text not in first]
    remarks = titled({"What must be known": first, "For the record": rest})
    value = result["fitness_value"]
    search = [
        ("identifier", result["identifier"]),
        ("fitness", f"{result['fitness']}, at the end {'not finite' if value is None else format(value, '.6g')}"),
        ("simulations", f"{result['used']} of {result['budget']}"), ("diverged", str(result["failed"])),
        ("seed", str(result["seed"])), ("stopped", result["stopped"]),
        ("engine's error [rad/s or m/s]",
         "not known" if result["engine_error"] is None else f"{result['engine_error']:.2g}"),
    ]  # fmt: skip
    drawn = partial(stored_figures, FIGURES, svgs)
    sections = (
        Section("Parameters", (parameters,)),
        fit_section(details),
        *(Section(part.title, (part,)) for part in remarks),
        Section("Errors", (errors, by_record, *correlated, *drawn("pairs"))),
        Section("Search", (table("How it went", ["what", "value"], search), *drawn("convergence"))),
        Section("Equations", (listing("The model that was identified", result["model"]),)),
        made_section(details.get("made_by", {}), result["versions"], again),
    )
    effects = f" with {', '.join(result['effects'])}" if result["effects"] else ""
    ended = f"{result['used']} of {result['budget']} simulations used, {result['stopped']}; seed {result['seed']}."
    return Document(
        result["campaign"], "Identification", f"Which parameters of {result['plant']}{effects} do these records show?",
        answer(result, details), sections,
        main=(parameters, errors, *remarks, Text(ended)),
    )  # fmt: skip


def answer(result: Mapping[str, Any], details: Mapping[str, Any]) -> tuple[str, ...]:
    free = {name: p for name, p in result["parameters"].items() if p["bound_low"] is not None}
    known = list(details.get("within_tolerances", ()))
    exact = listed(known, MOST_TOLERANCES)
    begins = lead(free, result["error"]["holdout"] is not None)
    begins += " (constants count as exact)" if exact and any(p["low"] is not None for p in free.values()) else ""
    lost = [name for name, p in free.items() if p["low"] is None and p.get("interval_by") != "bootstrap"]
    found = [name for name in free if name not in lost or len(lost) == len(free)]
    first = f"{begins}: {'; '.join(f'{name} = {value_text(free[name])}' for name in found)}."
    train, holdout = result["error"]["train"], result["error"]["holdout"]
    out = "no record was held out, so that nothing judges the model"
    if holdout is not None:
        out = f"{rmse_text(holdout, result['unit'])} on those held out"
    output, unit = next(iter(result["outputs"].values())), shown(0.0, result["unit"])[1]
    second = (f"Error (RMSE): {rmse_text(train, result['unit'])} {unit} on the records fitted, {out}; "
              f"{noise_text(output['noise_rms'], output, train, False)}.{others_text(train, holdout)}"
              f"{moved_text(result['outputs'], train, False)}")  # fmt: skip
    held = [name for name, p in free.items() if p["bound_active"]]
    doubts = [f"Held by a bound, and not to be trusted: {', '.join(held)}."] if held else []
    doubts += [f"Not determined by these records: {', '.join(lost)}."] if lost else []
    doubts += details["warnings"]
    alone = f" The intervals take constants as exact that are known roughly: {exact}." if exact else ""
    if not free:
        return "Nothing was free: the model was judged as it is.", second
    sure = not any(p["interval_doubt"] for p in free.values())
    trusted = f"No parameter is held by a bound{', and the search has come to the minimum' if sure else ''}."
    return first, second, (" ".join(doubts) or trusted) + alone


def lead(free: Mapping[str, Mapping[str, Any]], judged: bool) -> str:
    doubts = {p["interval_doubt"] for p in free.values()}
    if not any(doubts):
        return f"Found, with 95 % intervals{'' if judged else ' that hold only if the model lacks nothing'}"
    if len(doubts) == 1 and all(p["low"] is None for p in free.values()):
        return f"Found, without intervals: {doubts.pop()}"
    if len(doubts) == 1:
        return f"Found, but do not rely on the 95 % intervals, since {doubts.pop()}"
    return "Found, with 95 % intervals where they hold"


def parameter_table(result: Mapping[str, Any]) -> Table:
    rows = []
    for name, p in result["parameters"].items():
        unit, factor = scale_of(p["unit"], p["value"])
        if p["bound_low"] is None:
            rows.append((name, factor * p["value"], unit, "fixed", "", ""))
            continue
        absent = "none" if p.get("interval_by") == "bootstrap" else "not determined"
        interval = absent if p["low"] is None else f"{factor * p['low']:.6g} to {factor * p['high']:.6g}"
        bounds = f"{factor * p['bound_low']:.4g} to {factor * p['bound_high']:.4g}"
        doubted = not p["interval_holds"] and p["low"] is not None
        remark = "AT ITS BOUND" if p["bound_active"] else "does not hold" if doubted else ""
        rows.append((name, factor * p["value"], unit, remark, Struck(interval) if doubted else interval, bounds))
    columns = ["parameter", Column("value", "value", ".6g"), "unit", "remark", "95 % interval", "bounds"]
    kept = [i for i, c in enumerate(columns) if i != 3 or any(row[3] for row in rows)]
    return table("Parameters", [columns[i] for i in kept], [[row[i] for i in kept] for row in rows])


def fit_section(details: Mapping[str, Any]) -> Section:
    figures = tuple(
        Figure(f"r{i}", f"{r['file']} ({r['role']})", "", partial(record_figure, r["curves"], r["unit"]))
        for i, r in enumerate(details["records"])
    )  # fmt: skip
    text = (
        "Measured and simulated, the residual (measured minus simulated) below. Of long records the least and "
        "the largest sample of each short interval are drawn. "
    )
    note = records_note(len(figures), details["n_records"])
    return Section("Fit of each record", (Gallery(figures, name="fit"),), text + note)


def parts_of(identification: Identification) -> Parts:
    return Parts(result_of(identification), details_of(identification), figures_of(identification))


def result_of(identification: Identification) -> dict[str, Any]:
    """Return everything of an identification that JSON can hold, SI throughout; what is not known is null."""
    names, correlation = identification.uncertainty.names, identification.uncertainty.correlation
    roles = {r.record.file: r.record.role for r in identification.replays}
    by_file = errors_by_file(identification.replays, identification.candidate)
    noises: dict[str, dict[str, Any]] = {}
    for noise, r in ((r.record.noise, r) for r in identification.replays):
        entry = {"rms": noise.rms, "mean": noise.mean, "source": noise.source}
        noises.setdefault(r.record.file, dict(entry, outputs={}))["outputs"][r.record.output] = entry
    return plain({
        "campaign": identification.campaign.name,
        "plant": identification.model.plant.name,
        "effects": [e.name for e in identification.model.effects],
        "parameters": identification.parameters,
        "error": {"train": identification.train, "holdout": identification.holdout},
        "error_by_record": {file: {"role": roles[file], **plain(e)} for file, e in by_file.items()},
        "correlation": {name: dict(zip(names, row, strict=True)) for name, row in zip(names, correlation, strict=True)},
        "unit": identification.campaign.unit,
        "fitness": identification.fitness.name,
        "fitness_value": identification.value,
        "identifier": identification.identifier,
        "budget": identification.budget,
        "used": identification.used,
        "failed": identification.n_failed,
        "stopped": identification.stopped,
        "seed": identification.seed,
        "noise": noises,
        "outputs": identification.outputs,
        "engine_error": max(r.engine_error_at(identification.candidate) for r in identification.train_replays),
        "model": str(identification.model),
        "versions": versions_of(PACKAGES_OF_IDENTIFY),
    })  # fmt: skip


def details_of(identification: Identification) -> dict[str, Any]:
    """Return details as JSON can hold them, SI; the command adds `made_by`, its line and options.

    Of long records each curve keeps the samples that `thinned` chooses.
    """
    records = [{
        "file": r.name, "role": r.record.role, "noise_rms": r.record.noise.rms, "unit": r.record.unit,
        "n_samples": len(r.measured),
        "curves": {name: curve_entry(r.times, y) for name, y in curves_of(r, identification.candidate).items()},
    } for r in identification.replays[:MOST_RECORDS]]  # fmt: skip
    first = ranked(identification)
    return {
        "remarks": first + noise_remarks(identification),
        "known_first": first[:MOST_KNOWN_FIRST],
        "warnings": [*(s.sentence for s in identification.issues), *convergence_remarks(identification)],
        "within_tolerances": [f"{name} ({t:.2g})" for name, t in identification.campaign.tolerances.items() if t > 0.0],
        "records": records,
        "n_records": len(identification.replays),
        "search": curve_entry(identification.trace[0].astype(float), identification.trace[1]),
    }


def ranked(identification: Identification) -> list[str]:
    """Return what stands against the result, the most important first, one sentence each."""
    information = identification.information
    texts = [s.sentence for s in identification.issues] + convergence_remarks(identification)
    texts += [bound_remark(identification, int(i)) for i in np.flatnonzero(identification.at_bound)]
    texts += misfit_remarks(identification)
    wider = identification.widened_by_inputs
    if wider and identification.scatter is None:
        texts.append(f"Noise of the inputs moves {', '.join(wider)} by more than noise of the sensors does, and makes "
                     "most of what these intervals are wide.")  # fmt: skip
    deviations = zip(information.names, information.deviation, strict=True)
    texts += [f"{name} is not determined by these records." for name, d in deviations if not np.isfinite(d)]
    pairs = collinear(identification.uncertainty)
    if pairs:
        text = ", ".join(f"{a} and {b} {r:+.3f}" for a, b, r in pairs)
        texts.append(f"Hardly to be told apart on these records (correlation): {text}; a change of one is made up for "
                    "by the other.")  # fmt: skip
    if identification.n_failed:
        texts.append(
            f"{identification.n_failed} of {identification.used} candidates diverged and were given a penalty."
        )
    # that probes elsewhere miss the accuracy says nothing about the estimate
    coarse = [r for r in identification.replays if not all(c.reached for c in r.calibrations)]
    off = {r: r.engine_error_at(identification.candidate) for r in coarse}
    return texts + bootstrap_remarks(identification) + [
        "{}: the engine is off by up to {:.2g} {} at the estimate, even at its finest steps: the equations change too "
        "fast there, or switch somewhere without a guard.".format(r.name, *shown(error, r.record.unit))
        for r, error in off.items() if error > r.record.noise.rms / NOISE_HIDES
    ]  # fmt: skip


def bootstrap_remarks(identification: Identification) -> list[str]:
    """Return from how many draws intervals come, and the bias of the estimate, in one sentence."""
    scatter, names = identification.scatter, identification.information.names
    if scatter is None or not len(scatter.draws):
        return []
    units = [unit for unit, free in zip(identification.space.units, identification.space.free, strict=True) if free]
    biases = [f"{name} {'{:+.2g} {}'.format(*shown(bias, unit)).removesuffix(' 1')}"
              for name, bias, unit in zip(names, scatter.bias, units, strict=True)]  # fmt: skip
    return [f"The intervals come from {len(scatter.draws)} draws of the noise, each minimised again by "
            f"{identification.fitness.name}. Bias of the estimate: {', '.join(biases)}."]  # fmt: skip


def bound_remark(identification: Identification, i: int) -> str:
    name, value = identification.space.names[i], identification.candidate[i]
    null = identification.model.parameters[name].null
    margin = 1e-3 * (identification.space.high[i] - identification.space.low[i])
    if null is not None and abs(value - null) <= margin:
        return f"{name} sits at its null value: no such effect is seen on these records by this search."
    return (f"{name} sits on its bound: the search was held there, so neither it nor its interval, nor what is "
            "correlated with it, can be trusted.")  # fmt: skip


def convergence_remarks(identification: Identification) -> list[str]:
    texts = []
    if identification.is_far_from_minimum:
        steps = np.abs(np.nan_to_num(identification.information.step))
        name = identification.information.names[int(np.argmax(steps))]
        of, better = "least-squares minimum", "Identifier least_squares on fitness rmse, a"
        if identification.scatter is not None:
            of, better = f"minimum of {identification.fitness.name}", "A"
        gain = identification.information.gain
        falls = f" and take away {100.0 * gain:.0f} % of the squares" if gain > MOST_GAIN else ""
        texts.append(f"The search has not come to the {of}: a step from here would move {name} by {steps.max():.3g} of "
                    f"its standard deviations{falls}, so the intervals do not hold. {better} larger budget or another "
                    "seed may get there.")  # fmt: skip
    train, unseen = identification.train.chi2_per_sample, identification.holdout
    holdout = None if unseen is None else unseen.chi2_per_sample
    if unseen is None or train is None or holdout is None:
        return texts
    if holdout > CARRIES_OVER * max(train, 1.0):
        known = identification.outputs
        missed = {n: e.rmse for n, e in unseen.outputs.items() if e.rmse > CARRIES_OVER * known[n]["noise_rms"]}
        may = missed and all(
            may_be_inputs(known[n]["noise_rms"], moved_of(known[n], True), x) for n, x in missed.items()
        )
        why = ", which noise of the inputs may do" if may else ""
        texts.append(f"The fit does not carry over: its mean square is {holdout:.3g} times that of the noise on the "
                    f"held-out records, {train:.3g} times on those fitted{why}.")  # fmt: skip
    return texts


def noise_remarks(identification: Identification) -> list[str]:
    replays = identification.train_replays
    texts = [noise_remark(r) for r in replays if len(replays) <= MOST_REMARKS]
    for output in dict.fromkeys(r.record.output for r in replays if not texts):
        of = [r.record for r in replays if r.record.output == output]
        values = [shown(record.noise.rms, record.unit)[0] for record in of]
        name = f"{output}, {len(of)} records" if len(of) < len(replays) else f"{len(of)} records"
        unit = shown(0.0, of[0].unit)[1]
        texts.append(f"{name}: noise {min(values):.3g} to {max(values):.3g} {unit} rms.")
    return texts


WIDENED = (
    "The intervals are widened to the residual and its correlation in time, and hold only as far as what is lacking "
    "averages out."
)


def beyond_noise(replays: Sequence[Replay], information: Information) -> dict[str, float]:
    """Return signal -> its residual in units of its noise, of signals that hold more than noise."""
    return {r.name: level.rms / r.record.noise.rms if r.record.noise.rms else np.inf
            for r, level in zip(replays, information.levels, strict=True) if level.from_residual}  # fmt: skip


def misfit_remarks(identification: Identification) -> list[str]:
    above = beyond_noise(judged_by(identification.fitness, identification.train_replays), identification.information)
    if not above:
        return []
    largest = sorted(((times, name) for name, times in above.items()), reverse=True)[:MOST_REMARKS]
    text = ", ".join(f"{times:.3g} in {name}" for times, name in largest)
    more = f" and {len(above) - MOST_REMARKS} signals more" if len(above) > MOST_REMARKS else ""
    why = "the model, in which nothing is free, lacks something."
    if identification.space.free.any():
        why = (
            "the model lacks something, a constant is off, an input is noisy, the sensor is noisier in motion, or the "
            f"search has not come to the minimum. {WIDENED}"
        )
    return [f"The residual is this many times the noise: {text}{more}: {why}"]


def noise_remark(replay: Replay) -> str:
    noise, unit = replay.record.noise, replay.record.unit
    value, name = shown(noise.rms, unit)
    text = f"{replay.name}: noise {value:.3g} {name} rms"
    if noise.source == "rest":
        mean = shown(noise.mean or 0.0, unit)[0]
        return f"{text} and mean {mean:+.3g} {name} (shown, not subtracted) from {noise.n_samples} samples at rest."
    return (f"{text} from high-frequency differences of the motion: no rest with still inputs has 50 samples, or the "
            "steps of the sensor hide it there.")  # fmt: skip


def figures_of(identification: Identification) -> dict[str, Callable[[], Any]]:
    made: dict[str, Callable[[], Any]] = {"fit": lambda: fit_figure(identification)}
    made |= {"convergence": lambda: convergence_figure(identification)} if len(identification.trace[0]) else {}
    own = identification.candidate[identification.space.free], identification.campaign.truth
    draws = None if identification.scatter is None else identification.scatter.draws
    return made | pairs_of(identification.campaign.name, identification.space, identification.uncertainty, *own, draws)


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

    def draw(axis: Any, name: str, colour: str, **look: Any) -> None:
        x, y = curves[name]
        axis.plot(x, factor * y, label=name, color=OKABE_ITO[colour], **look)

    draw(upper, "measured", "black", lw=1.6)
    draw(upper, "simulated", "vermilion", lw=1.3, ls="--")
    lower.axhline(0.0, color=GREY, lw=0.8)
    draw(lower, "residual", "blue", lw=0.8)
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
    factor, unit = shown(1.0, si_unit)
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
    if draws is not None and len(draws) > 1:
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
    if draws is not None and len(draws) > 1:
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
