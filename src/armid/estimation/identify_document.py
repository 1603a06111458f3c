"""What an identification found, as numbers for other programs."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from armid.estimation.identify import Errors, Identification, record_errors, versions_of
from armid.estimation.information import MISFIT, collinear
from armid.problem.replay import Replay
from armid.report.curves import fit_drawing
from armid.report.document import (
    ERROR_NOTE,
    Cell,
    Gallery,
    Grid,
    Page,
    Part,
    Section,
    Sentences,
    drawing,
    drawings,
    error_cells,
    error_headers,
    grid,
    listing,
    made_section,
    number_cell,
    records_note,
    value_text,
)
from armid.report.style import thinned
from armid.units import SHOWN, shown

PACKAGES = ("armid", "numpy", "scipy", "pandas", "numba", "pymoo", "nlopt")


def result_of(found: Identification) -> dict[str, Any]:
    """Return everything of an identification that JSON can hold, SI throughout; what is not known is null."""
    names = found.information.names
    correlation = found.information.correlation
    replays = (*found.train_replays, *found.holdout_replays)
    return {
        "campaign": found.campaign.name,
        "plant": found.model.plant.name,
        "effects": [e.name for e in found.model.effects],
        "parameters": {name: entry(found, i) for i, name in enumerate(found.space.names)},
        "error": {"train": errors(found.train), "holdout": errors(found.holdout)},
        "error_by_record": {r.record.file: by_record(found, r) for r in replays},
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
        "noise": {
            r.record.file: {"rms": r.record.noise.rms, "mean": r.record.noise.mean, "source": r.record.noise.source}
            for r in replays
        },
        "engine_error": max(r.engine_error for r in found.train_replays),
        "model": str(found.model),
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Return package -> version, of Python too."""
    return versions_of(PACKAGES)


def entry(found: Identification, i: int) -> dict[str, Any]:
    """Return value, interval, bounds and flag of one parameter; a fixed one has neither interval nor bounds."""
    space, free = found.space, bool(found.space.free[i])
    half = found.information.half_width[found.information.names.index(space.names[i])] if free else 0.0
    value = float(found.candidate[i])
    return {
        "value": value,
        "unit": space.units[i],
        "low": finite(value - half) if free else None,
        "high": finite(value + half) if free else None,
        "bound_low": float(space.low[i]) if free else None,
        "bound_high": float(space.high[i]) if free else None,
        "bound_active": bool(found.at_bound[i]),
    }


def by_record(found: Identification, replay: Replay) -> dict[str, Any]:
    """Return role and errors of one record."""
    return {"role": replay.record.role, **(errors(record_errors(replay, found.candidate)) or {})}


def errors(found: Errors | None) -> dict[str, float | None] | None:
    """Return errors with null for what is not finite."""
    return None if found is None else {k: finite(v) for k, v in asdict(found).items()}


def finite(value: float | None) -> float | None:
    """Return a float that JSON can hold, None for NaN and infinity."""
    return None if value is None or not np.isfinite(value) else float(value)


def parameter_table(found: Identification) -> Table:
    """Return the table of parameters: value, unit, 95 % interval, bounds, flag."""
    table = Table("parameter", "value", "unit", "95 % interval", "bounds", "", title="Parameters")
    half_widths = dict(zip(found.information.names, found.information.half_width, strict=True))
    for i, name in enumerate(found.space.names):
        value, unit = shown(float(found.candidate[i]), found.space.units[i])
        factor = SHOWN.get(found.space.units[i], ("", 1.0))[1]
        if name not in half_widths:
            table.add_row(name, f"{value:.6g}", unit, "", "", "fixed")
            continue
        half = float(half_widths[name]) * factor
        bounds = f"{found.space.low[i] * factor:.4g} to {found.space.high[i] * factor:.4g}"
        flag = "AT ITS BOUND" if found.at_bound[i] else ""
        table.add_row(name, f"{value:.6g}", unit, interval_text(value, half), bounds, flag)
    return table


def interval_text(value: float, half: float) -> str:
    """Return an interval with as many digits as its width deserves."""
    if not np.isfinite(half):
        return "not determined"
    return f"{value - half:.6g} to {value + half:.6g}"


def error_table(found: Identification) -> Table:
    """Return the table of errors on train and holdout."""
    unit = found.campaign.unit
    table = Table("records", "S", "S1", "S2", f"RMSE, {SHOWN[unit][0]}", "NRMSE", "chi2/sample", title="Errors")
    rows = (("train", found.train_replays, found.train), ("holdout", found.holdout_replays, found.holdout))
    for name, replays, e in rows:
        if e is None:
            table.add_row(f"{name}: none", *[""] * 6)
        else:
            table.add_row(f"{name} ({len(replays)})", *error_row_cells(e, unit))
    return table


