"""The tables of a closed loop's page."""

from collections.abc import Mapping
from typing import Any

from armid.display import SHOWN
from armid.page.cells import grid, number_cell
from armid.page.page import Cell, Grid, Section
from armid.page.parts import ERROR_NOTE, error_cells, error_headers, plain_grid, records_note, value_text


def errors_section(report: Mapping[str, Any], details: Mapping[str, Any]) -> Section:
    """Return errors on train and holdout, and of each record."""
    unit = report["unit"]
    both = [(which, model, report["error"][model][which]) for which in ("train", "holdout")
            for model in ("before", "after")]  # fmt: skip
    rows = [[Cell(which), Cell(model), *error_cells(e, unit)] for which, model, e in both if e is not None]
    parts = [grid("Errors", ["records", "model", *error_headers(unit)], rows, ERROR_NOTE)]
    if details:
        parts.append(record_errors_grid(details, unit))
    return Section("Error before and after", tuple(parts))


def record_errors_grid(details: Mapping[str, Any], unit: str) -> Grid:
    """Return the errors of each record."""
    rows = [[Cell(r["file"]), Cell(r["role"]), Cell(model), *error_cells(r["error"][model], unit)]
            for r in details["records"] for model in ("before", "after")]  # fmt: skip
    note = records_note(len(details["records"]), details["n_records"])
    return grid("Errors of each record", ["record", "role", "model", *error_headers(unit)], rows, note)


def steps_grid(report: Mapping[str, Any]) -> Grid:
    """Return the effects that were added, with the error after each."""
    unit = report["unit"]
    name, factor = SHOWN[unit]
    rows = [[Cell("none: the declared model"), Cell(""), Cell(""), *rmse_cells(report["error"]["before"], factor),
             Cell("")]]  # fmt: skip
    for step in report["steps"]:
        own = [f"{name.partition('.')[2]} {value_text(p)}" for name, p in step["parameters"].items()
               if name.startswith(f"{step['effect']}.") and p["low"] is not None]  # fmt: skip
        doubt = ", ".join(step["alternatives"]) or "none"
        rows.append([Cell(step["effect"]), Cell(step["port"]), Cell(doubt), *rmse_cells(step["error"], factor),
                     Cell("; ".join(own))])  # fmt: skip
    headers = ["effect", "port", "cannot be told from", f"train RMSE [{name}]", f"holdout RMSE [{name}]",
               "parameters (95 % interval)"]  # fmt: skip
    return grid("Effects added, in order, and the error with each", headers, rows)


def rmse_cells(error: Mapping[str, Any], factor: float) -> list[Cell]:
    """Return the errors on train and holdout; a campaign may hold none out."""
    return [Cell("none") if error[which] is None else number_cell(error[which]["rmse"], ".4g", factor)
            for which in ("train", "holdout")]  # fmt: skip


def parameters_grid(report: Mapping[str, Any]) -> Grid:
    """Return each parameter before and after."""
    before, after = report["parameters"]["before"], report["parameters"]["after"]
    rows = [[name, value_text(before[name]) if name in before else "", value_text(p),
             "yes" if p["trusted"] else "fixed or not determined" if p["low"] is None else "no"]
            for name, p in after.items()]  # fmt: skip
    return plain_grid("Values with 95 % intervals", ["parameter", "before", "after", "trusted"], rows)


def advice_grid(report: Mapping[str, Any], details: Mapping[str, Any]) -> Grid:
    """Return the manoeuvres that would tell rivals apart."""
    words = details["advice"] if details else [", ".join(f"{k} = {v}" for k, v in a["manoeuvre"].items())
                                               for a in report["advice"]]  # fmt: skip
    rows = [[Cell(text), Cell(" and ".join(a["separates"])), number_cell(a["power"], ".0f", 100.0)]
            for text, a in zip(words, report["advice"], strict=True)]  # fmt: skip
    note = "Power: chance that one such record lets the right effect win, the lowest of all pairs."
    return grid("Manoeuvres to record, best first", ["manoeuvre", "separates", "power [%]"], rows, note)
