"""A document: what a result says, in order, before it is rendered.

Every result (identification, identifiability, closed loop, study) is one `Document`: the answer, then sections of text,
tables, figures and listings. `terminal.show`, `markdown.markdown`, `html.html` and `files.write_files` render it and
word nothing themselves; each escapes what comes from files.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from difflib import unified_diff
from math import isfinite
from typing import TYPE_CHECKING, Any, Union, overload

import numpy as np

from armid.report.style import Array, place_labels, pyplot, thinned
from armid.units import DEG, behind, scale_of, shown

if TYPE_CHECKING:
    from pandas import DataFrame


# Rows of a table that are shown; its file holds all.
MOST_SHOWN = 60
# A column that says the same in all rows of a page's table is written below it, from so many rows and columns on.
LEAST_ROWS, LEAST_COLUMNS = 3, 4
FIRST_NUMBER = re.compile(r"\s*(?:below )?([-+]?(?:inf|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?))(?=[\s%,;(]|$)")


@dataclass(frozen=True)
class Column:
    """One column of a table.

    key: name in the frame, and in the header of the CSV file. header: heading with the unit; "" where it needs none.
    digits: format of its numbers, such as ".3g"; "" for text. factor: from the number in the frame (SI) to that shown.
    group: beginning of the heading that LaTeX writes once over neighbours that share it.
    """

    key: str
    header: str
    digits: str = ""
    factor: float = 1.0
    group: str = ""


class Struck(str):
    """A text that is shown struck through: it does not hold."""


@dataclass(frozen=True)
class Cell:
    """A cell as shown, and the number (SI) it is sorted by; None for one that is sorted as text."""

    text: str
    number: float | None = None

    @property
    def key(self) -> str:
        """The number as a script reads it, "" for none."""
        return "" if self.number is None else repr(self.number).replace("inf", "Infinity")

    @property
    def is_struck(self) -> bool:
        return isinstance(self.text, Struck)


@dataclass(frozen=True, eq=False)
class Table:
    """A table.

    name: of its files, without ending; "" for a table that is not written to files. caption: how each number was
    computed. frame: SI values, as a pandas frame or as rows in the order of the columns; None and NaN are left empty.
    most: rows that are shown, 0 for a table that is only written to its CSV file. grouped: whether rows that share the
    first column stand under it as a heading (terminal and LaTeX).
    """

    name: str
    title: str
    caption: str
    frame: Union["DataFrame", Sequence[Sequence[Any]]]
    columns: tuple[Column, ...]
    most: int = MOST_SHOWN
    grouped: bool = False

    @property
    def note(self) -> str:
        """The caption, and how many rows are not shown."""
        hidden = len(self.frame) - self.most
        return f"{self.caption} {hidden} more lines are in {self.name}.csv." if hidden > 0 else self.caption

    def cells(self) -> list[list[Cell]]:
        frame: Any = self.frame
        if hasattr(frame, "columns"):
            rows = zip(*(frame[c.key].head(self.most) for c in self.columns), strict=True)
        else:
            rows = frame[: self.most]
        return [[cell(value, column) for value, column in zip(row, self.columns, strict=True)] for row in rows]


def varying(part: Table) -> tuple[list[Column], list[list[Cell]], str]:
    """Return what a narrow page shows of a table: columns whose cells differ, their cells, and what the others say."""
    rows = part.cells()
    texts = [{row[i].text for row in rows} for i in range(len(part.columns))]
    kept = [i for i, told in enumerate(texts) if len(rows) < LEAST_ROWS or len(told) > 1 or len(texts) < LEAST_COLUMNS]
    same = [f"{column.header} is {next(iter(told))}" for i, (column, told) in enumerate(zip(part.columns, texts,
            strict=True)) if i not in kept and told != {""}]  # fmt: skip
    note = f"In every line {', '.join(same)}." if same else ""
    return [part.columns[i] for i in kept], [[row[i] for i in kept] for row in rows], note


def table(
    title: str, columns: Sequence[object], rows: Sequence[Sequence[Any]], caption: str = "", name: str = ""
) -> Table:
    """Return a table of plain rows, all shown; a column of text may be given by its header alone."""
    told = tuple(c if isinstance(c, Column) else Column(str(c), str(c)) for c in columns)
    return Table(name, title, caption, rows, told, max(len(rows), 1))


def cell(value: Any, column: Column) -> Cell:
    """Return a cell; text is sorted by the number it begins with, if any."""
    if value is None or value != value:  # noqa: PLR0124 - a NaN differs from itself
        return Cell("")
    if column.digits and not isinstance(value, str):
        # + 0.0 takes the sign off a zero
        return Cell(format(column.factor * float(value) + 0.0, column.digits), float(value))
    match = FIRST_NUMBER.match(str(value))
    text = value if isinstance(value, Struck) else str(value)
    return Cell(text, float(match.group(1)) if match else None)


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure.

    name: of its files, without ending. caption: what each mark is. draw: returns it as matplotlib's, nothing for one
    that is only stored. svg: its stored text; "" for one that is drawn when it is needed.
    """

    name: str
    title: str
    caption: str
    draw: Callable[[], Any] = lambda: None
    svg: str = ""