def error_row_cells(e: Errors, unit: str) -> list[str]:
    """Return the cells of one row of errors."""
    chi2 = "no noise" if e.chi2_per_sample is None else f"{e.chi2_per_sample:.4g}"
    return [f"{e.s:.4f}", f"{e.s1:.4f}", f"{e.s2:.4f}", f"{shown(e.rmse, unit)[0]:.4g}", f"{e.nrmse:.3%}", chi2]


# S2 below the first with S1 above the second: landmarks that do not match, not signals that differ.
SHAPE_FALLS, NUMBERS_AGREE = 0.9, 0.95
# A least-squares step of more standard deviations than this: a search by another fitness ends within a few.
FAR_FROM_MINIMUM = 4.0
# A mean square on held-out records of more times that on the fitted ones than this.
CARRIES_OVER = 1.5
# More records than this are told of together.
MOST_NAMED = 6


def remarks(found: Identification) -> list[str]:
    """Return what a reader must know, one sentence each."""
    said = [bound_remark(found, int(i)) for i in np.flatnonzero(found.at_bound)] + convergence_remarks(found)
    for a, b, r in collinear(found.information):
        said.append(f"{a} and {b} can hardly be told apart on these records (correlation {r:+.3f}): "
                    "a change of one is made up for by the other.")  # fmt: skip
    lost = [n for n, d in zip(found.information.names, found.information.deviation, strict=True) if not np.isfinite(d)]
    said += [f"{name} is not determined by these records." for name in lost]
    if found.n_failed:
        said.append(f"{found.n_failed} of {found.used} candidates diverged and were given a penalty.")
    return said + shape_remarks(found) + engine_remarks(found) + noise_remarks(found)


def shape_remarks(found: Identification) -> list[str]:
    """Return a sentence for each record on which S2 falls though the residual is no more than noise.

    S2 pairs few intervals between landmarks; one landmark that is only noise, near an end, can unpair them all.
    """
    said = []
    for replay in (*found.train_replays, *found.holdout_replays):
        e = record_errors(replay, found.candidate)
        only_noise = e.chi2_per_sample is not None and e.chi2_per_sample < MISFIT
        if e.s2 < SHAPE_FALLS and e.s1 > NUMBERS_AGREE and only_noise:
            said.append(
                f"{replay.record.file}: S2 is {e.s2:.3f} though S1 is {e.s1:.3f}: the shape similarity pairs "
                "a few intervals by order, and a landmark of noise unpairs them; look at S1 and RMSE."
            )
    return said


def engine_remarks(found: Identification) -> list[str]:
    """Return a sentence for each record on which the engine is less accurate than it promises."""
    name, factor = SHOWN[found.campaign.unit]
    return [
        f"{r.record.file}: the engine is off by up to {factor * r.engine_error:.2g} {name} even at its "
        "finest steps: the equations are stiff there, or switch somewhere without a guard."
        for r in (*found.train_replays, *found.holdout_replays) if not all(c.reached for c in r.calibrations)
    ]  # fmt: skip


def bound_remark(found: Identification, i: int) -> str:
    """Return the sentence for a parameter at its bound."""
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
    """Return what is to be said of the noise, its mean at rest, and a residual far above it."""
    replays, unit = found.train_replays, found.campaign.unit
    named = [r for r in replays if len(replays) <= MOST_NAMED]
    said = [noise_remark(r, unit) for r in named]
    if not named:
        values = [shown(r.record.noise.rms, unit)[0] for r in replays]
        said.append(f"{len(replays)} records: noise {min(values):.3g} to {max(values):.3g} {SHOWN[unit][0]} rms.")
    pairs = zip(replays, found.information.levels, strict=True)
    above = [(r.record, level.rms) for r, level in pairs if level.from_residual]
    searched = bool(found.space.free.any())
    said += [misfit_remark(record.file, rms, record.noise.rms, searched) for record, rms in above[:MOST_NAMED]]
    if len(above) > MOST_NAMED:
        said.append(f"So it is with {len(above) - MOST_NAMED} more records.")
    return said


