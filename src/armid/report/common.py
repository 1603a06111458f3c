"""What the documents of several results have in common: values, errors, curves, and how a result was made."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.report.document import Column, Line, Listing, Part, Section, Table, table
from armid.report.style import pyplot, thinned
from armid.units import SHOWN, shown

Array = NDArray[np.float64]
# Curves of more records than this would make a page that nobody scrolls through.
MOST_RECORDS = 24
ERROR_NOTE = (
    "RMSE: pooled over all samples. NRMSE: each record divided by its rms. chi2/sample: mean of (residual/noise)^2, 1 "
    "where only noise is left. S, S1, S2: similarity degrees of the paper (whole, numbers, shape), mean by duration."
)


def finite(value: float | None) -> float | None:
    """Return a float that JSON can hold, None for NaN and infinity."""
    return None if value is None or not np.isfinite(value) else float(value)


def value_text(entry: Mapping[str, Any]) -> str:
    """Return a stored parameter (value, unit, low, high) with its 95 % interval in units that people read."""
    value, name = shown(entry["value"], entry["unit"])
    unit = "" if name == "1" else f" {name}"
    if entry["low"] is None or entry["high"] is None:
        return f"{value:.5g}{unit}"
    low, high = (shown(entry[end], entry["unit"])[0] for end in ("low", "high"))
    return f"{value:.5g}{unit} ({low:.5g} to {high:.5g})"


def listed(names: Sequence[str]) -> str:
    """Return names as people list them."""
    return " and ".join(([", ".join(names[:-1])] if names[1:] else []) + list(names[-1:]))


def error_table(title: str, first: Sequence[str], rows: Sequence[tuple[Any, ...]], unit: str, note: str = "") -> Table:
    """Return a table of errors. rows: the texts of the first columns, then the stored errors or None for none."""
    name, factor = SHOWN[unit]
    digits = {"s": ".4f", "s1": ".4f", "s2": ".4f", "rmse": ".4g", "nrmse": ".3%", "chi2_per_sample": ".4g"}
    headers = {"rmse": f"RMSE, {name}", "nrmse": "NRMSE", "chi2_per_sample": "chi2/sample"}
    numbers = [Column(k, headers.get(k, k.upper()), d, factor if k == "rmse" else 1.0) for k, d in digits.items()]
    cells = []
    for *texts, error in rows:
        values = dict(error or dict.fromkeys(digits))
        if error is not None and error["chi2_per_sample"] is None:
            values["chi2_per_sample"] = "no noise"
        cells.append((*texts, *(values[k] for k in digits)))
    return table(title, [*first, *numbers], cells, note)


def rmse_text(error: Mapping[str, Any], unit: str) -> str:
    """Return the RMSE of stored errors in the unit that people read, without the unit."""
    return "not finite" if error["rmse"] is None else f"{shown(error['rmse'], unit)[0]:.4g}"


def records_note(shown_records: int, there_are: int) -> str:
    """Return how many records are not shown, "" for none."""
    return "" if shown_records >= there_are else f"The first {shown_records} of {there_are} records are shown."


def made_section(made_by: Mapping[str, Any], versions: Mapping[str, str], again: str) -> Section:
    """Return commands, settings and versions. made_by: see `details.json`; again: the command that makes the page."""
    commands = [made_by["command"]] if made_by else []
    parts: list[Part] = [Listing("Commands", tuple(map(Line, [*commands, again])))]
    if made_by:
        settings = [(name, setting_text(value)) for name, value in sorted(made_by["settings"].items())]
        parts.append(table("Settings", ["what", "value"], settings))
    parts.append(table("Versions", ["what", "value"], list(versions.items())))
    return Section("How it was made", tuple(parts))


def setting_text(value: Any) -> str:
    if value in (None, "", []):
        return "not given"
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def curve_entry(x: Array, y: Array) -> dict[str, list[float | None]]:
    """Return a curve for details.json: no more points than can be seen, five digits, null for what is not finite."""
    kept = thinned(np.nan_to_num(y))
    return {k: [float(f"{v:.5g}") if np.isfinite(v) else None for v in values[kept]] for k, values in
            (("x", x), ("y", y))}  # fmt: skip


def points(curve: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return the numbers of a stored curve, NaN where there is none."""
    return np.array(curve["x"], dtype=float), np.array(curve["y"], dtype=float)


def small_axes(width: float, height: float, heights: tuple[float, ...] = (1,)) -> tuple[Any, list[Any]]:
    """Return a figure of this size [inch] for a gallery, with axes above each other."""
    # margins in inches: they cost a tenth of the time that a layout engine takes, and there are many figures
    place = {"left": 1.1 / width, "right": 1.0 - 0.1 / width, "bottom": 0.6 / height, "top": 1.0 - 0.1 / height}
    figure, axes = pyplot().subplots(len(heights), 1, figsize=(width, height), height_ratios=heights, squeeze=False,
                                     sharex=True, gridspec_kw=place | {"hspace": 0.12})  # fmt: skip
    for axis in axes.flat:
        axis.margins(x=0.01)
    return figure, list(axes.flat)


def record_axes(n: int, height: float, more: float, heights: Sequence[float] = (1,)) -> tuple[Any, list[list[Any]]]:
    """Return a figure for n records in one or two columns, and the axes of each, above each other.

    height: of a row of records, more: of the figure beside them [inch]; heights: shares of the axes of a record.
    """
    columns, k = 1 if n == 1 else 2, len(heights)
    rows = -(-n // columns)
    size = (6.8 * columns, height * rows + more)
    figure, axes = pyplot().subplots(k * rows, columns, figsize=size, squeeze=False, height_ratios=list(heights) * rows,
                                     layout="constrained")  # fmt: skip
    cells = [list(axes[k * row : k * row + k, column]) for row in range(rows) for column in range(columns)]
    for unused in (axis for cell in cells[n:] for axis in cell):
        unused.set_visible(False)
    return figure, cells[:n]
