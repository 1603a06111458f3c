"""Sections that pages of several kinds share."""

from collections.abc import Iterable, Mapping
from typing import Any

from armid.display import SHOWN, shown
from armid.page.cells import grid, number_cell, pairs
from armid.page.equations import Line, lines
from armid.page.inline import inline
from armid.page.page import Cell, Drawing, Grid, Listing, Part, Section

ERROR_NOTE = (
    "RMSE: pooled over all samples. NRMSE: each record divided by its rms. chi2/sample: mean of (residual/noise)^2, 1 "
    "where only noise is left. S, S1, S2: similarity degrees of the paper (whole, numbers, shape), mean by duration."
)


def error_headers(unit: str) -> list[str]:
    """Return the headers of the columns of errors."""
    return [f"RMSE [{SHOWN[unit][0]}]", "NRMSE [%]", "chi2/sample", "S", "S1", "S2"]


def error_cells(error: Mapping[str, float | None], unit: str) -> list[Cell]:
    """Return the cells of stored errors."""
    rmse = number_cell(error["rmse"], ".4g", SHOWN[unit][1])
    rest = [number_cell(error["nrmse"], ".3f", 100.0), number_cell(error["chi2_per_sample"], ".4g")]
    return [rmse, *rest, *(number_cell(error[name], ".4f") for name in ("s", "s1", "s2"))]


def value_text(entry: Mapping[str, Any]) -> str:
    """Return a stored parameter with unit and 95 % interval as people read it."""
    value, name = shown(entry["value"], entry["unit"])
    unit = "" if name == "1" else f" {name}"
    if entry["low"] is None or entry["high"] is None:
        return f"{value:.5g}{unit}"
    low, high = (shown(entry[end], entry["unit"])[0] for end in ("low", "high"))
    return f"{value:.5g}{unit} ({low:.5g} to {high:.5g})"


def drawing(title: str, svg: str, prefix: str, note: str = "") -> Drawing:
    """Return a figure; prefix: of its ids on the page."""
    return Drawing(title, inline(svg, prefix, title, title), note)


def drawings(texts: Mapping[str, str], words: Mapping[str, tuple[str, str]]) -> dict[str, Drawing]:
    """Return stored figures by name; words: name -> title and what it shows."""
    return {name: drawing(words[name][0], text, f"{name}-", words[name][1]) for name, text in texts.items()}


def made_section(made_by: Mapping[str, Any], versions: Mapping[str, str], again: str) -> Section:
    """Return commands, settings and versions. again: the command that makes the page again."""
    commands = [Line(made_by["command"])] if made_by else []
    parts: list[Part] = [Listing("Commands", (*commands, Line(again)))]
    if made_by:
        parts.append(settings_grid(made_by["settings"]))
    parts.append(pairs("Versions", list(versions.items())))
    return Section("How it was made", tuple(parts))


def settings_grid(settings: Mapping[str, Any]) -> Grid:
    """Return the value of each option."""
    return pairs("Settings", [(name, setting_text(value)) for name, value in sorted(settings.items())])


def setting_text(value: Any) -> str:
    """Return the value of an option in words."""
    if value in (None, "", []):
        return "not given"
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def records_note(shown_records: int, there_are: int) -> str:
    """Return how many records are not shown, "" for none."""
    return "" if shown_records >= there_are else f"The first {shown_records} of {there_are} records are shown."


def listing(title: str, text: str, folded: bool = False) -> Listing:
    """Return a text as it is."""
    return Listing(title, lines(text), folded)


def plain_grid(title: str, headers: Iterable[str], rows: Iterable[Iterable[str]], note: str = "") -> Grid:
    """Return a table of texts that are sorted as texts."""
    return grid(title, list(headers), [[Cell(text) for text in row] for row in rows], note)