def noise_remark(replay: Replay, unit: str) -> str:
    """Return the noise of one record in words."""
    noise = replay.record.noise
    value, name = shown(noise.rms, unit)
    text = f"{replay.record.file}: noise {value:.3g} {name} rms"
    if noise.source == "rest":
        mean = shown(noise.mean or 0.0, unit)[0]
        return f"{text} and mean {mean:+.3g} {name} (shown, not subtracted) from {noise.n_samples} samples at rest."
    return f"{text} from high-frequency differences of the motion, as fewer than 50 samples were recorded at rest."


def misfit_remark(file: str, rms: float, noise: float, searched: bool) -> str:
    """Return the sentence for a record whose residual is far above its noise; searched: some parameter was free."""
    times = rms / noise if noise else np.inf
    if not searched:
        return (f"{file}: the residual is {times:.3g} times the noise: the model, in which nothing is free, lacks "
                "something.")  # fmt: skip
    return (f"{file}: the residual is {times:.3g} times the noise: the model lacks something, or the search has not "
            "come to the minimum; the intervals are widened to the residual and its correlation in time, and hold only "
            "as far as what is lacking averages out.")  # fmt: skip


Array = NDArray[np.float64]
# Curves of more records than this would make a page that nobody scrolls through.
MOST_RECORDS = 24


def details_of(found: Identification, made_by: Mapping[str, Any]) -> dict[str, Any]:
    """Return details as JSON can hold them, SI; made_by: the command and its options.

    Of long records each curve keeps the samples that `thinned` chooses.
    """
    replays = (*found.train_replays, *found.holdout_replays)
    return {
        "made_by": dict(made_by),
        "remarks": remarks(found),
        "warnings": convergence_remarks(found),
        "records": [record_entry(r, found.candidate) for r in replays[:MOST_RECORDS]],
        "n_records": len(replays),
        "search": curve_entry(found.trace[0].astype(float), found.trace[1]),
    }


def record_entry(replay: Replay, candidate: Array) -> dict[str, Any]:
    """Return one record: measured, simulated and the residual."""
    measured, simulated = replay.measured, replay.signal(candidate[np.newaxis])[0]
    curves = {"measured": measured, "simulated": simulated, "residual": measured - simulated}
    return {
        "file": replay.record.file,
        "role": replay.record.role,
        "noise_rms": replay.record.noise.rms,
        "n_samples": len(measured),
        "curves": {name: curve_entry(replay.times, values) for name, values in curves.items()},
    }


def curve_entry(x: Array, y: Array) -> dict[str, list[float | None]]:
    """Return a curve with no more points than can be seen, in five digits; null for what is not finite."""
    kept = thinned(np.nan_to_num(y))
    return {"x": rounded(x[kept]), "y": rounded(y[kept])}


def rounded(values: Sequence[float] | Array) -> list[float | None]:
    """Return numbers in five digits, null for what is not finite."""
    return [float(f"{v:.5g}") if np.isfinite(v) else None for v in values]


FIGURES = {"convergence": ("The search", "Best so far against the number of simulations.")}
OLD = (
    "details.json is not in this folder: an earlier version of armid wrote it, so the curves, what is to be known, the "
    "settings and the command are not on this page; the same `armid identify` again writes them."
)


def identify_page(result: Mapping[str, Any], details: Mapping[str, Any], svgs: Mapping[str, str], again: str) -> Page:
    """Return the page. details: empty where there are none; svgs: name -> SVG of FIGURES; again: makes it again."""
    unit = result["unit"]
    sections = [parameters_section(result)]
    if details and details["remarks"]:
        sections.append(Section("What must be known", (Sentences(tuple(details["remarks"])),)))
    sections.append(errors_section(result))
    if details:
        sections.append(fit_section(details, unit))
    figures = drawings(svgs, FIGURES)
    search = [("identifier", result["identifier"]), ("fitness", f"{result['fitness']}, at the end "
              f"{result['fitness_value']:.6g}"), ("simulations", f"{result['used']} of {result['budget']}"),
              ("diverged", str(result["failed"])), ("seed", str(result["seed"])), ("stopped", result["stopped"]),
              ("engine's error [rad/s or m/s]", f"{result['engine_error']:.2g}")]  # fmt: skip
    rows = [[Cell(a), Cell(str(b))] for a, b in search]
    sections.append(Section("Search", (grid("How it went", ["what", "value"], rows), *figures.values())))
    sections.append(Section("Equations", (listing("The model that was identified", result["model"]),)))
    sections.append(made_section(details.get("made_by", {}), result["versions"], again))
    effects = f" with {', '.join(result['effects'])}" if result["effects"] else ""
    question = f"Which parameters of {result['plant']}{effects} do these records show?"
    return Page(result["campaign"], "Identification", question, answer(result, details), tuple(sections),
                warning="" if details else OLD)  # fmt: skip