@dataclass(frozen=True)
class Gallery:
    """Figures side by side on a page.

    slider: label of one control that fades all of them between their layers "before" and "after"; "" for none. name: of
    the PNG file that shows them together, for Markdown; "" for none. wide: whether each has a row of its own.
    """

    figures: tuple[Figure, ...]
    slider: str = ""
    name: str = ""
    wide: bool = False


@dataclass(frozen=True)
class Text:
    text: str


@dataclass(frozen=True)
class Sentences:
    """Sentences, one a bullet, under a title or none."""

    sentences: tuple[str, ...]
    title: str = ""


@dataclass(frozen=True)
class Line:
    """A line of a listing; mark: "+" for one that came, "-" for one that went, "" for one that stayed."""

    text: str
    mark: str = ""


@dataclass(frozen=True)
class Listing:
    title: str
    lines: tuple[Line, ...]
    folded: bool = False


Part = Table | Figure | Gallery | Text | Sentences | Listing


@dataclass(frozen=True, eq=False)
class Section:
    title: str
    parts: tuple[Part, ...]
    text: str = ""


@dataclass(frozen=True, eq=False)
class Document:
    """A whole document.

    of: what made it, in a word or two. answer: a few sentences, the first of them alone enough. warning: what must be
    known first, "" for nothing. facts: how it was made, a sentence each. angle: unit in which figures show angles.
    main: the parts of the sections that a terminal shows.
    """

    title: str
    of: str
    question: str
    answer: tuple[str, ...]
    sections: tuple[Section, ...]
    warning: str = field(default="", kw_only=True)
    facts: tuple[str, ...] = field(default=(), kw_only=True)
    angle: str = field(default=DEG, kw_only=True)
    main: tuple[Part, ...] = field(default=(), kw_only=True)

    @property
    def said(self) -> list[str]:
        """What must be known first, then the answer, a sentence each."""
        return [sentence for sentence in (self.warning, *self.answer) if sentence]

    @property
    def main_tables(self) -> tuple[Table, ...]:
        return tuple(p for p in self.main if isinstance(p, Table))

    @property
    def tables(self) -> tuple[Table, ...]:
        return tuple(p for s in self.sections for p in s.parts if isinstance(p, Table))

    @property
    def figures(self) -> tuple[Figure, ...]:
        return tuple(p for s in self.sections for p in s.parts if isinstance(p, Figure))


def listing(title: str, text: str, folded: bool = False) -> Listing:
    return Listing(title, tuple(map(Line, text.splitlines())), folded)


def changed(before: str, after: str) -> tuple[Line, ...]:
    """Return the lines of two texts as one, marked where they differ."""
    old, new = before.splitlines(), after.splitlines()
    _, _, _, *lines = unified_diff(old, new, n=len(old), lineterm="")  # behind a heading of three lines
    return tuple(Line(line[1:], line[0].strip()) for line in lines)


def slug(*texts: str) -> str:
    """Return a file name of letters, digits and underscores: "pso, literal" becomes "pso_literal"."""
    return re.sub(r"[^A-Za-z0-9]+", "_", "_".join(texts)).strip("_").lower()


