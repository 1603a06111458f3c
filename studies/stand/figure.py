"""The repeats of one manoeuvre together, as the paper's Fig. 9."""

from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from stand.campaign import Record

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes

COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")
"""Okabe and Ito's palette, told apart by colour-blind eyes."""


def repeats_figure(records: list[Record], suffix: str) -> bytes:
    """Draw the repeats of the first record: above as measured, below what each departs from the mean of all.

    Gives the bytes of the file; `suffix` is .png, .svg or .pdf. Speeds in deg/s against time in s.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow to load and needed for nothing else

    repeats = [each for each in records if records[0].file in (each.file, each.repeat_of)]
    count = len(repeats)
    figure = Figure(figsize=(7.0, 4.4 + 0.9 * count), dpi=100, layout="constrained")
    axes = figure.subplots(1 + count, 1, sharex=True, height_ratios=(4.4, *[0.9] * count))
    _draw_speeds(axes[0], repeats)
    _draw_departures(axes[1:], repeats)
    axes[0].set_title(f"SYNTHETIC records: {count} repeats of the manoeuvre '{repeats[0].manoeuvre.name}'")
    axes[-1].set_xlabel("Time since the brake opened [s]")
    buffer = BytesIO()
    figure.savefig(buffer, format=suffix.removeprefix("."))
    return buffer.getvalue()


def _draw_speeds(axes: "Axes", repeats: list[Record]) -> None:
    """Draw each repeat over the one before in a thinner line, so that all are seen where they agree."""
    for index, record in enumerate(repeats):
        width = 0.8 + 3.2 * (1.0 - (index + 1) / len(repeats))
        axes.plot(record.time_s, record.speed_deg_s, color=_colour(index), linewidth=width, label=record.file)
    axes.set_ylabel("Angular velocity\nof the arm [deg/s]")
    axes.legend(frameon=False)
    _clean(axes)


def _draw_departures(rows: "Iterable[Axes]", repeats: list[Record]) -> None:
    """Draw what each repeat departs from the mean of all, one row each on one scale."""
    mean = np.mean([record.speed_deg_s for record in repeats], axis=0)
    largest = max(float(np.abs(record.speed_deg_s - mean).max()) for record in repeats)
    for index, (axes, record) in enumerate(zip(rows, repeats, strict=True)):
        departure = record.speed_deg_s - mean
        axes.plot(record.time_s, departure, color=_colour(index), linewidth=0.6)
        axes.set_ylim(-1.1 * largest - 1e-3, 1.1 * largest + 1e-3)
        axes.set_ylabel("[deg/s]")
        words = f"{record.file} minus the mean of all repeats: rms {np.sqrt(np.mean(departure**2)):.2f} deg/s"
        axes.set_title(words, loc="left", fontsize="small")
        _clean(axes)


def _colour(index: int) -> str:
    return COLOURS[index % len(COLOURS)]


def _clean(axes: "Axes") -> None:
    """Leave a light grid, the zero of time, and no box."""
    axes.grid(color="0.9", linewidth=0.8)
    axes.axvline(0.0, color="0.5", linewidth=0.8, linestyle=":")
    axes.margins(x=0.01)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
