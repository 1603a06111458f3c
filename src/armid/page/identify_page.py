"""The page of one identification, from result.json, details.json and the figures beside them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armid.display import SHOWN, shown
from armid.page.cells import grid, number_cell
from armid.page.curves import fit_drawing
from armid.page.page import Cell, Gallery, Grid, Page, Part, Section, Sentences
from armid.page.parts import (
    ERROR_NOTE,
    drawing,
    drawings,
    error_cells,
    error_headers,
    listing,
    made_section,
    records_note,
    value_text,
)

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
