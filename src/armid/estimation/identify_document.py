"""The document of an identification, and what of it is stored: result.json and details.json."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from armid.engine.calibrate import NOISE_HIDES
from armid.estimation.figures import PAIRS, curves_of, figures_of, record_figure
from armid.estimation.identify import Identification, errors_by_file, versions_of
from armid.estimation.information import collinear
from armid.problem.problem import Replay, judged_by
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
    listing,
    made_section,
    moved_text,
    noise_text,
    others_text,
    plain,
    records_note,
    remark_parts,
    rmse_text,
    stored_figures,
    table,
    value_text,
)
from armid.report.result import Parts
from armid.units import scale_of, shown

PACKAGES_OF_IDENTIFY = ("armid", "numpy", "scipy", "pandas", "numba", "pymoo", "nlopt")
# Figures that a page takes as they are stored: name -> title and caption.
FIGURES = {"convergence": ("The search", "Best so far against the number of simulations."), "pairs": PAIRS}
MOST_KNOWN_FIRST = 3
# A mean square on held-out records of more times that on the fitted ones than this.
CARRIES_OVER = 1.5
# Of more records than this one sentence tells.
MOST_REMARKS = 6


def identify_document(
    result: Mapping[str, Any], details: Mapping[str, Any], svgs: Mapping[str, str], again: str
) -> Document:
    """Build the document of an identification from result.json and details.json.

    svgs: name -> SVG of those of `FIGURES` that are stored. again: the command that makes the page again.
    """
    unit = result["unit"]
    parameters, errors = parameter_table(result), train_and_holdout(result)
    said = [text for text in details["remarks"] if text not in details["warnings"]]
    first = [text for text in details["known_first"] if text in said]
    correlated = correlation_tables(result["correlation"])
    remarks = remark_parts(first, [text for text in said if text not in first])
    rows = [(file, e["role"], e) for file, e in result["error_by_record"].items()]
    value = result["fitness_value"]
    search = [
        ("identifier", result["identifier"]),
        ("fitness", f"{result['fitness']}, at the end {'not finite' if value is None else format(value, '.6g')}"),
        ("simulations", f"{result['used']} of {result['budget']}"), ("diverged", str(result["failed"])),
        ("seed", str(result["seed"])), ("stopped", result["stopped"]),
        ("engine's error [rad/s or m/s]",
         "not known" if result["engine_error"] is None else f"{result['engine_error']:.2g}"),
    ]  # fmt: skip
    figures, by_record = stored_figures(FIGURES, svgs), error_table("Each record", ["record", "role"], rows, unit)
    sections = (
        Section("Parameters", (parameters,)),
        fit_section(details),
        *(Section(part.title, (part,)) for part in remarks),
        Section("Errors", (errors, by_record, *correlated, *figures.get("pairs", ()))),
        Section("Search", (table("How it went", ["what", "value"], search), *figures.get("convergence", ()))),
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
    exact = ", ".join(details.get("within_tolerances", ()))
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
              f"{noise_text(output['noise_rms'], output, train)}.{others_text(train, holdout)}"
              f"{moved_text(result['outputs'], train)}")  # fmt: skip
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
        shown_interval = Struck(interval) if doubted else interval
        rows.append((name, factor * p["value"], unit, remark, shown_interval, bounds))
    columns = ["parameter", Column("value", "value", ".6g"), "unit", "remark", "95 % interval", "bounds"]
    kept = [i for i, c in enumerate(columns) if i != 3 or any(row[3] for row in rows)]
    return table("Parameters", [columns[i] for i in kept], [[row[i] for i in kept] for row in rows])


def train_and_holdout(result: Mapping[str, Any]) -> Table:
    roles = [e["role"] for e in result["error_by_record"].values()]
    rows = [(f"{role}: none" if e is None else f"{role} ({roles.count(role)})", e)
            for role, e in result["error"].items()]  # fmt: skip
    return error_table("Errors", ["records"], rows, result["unit"], ERROR_NOTE)


def fit_section(details: Mapping[str, Any]) -> Section:
    figures = tuple(
        Figure(f"r{i}", f"{r['file']} ({r['role']})", "", partial(record_figure, r["curves"], r["unit"]))
        for i, r in enumerate(details["records"])
    )  # fmt: skip
    text = (
        "Measured and simulated, the residual (measured minus simulated) below. Of long records the least and "
        "the largest sample of each short interval are drawn. "
    )
    gallery = Gallery(figures, name="fit")
    return Section("Fit of each record", (gallery,), text + records_note(len(figures), details["n_records"]))


def parts_of(identification: Identification) -> Parts:
    return Parts(result_of(identification), details_of(identification), figures_of(identification))


def result_of(identification: Identification) -> dict[str, Any]:
    """Return everything of an identification that JSON can hold, SI throughout; what is not known is null."""
    names, correlation = identification.information.names, identification.information.correlation
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
    return {
        "remarks": remarks(identification),
        "known_first": ranked(identification)[:MOST_KNOWN_FIRST],
        "warnings": [*(s.sentence for s in identification.issues), *convergence_remarks(identification)],
        "within_tolerances": [f"{name} ({t:.2g})" for name, t in identification.campaign.tolerances.items() if t > 0.0],
        "records": records,
        "n_records": len(identification.replays),
        "search": curve_entry(identification.trace[0].astype(float), identification.trace[1]),
    }


def remarks(identification: Identification) -> list[str]:
    """Return what a reader must know, the most important first, then what is for the record, one sentence each."""
    return ranked(identification) + noise_remarks(identification)


def ranked(identification: Identification) -> list[str]:
    """Return what stands against the result, the most important first."""
    information = identification.information
    said = [s.sentence for s in identification.issues] + convergence_remarks(identification)
    said += [bound_remark(identification, int(i)) for i in np.flatnonzero(identification.at_bound)]
    said += misfit_remarks(identification)
    deviations = zip(information.names, information.deviation, strict=True)
    said += [f"{name} is not determined by these records." for name, d in deviations if not np.isfinite(d)]
    pairs = collinear(information)
    if pairs:
        text = ", ".join(f"{a} and {b} {r:+.3f}" for a, b, r in pairs)
        said.append(f"Hardly to be told apart on these records (correlation): {text}; a change of one is made up for "
                    "by the other.")  # fmt: skip
    if identification.n_failed:
        said.append(f"{identification.n_failed} of {identification.used} candidates diverged and were given a penalty.")
    # that probes elsewhere miss the accuracy says nothing about the estimate
    coarse = [r for r in identification.replays if not all(c.reached for c in r.calibrations)]
    off = {r: r.engine_error_at(identification.candidate) for r in coarse}
    return said + bootstrap_remarks(identification) + [
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
    said = []
    if identification.is_far_from_minimum:
        steps = np.abs(np.nan_to_num(identification.information.step))
        name = identification.information.names[int(np.argmax(steps))]
        of, better = "least-squares minimum", "Identifier least_squares on fitness rmse, a"
        if identification.scatter is not None:
            of, better = f"minimum of {identification.fitness.name}", "A"
        said.append(f"The search has not come to the {of}: a step from here would move {name} by {steps.max():.3g} of "
                    f"its standard deviations, so the intervals do not hold. {better} larger budget or another seed "
                    "may get there.")  # fmt: skip
    train, unseen = identification.train.chi2_per_sample, identification.holdout
    holdout = None if unseen is None else unseen.chi2_per_sample
    if train is not None and holdout is not None and holdout > CARRIES_OVER * max(train, 1.0):
        said.append(f"The fit does not carry over: its mean square is {holdout:.3g} times that of the noise on the "
                    f"held-out records, {train:.3g} times on those fitted.")  # fmt: skip
    return said


def noise_remarks(identification: Identification) -> list[str]:
    replays = identification.train_replays
    said = [noise_remark(r) for r in replays if len(replays) <= MOST_REMARKS]
    for output in dict.fromkeys(r.record.output for r in replays if not said):
        of = [r.record for r in replays if r.record.output == output]
        values = [shown(record.noise.rms, record.unit)[0] for record in of]
        name = f"{output}, {len(of)} records" if len(of) < len(replays) else f"{len(of)} records"
        unit = shown(0.0, of[0].unit)[1]
        said.append(f"{name}: noise {min(values):.3g} to {max(values):.3g} {unit} rms.")
    return said


def misfit_remarks(identification: Identification) -> list[str]:
    replays = judged_by(identification.fitness, identification.train_replays)
    pairs = zip(replays, identification.information.levels, strict=True)
    above = [(level.rms / r.record.noise.rms if r.record.noise.rms else np.inf, r.name)
             for r, level in pairs if level.from_residual]  # fmt: skip
    if not above:
        return []
    text = ", ".join(f"{times:.3g} in {file}" for times, file in sorted(above, reverse=True)[:MOST_REMARKS])
    more = f" and {len(above) - MOST_REMARKS} signals more" if len(above) > MOST_REMARKS else ""
    why = "the model, in which nothing is free, lacks something."
    if identification.space.free.any():
        why = (
            "the model lacks something, an input is noisy, the sensor is noisier in motion, or the search has not come "
            "to the minimum. The intervals are widened to the residual and its correlation in time, and hold only as "
            "far as what is lacking averages out."
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