def unlike(names: list[str]) -> list[str]:
    """Return the names with a number behind those that are there already."""
    distinct: list[str] = []
    for name in names:
        again = sum(re.fullmatch(rf"{re.escape(name)}(_\d+)?", f) is not None for f in distinct)
        distinct.append(f"{name}_{again + 1}" if again else name)
    return distinct


# Curves of more records than this would make a page that nobody scrolls through.
MOST_RECORDS = 24
# What is left of a model and is below this many times what noise of sensor and inputs does may be that alone.
NO_MORE = 1.5
# Digits of a parameter, and at most, where its interval is narrow.
USUAL_DIGITS, MOST_DIGITS = 5, 8
# Of what noise of the inputs does a fit leaves at least this share, as parameters cannot follow it.
LEFT_OF_MOVED = 0.25
# Of what a model leaves, noise of the inputs that does less than this share shows nowhere.
LEAST_OF_LEFT = 0.03
ERROR_NOTE = (
    "RMSE: pooled over all samples. NRMSE: each record divided by its rms. chi2/sample: mean of (residual/noise)^2, 1 "
    "where only noise is left. S, S1, S2: similarity degrees of the paper (whole, numbers, shape), mean by duration; "
    "not usable: only noise is left, and a landmark of noise spoils the shape."
)