def answer(result: Mapping[str, Any], details: Mapping[str, Any]) -> tuple[str, ...]:
    """Return parameters, errors, and what stands against them."""
    free = {name: p for name, p in result["parameters"].items() if p["bound_low"] is not None}
    first = "; ".join(f"{name} = {value_text(p)}" for name, p in free.items()) + "." if free else "Nothing was free."
    return first, error_sentence(result), doubt_sentence(free, details.get("warnings", ()))


def doubt_sentence(free: Mapping[str, Mapping[str, Any]], warnings: Sequence[str]) -> str:
    """Return which parameters are not to be trusted, and what speaks against the search."""
    held = [name for name, p in free.items() if p["bound_active"]]
    lost = [name for name, p in free.items() if p["low"] is None]
    said = [f"Held by a bound, and not to be trusted: {', '.join(held)}."] if held else []
    said += [f"Not determined by these records: {', '.join(lost)}."] if lost else []
    said += warnings
    return " ".join(said) or "No parameter is held by a bound, and the search has come to the minimum."


def error_sentence(result: Mapping[str, Any]) -> str:
    """Return the errors on the records fitted and held out, and the noise."""
    unit = result["unit"]
    train, holdout = result["error"]["train"], result["error"]["holdout"]
    value, name = shown(train["rmse"], unit)
    out = "no record was held out" if holdout is None else f"{shown(holdout['rmse'], unit)[0]:.4g} on those held out"
    noise = shown(float(np.mean([n["rms"] for n in result["noise"].values()])), unit)[0]
    return f"Error (RMSE): {value:.4g} {name} on the records fitted, {out}; the noise is {noise:.3g} {name}."


def parameters_section(result: Mapping[str, Any]) -> Section:
    """Return parameters, and which of them move together."""
    rows = []
    for name, p in result["parameters"].items():
        unit, factor = SHOWN.get(p["unit"], (p["unit"], 1.0))
        ends = [number_cell(p[key], ".5g", factor) for key in ("low", "high", "bound_low", "bound_high")]
        said = "fixed" if p["bound_low"] is None else "AT ITS BOUND" if p["bound_active"] else ""
        said = said or ("not determined" if p["low"] is None else "")
        rows.append([Cell(name), number_cell(p["value"], ".6g", factor), Cell(unit), *ends, Cell(said)])
    headers = ["parameter", "value", "unit", "95 % from", "95 % to", "bound from", "bound to", "remark"]
    parts: list[Part] = [grid("Values with 95 % intervals", headers, rows)]
    if len(result["correlation"]) > 1:
        parts.append(correlation_grid(result["correlation"]))
    return Section("Parameters", tuple(parts))


def correlation_grid(correlation: Mapping[str, Mapping[str, float | None]]) -> Grid:
    """Return the correlations of the estimates."""
    rows = [[Cell(name), *(number_cell(r, "+.3f") for r in row.values())] for name, row in correlation.items()]
    note = "Near +1 or -1: a change of one is made up for by the other."
    return grid("Correlation of the estimates", ["parameter", *correlation], rows, note)


def errors_section(result: Mapping[str, Any]) -> Section:
    """Return errors on train and holdout, and of each record."""
    unit = result["unit"]
    both = [[Cell(which), *error_cells(e, unit)] for which, e in result["error"].items() if e is not None]
    each = [[Cell(file), Cell(e["role"]), *error_cells(e, unit)] for file, e in result["error_by_record"].items()]
    return Section("Errors", (
        grid("Train and holdout", ["records", *error_headers(unit)], both, ERROR_NOTE),
        grid("Each record", ["record", "role", *error_headers(unit)], each),
    ))  # fmt: skip


def fit_section(details: Mapping[str, Any], unit: str) -> Section:
    """Return measured and simulated signal of each record."""
    name, factor = SHOWN[unit]
    made = tuple(
        drawing(f"{r['file']} ({r['role']})", fit_drawing(r["curves"], name, factor), f"r{i}-")
        for i, r in enumerate(details["records"])
    )  # fmt: skip
    words = (
        "Measured and simulated speed, the residual (measured minus simulated) below. Of long records the least and "
        "the largest sample of each short interval are drawn. "
    )
    return Section("Fit of each record", (Gallery(made),), words + records_note(len(made), details["n_records"]))