@overload
def plain(value: Mapping[str, Any]) -> dict[str, Any]: ...
@overload
def plain(value: object) -> Any: ...
def plain(value: Any) -> Any:
    """Return a value as JSON holds it: a data class by the names of its fields, None for NaN and infinity."""
    if is_dataclass(value):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {name: plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not isfinite(value) else value


def value_text(entry: Mapping[str, Any], struck: bool = False) -> str:
    """Return a stored parameter (value, unit, low, high) with its 95 % interval in units that people read.

    struck: whether an interval that does not hold is shown struck through; else it is left out.
    """
    name, factor = scale_of(entry["unit"], entry["value"])
    ends = () if entry["low"] is None or entry["high"] is None else (entry["low"], entry["high"])
    digits = digits_of(entry["value"], *ends)
    text = f"{factor * entry['value']:.{digits}g}{behind(name)}"
    if not ends or not (entry["interval_holds"] or struck):
        return text
    text += f" ({factor * ends[0]:.{digits}g} to {factor * ends[1]:.{digits}g})"
    return text if entry["interval_holds"] else Struck(text)


def digits_of(value: float, low: float | None = None, high: float | None = None) -> int:
    """Return the digits that show a value, and two digits of the width of its interval."""
    if low is None or high is None or not high > low or value == 0.0:
        return USUAL_DIGITS
    wanted = 2 + int(np.ceil(np.log10(max(abs(low), abs(high)) / (high - low))))
    return int(np.clip(wanted, USUAL_DIGITS, MOST_DIGITS))


def stored_figures(
    titles: Mapping[str, tuple[str, str]], svgs: Mapping[str, str], *names: str
) -> tuple[Figure, ...]:  # fmt: skip
    """Return those of some figures that are stored. titles: name -> title and caption; svgs: name -> SVG."""
    return tuple(Figure(name, *titles[name], svg=svgs[name]) for name in names if name in svgs)


def titled(sentences: Mapping[str, Sequence[str]]) -> tuple[Sentences, ...]:
    """Return sentences under their titles, "" for none; a title without sentences is left out."""
    return tuple(Sentences(tuple(texts), title) for title, texts in sentences.items() if texts)


def correlation_tables(correlation: Mapping[str, Mapping[str, float | None]]) -> tuple[Table, ...]:
    rows = [(name, *row.values()) for name, row in correlation.items()]
    note = "Near +1 or -1: a change of one is made up for by the other."
    columns = ["parameter", *(Column(name, name, "+.3f") for name in correlation)]
    return (table("Correlation of the estimates", columns, rows, note),) if len(rows) > 1 else ()


def listed(names: Sequence[str], most: int | None = None) -> str:
    """Return names as in a sentence, from so many on the rest as a number: a, b and 3 more."""
    if most is not None and len(names) > most:
        return f"{', '.join(names[:most])} and {len(names) - most} more"
    return " and ".join(([", ".join(names[:-1])] if names[1:] else []) + list(names[-1:]))


def error_table(title: str, first: Sequence[str], rows: Sequence[tuple[Any, ...]], unit: str, note: str = "") -> Table:
    """Return a table of errors, of several outputs one below the other; rows end in the stored errors or None."""
    if len({name for *_, error in rows for name in (error or {}).get("outputs", ())}) > 1:
        return output_table(title, first, rows, note)
    name, factor = scale_of(unit)
    # what decides stands first: what a narrow screen leaves out is the rest
    digits = {"rmse": ".4g", "chi2_per_sample": ".4g", "s": ".4f", "nrmse": ".3%", "s1": ".4f", "s2": ".4f"}
    headers = {"rmse": f"RMSE, {name}", "nrmse": "NRMSE", "chi2_per_sample": "chi2/sample"}
    numbers = [Column(k, headers.get(k, k.upper()), d, factor if k == "rmse" else 1.0) for k, d in digits.items()]
    cells = []
    for *texts, error in rows:
        values = dict(error or dict.fromkeys(digits))
        if error is not None and error["chi2_per_sample"] is None:
            values["chi2_per_sample"] = "no noise"
        if error is not None and error["s2"] is None and error["s1"] is not None:
            values["s"] = values["s2"] = "not usable"
        cells.append((*texts, *(values[k] for k in digits)))
    return table(title, [*first, *numbers], cells, note)


def output_table(title: str, first: Sequence[str], rows: Sequence[tuple[Any, ...]], note: str) -> Table:
    """Return a table of errors of several outputs, a row for each, with its unit."""
    cells = [(*texts, name, f"{rmse_text(e, e['unit'])} {scale_of(e['unit'])[0]}", e["nrmse"],
              "no noise" if e["chi2_per_sample"] is None else e["chi2_per_sample"], e["s"])
             for *texts, error in rows for name, e in (error or {"outputs": {}})["outputs"].items()]  # fmt: skip
    columns = ["output", "RMSE", Column("nrmse", "NRMSE", ".3%"), Column("chi2", "chi2/sample", ".4g"),
               Column("s", "S", ".4f")]  # fmt: skip
    return table(title, [*first, *columns], cells, note)


def others_text(*errors: Mapping[str, Any] | None) -> str:
    """Return the RMSE of all outputs but the first, on each of some sets of records, "" of one output."""
    said: dict[str, list[str]] = {}
    for error in (e for e in errors if e is not None):
        first = next((e for e in error.get("outputs", {}).values() if e["rmse"] == error["rmse"]), None)
        for name, e in error.get("outputs", {}).items():
            if e is not first:
                said.setdefault(name, []).append(f"{rmse_text(e, e['unit'])} {scale_of(e['unit'])[0]}")
    return "".join(f" {name}: {' and '.join(texts)}." for name, texts in said.items())


def noise_text(noise: float, output: Mapping[str, Any], error: Mapping[str, Any], unseen: bool) -> str:
    """Return the noise of an output, what noise of the inputs does to it, and whether that may be all that is left.

    noise: [unit]. output: its entry of "outputs". error: of the model on the records that are spoken of; unseen:
    whether these are held out.
    """
    value, unit = shown(noise, output["unit"])
    text, moved = f"the noise is {value:.3g} {unit}", moved_of(output, unseen)
    text += f" ({output['noise_in_motion']})" if output.get("noise_in_motion") else ""
    if not inputs_act(noise, moved, error["rmse"]):
        return text
    text += f"; that of the inputs moves the model by {shown(moved, output['unit'])[0]:.3g} {unit}"
    return text + (", and what remains may be that alone" if may_be_inputs(noise, moved, error["rmse"]) else "")


def moved_text(outputs: Mapping[str, Mapping[str, Any]], error: Mapping[str, Any], unseen: bool) -> str:
    """Return how far noise of the inputs moves each output but the first, where this shows.

    error: of all outputs, on the records that are spoken of; unseen: whether these are held out.
    """
    text = ""
    for name, output in list(outputs.items())[1:]:
        left = error["outputs"].get(name, {"rmse": None})["rmse"]
        by = moved_of(output, unseen)
        if inputs_act(output["noise_rms"], by, left):
            (moved, unit), (noise, _) = (shown(x, output["unit"]) for x in (by, output["noise_rms"]))
            text += f" Noise of the inputs moves {name} by {moved:.3g} {unit}; that of its sensor is {noise:.3g}."
    return text


def moved_of(output: Mapping[str, Any], unseen: bool) -> float:
    """Return how far noise of the inputs moves an output, on unseen records or those that were fitted.

    Results of before this was asked do not hold it.
    """
    moved = output.get("moved_by_inputs", 0.0)
    return float(output.get("moved_by_inputs_holdout", moved) if unseen else moved)


def may_be_inputs(noise: float, moved: float, left: float | None) -> bool:
    """Tell whether what is left of a model, an RMSE, may be what noise of the inputs does to it."""
    return left is not None and inputs_act(noise, moved, left) and left < NO_MORE * float(np.hypot(noise, moved))


def inputs_act(noise: float, moved: float, left: float | None) -> bool:
    """Tell whether noise of the inputs moves an output by more than its own noise, and shows in what is left, an RMSE.

    Where it does not show, the inputs are exact: their steps are those of a command. Next to much larger errors it
    does not show either.
    """
    if left is None or moved < max(noise, LEAST_OF_LEFT * left):
        return False
    return left > float(np.hypot(noise, LEFT_OF_MOVED * moved))


def rmse_text(error: Mapping[str, Any], unit: str) -> str:
    if error["rmse"] is not None:
        return f"{shown(error['rmse'], unit)[0]:.4g}"
    others = error.get("outputs") or {}
    # what diverges stands among the outputs, too
    return "not recorded" if others and all(e["rmse"] is not None for e in others.values()) else "not finite"


def records_note(shown_records: int, there_are: int) -> str:
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
    return {"x": five_digits(x[kept]), "y": five_digits(y[kept])}


def five_digits(values: Array) -> list[float | None]:
    with np.errstate(invalid="ignore"):
        scale = 10.0 ** (4.0 - np.floor(np.log10(np.maximum(np.abs(values), 1e-200))))
        short = np.round(values * scale) / scale
    return [v if isfinite(v) else None for v in short.tolist()]


def points(curve: Mapping[str, Any]) -> tuple[Array, Array]:
    return np.array(curve["x"], dtype=float), np.array(curve["y"], dtype=float)


def small_axes(width: float, height: float, heights: tuple[float, ...] = (1,)) -> tuple[Any, list[Any]]:
    """Return a figure of this size [inch] for a gallery, with axes above each other."""
    # margins in inches: they cost a tenth of the time that a layout engine takes, and there are many figures
    place = {"left": 1.1 / width, "right": 1.0 - 0.1 / width, "bottom": 0.6 / height, "top": 1.0 - 0.1 / height}
    figure, axes = pyplot().subplots(len(heights), 1, figsize=(width, height), height_ratios=heights, squeeze=False,
                                     sharex=True, gridspec_kw=place | {"hspace": 0.12})  # fmt: skip
    for axis in axes.flat:
        axis.margins(x=0.01)
        place_labels(axis)
    return figure, list(axes.flat)


def record_axes(n: int, height: float, heights: Sequence[float] = (1,)) -> tuple[Any, list[list[Any]]]:
    """Return a figure for n records in one or two columns, with room for title and legend, and the axes of each record.

    height: of a row of records [inch]; heights: shares of the axes of a record.
    """
    columns, k = 1 if n == 1 else 2, len(heights)
    rows = -(-n // columns)
    # as for `small_axes` margins are given, in inches: a layout engine takes longer than all the drawing
    width, above, below, gap, between = 6.8 * columns, 0.95, 1.0, 0.85, 1.1
    total = height * rows + above + below - gap
    figure = pyplot().figure(figsize=(width, total))
    grid = figure.add_gridspec(
        rows, columns, left=between / width, right=1.0 - 0.15 / width, bottom=below / total, top=1.0 - above / total,
        wspace=between / (6.8 - between), hspace=gap / (height - gap),
    )  # fmt: skip
    cells = []
    for i in range(n):
        inner = grid[i // columns, i % columns].subgridspec(k, 1, height_ratios=list(heights), hspace=0.08)
        cells.append([figure.add_subplot(inner[j, 0]) for j in range(k)])
        for axis in cells[-1]:
            place_labels(axis)
    return figure, cells
