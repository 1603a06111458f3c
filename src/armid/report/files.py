"""Write a document to files: Markdown, tables as CSV with every digit and as LaTeX, figures as PNG and SVG, or PDF.

LaTeX uses `booktabs`, numbers are aligned by `siunitx`, and `graphicx` makes a wide table smaller until it fits: a
document needs these three packages. A long table is several floats; each repeats the headings.
"""

import re
from collections.abc import Callable, Sequence
from itertools import groupby, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armid.report.document import Cell, Column, Document, Figure, Gallery, Listing, Part, Sentences, Table, Text
from armid.report.style import save, save_for_print
from armid.units import angles_in

if TYPE_CHECKING:
    from pandas import DataFrame


# What a cell begins with that a spreadsheet computes.
FORMULA = ("=", "+", "-", "@", "\t", "\r")


def write_files(document: Document, path_of: Callable[[str], Path]) -> None:
    """Write each named table as CSV and LaTeX and each figure as PNG and SVG; the bytes hold no date and no place."""
    for table in document.tables:
        path_of(f"{table.name}.csv").write_text(csv(table), encoding="utf-8")
        if table.most:
            path_of(f"{table.name}.tex").write_text(latex(table), encoding="utf-8")
    with angles_in(document.angle):
        for figure in document.figures:
            save(figure.draw(), path_of(f"{figure.name}.png"), path_of(f"{figure.name}.svg"))


def write_prints(document: Document, width: str, path_of: Callable[[str], Path]) -> None:
    """Write each figure as PDF of the width of a page's "single" or "double" column."""
    with angles_in(document.angle):
        for figure in document.figures:
            save_for_print(figure.draw, path_of(f"{figure.name}.pdf"), width)


def csv(table: Table) -> str:
    """Return every row and number of the table, SI, as CSV; its header holds the keys of the columns."""
    from pandas import DataFrame

    frame = table.frame
    if not isinstance(frame, DataFrame):
        frame = DataFrame([list(row) for row in frame], columns=[c.key for c in table.columns])
    return csv_text(frame)


def csv_text(frame: "DataFrame") -> str:
    """Return a frame as CSV in which a spreadsheet finds no formula: names that look like one get an apostrophe."""
    from pandas.api.types import is_numeric_dtype

    safe = frame.rename(columns=no_formula)
    for i, kind in enumerate(frame.dtypes):
        if not is_numeric_dtype(kind):
            safe.isetitem(i, frame.iloc[:, i].map(no_formula).array)
    return str(safe.to_csv(index=False, lineterminator="\n"))


def no_formula(value: Any) -> Any:
    if not isinstance(value, str) or not value.startswith(FORMULA):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


def frame_of(table: Table) -> "DataFrame":
    """Return the rows that are shown under their headings, numbers in the units of these."""
    from pandas import DataFrame

    heads = [c.header or c.key for c in table.columns]
    frame = DataFrame([[c.text or None for c in row] for row in table.cells()], columns=heads)
    for i, column in enumerate(table.columns):
        if column.digits:
            numbers = [np.nan if row[i].number is None else row[i].number for row in table.cells()]
            frame.isetitem(i, column.factor * np.array(numbers, dtype=float))
    return frame


def markdown(document: Document, made_by: str = "") -> str:
    """Return the page; made_by: a last sentence of its head, which may hold `code`."""
    texts = [f"# {escaped(document.title)}", escaped(document.question)]
    texts += [f"**{escaped(sentence)}**" for sentence in (document.warning, *document.answer[:1]) if sentence]
    texts += [escaped(" ".join(document.answer[1:])), bullets(document.facts), made_by]
    for section in document.sections:
        texts += [f"## {escaped(section.title)}", escaped(section.text)]
        texts += [text for part in section.parts for text in part_texts(part, section.title)]
    return "\n\n".join(part for part in texts if part) + "\n"


def part_texts(part: Part, section: str) -> list[str]:
    if isinstance(part, Text):
        return [escaped(part.text)]
    if isinstance(part, Gallery):
        return [f"![{escaped(part.slider or part.name)}]({part.name}.png)"] if part.name else []
    if (isinstance(part, Table) and not part.most) or (isinstance(part, Listing) and part.folded):
        return []
    title = f"### {escaped(part.title)}" if part.title not in ("", section) else ""
    if isinstance(part, Table):
        return [title, table_text(part), escaped(part.note)]
    if isinstance(part, Figure):
        return [title, f"![{escaped(part.title)}]({part.name}.png)", escaped(part.caption)]
    return [title, bullets(part.sentences) if isinstance(part, Sentences) else code(part)]


def table_text(table: Table) -> str:
    header = [escaped(c.header) for c in table.columns]
    rule = ["---:" if c.digits else "---" for c in table.columns]
    rows = [[f"~~{escaped(c.text)}~~" if c.is_struck else escaped(c.text) for c in row] for row in table.cells()]
    return "\n".join(f"| {' | '.join(line)} |" for line in (header, rule, *rows))


def bullets(sentences: tuple[str, ...]) -> str:
    return "\n".join(f"- {escaped(sentence)}" for sentence in sentences)


def code(listing: Listing) -> str:
    """Return lines as they are, in a fence that none of them closes."""
    marked = any(line.mark for line in listing.lines)
    lines = [f"{line.mark or ' '} {line.text}" if marked else line.text for line in listing.lines]
    fence = "`" * max(3, *(1 + len(run) for run in re.findall("`+", "\n".join(lines))), 3)
    return "\n".join([fence + ("diff" if marked else "text"), *lines, fence])


def escaped(text: str) -> str:
    """Return text that stays in its place and as it is: one cell, no HTML, no link, no image, no emphasis."""
    for plain, safe in (("\\", "\\\\"), ("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("|", "\\|"), ("\n", " ")):
        text = text.replace(plain, safe)
    text = re.sub(r"\*|~~|(?<!\w)_|_(?!\w)", r"\\\g<0>", text)
    # every kind of link and image has a closing bracket before one of these
    return re.sub(r"\](?=\s*[(\[:])", r"\\]", text)


# Rows of one float at most: of \footnotesize, under a caption, so many fit a page of `article`.
MOST_ROWS = 38
# Text of more letters is broken to a column of this width [pt].
LONG_CELL, BROKEN = 40, 145
# A box no wider than the text.
FITTED = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{"
GREEK = (
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu", "xi",
    "pi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega",
)  # fmt: skip
SYMBOL = re.compile(rf"({'|'.join(GREEK)}|[b-zA-Z])(\d*)")
LATEX_NUMBER = re.compile(r"([-+]?)(\d+)(?:\.(\d+))?(?:e([-+]?\d+))?")


def latex(table: Table) -> str:
    """Return a table as one or several floats of LaTeX, the caption in the first."""
    rows = table.cells()
    floats: list[str] = []
    for begin in range(0, max(len(rows), 1), MOST_ROWS):
        n = len(floats) + 1
        caption = f"{table.title}. {table.note}".strip() if n == 1 else f"{table.title}, part {n}."
        label = f"tab:{table.name}{'' if n == 1 else f'-{n}'}"
        floats.append(one_float(table, rows[begin : begin + MOST_ROWS], latex_text(caption), label))
    return "\n".join(floats)


def one_float(table: Table, rows: Sequence[Sequence[Cell]], caption: str, label: str) -> str:
    headed = table.grouped and len(table.columns) > 1
    shown, cells = table.columns[headed:], [row[headed:] for row in rows]
    forms = [form(c, [row[i].text for row in cells]) for i, c in enumerate(shown)]
    lines = [
        r"\begin{table}[htbp]", r"\centering", rf"\caption{{{caption}}}", rf"\label{{{label}}}", r"\footnotesize",
        rf"\setlength{{\tabcolsep}}{{2.5pt}}{FITTED}\begin{{tabular}}{{@{{}}{' '.join(forms)}@{{}}}}", r"\toprule",
    ]  # fmt: skip
    if any(c.group for c in shown):
        lines += group_lines(shown)
    lines += [" & ".join(stacked(c.header.removeprefix(c.group)) for c in shown) + r" \\", r"\midrule"]
    for k, (heading, own) in enumerate(groupby(rows, key=lambda row: row[0].text if headed else "")):
        if headed:
            lines += [r"\addlinespace"] * (k > 0)
            lines += [rf"\multicolumn{{{len(shown)}}}{{@{{}}l}}{{\emph{{{latex_text(heading)}}}}} \\"]
        lines += [" & ".join(cell_text(*pair) for pair in zip(row[headed:], shown, strict=True)) + r" \\"
                  for row in own]  # fmt: skip
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}}", r"\end{table}", ""])


def group_lines(shown: Sequence[Column]) -> list[str]:
    """Return the headings over several columns, and the rules below them."""
    spans = [(group, len(list(own))) for group, own in groupby(shown, key=lambda c: c.group)]
    ends = [sum(n for _, n in spans[:i]) for i in range(len(spans) + 1)]
    heads = [rf"\multicolumn{{{n}}}{{c}}{{{' '.join(map(symbol, group.split()))}}}" for group, n in spans]
    rules = [
        rf"\cmidrule(lr){{{a + 1}-{b}}}" for (a, b), (group, _) in zip(pairwise(ends), spans, strict=True) if group
    ]
    return [" & ".join(heads) + r" \\", "".join(rules)]


def form(column: Column, texts: Sequence[str]) -> str:
    """Return the type of a column: `S` for numbers, with their digits; long text has a width."""
    if not column.digits:
        return f"p{{{BROKEN}pt}}" if max(map(len, texts), default=0) > LONG_CELL else "l"
    matches = [m for m in (LATEX_NUMBER.fullmatch(text.replace(",", "")) for text in texts) if m]
    if not matches:
        return "r"
    sign, whole, part, power = (max(len((m[i] or "").lstrip("-+" if i == 4 else "")) for m in matches)
                                for i in (1, 2, 3, 4))  # fmt: skip
    return f"S[table-format={'-' * sign}{whole}.{part}{f'e-{power}' if power else ''}]"


def cell_text(cell: Cell, column: Column) -> str:
    if column.digits:
        number = cell.text.replace(",", "")
        return number if LATEX_NUMBER.fullmatch(number) else f"{{{latex_text(cell.text)}}}"
    if column.key == "parameter":
        return symbol(cell.text)
    text = latex_text(cell.text)
    # a name of a file has no space to break it at
    return re.sub(r"(/|\\_|\.)", r"\1\\allowbreak{}", text) if len(cell.text) > LONG_CELL else text


def stacked(header: str) -> str:
    """Return a heading with each of its words on a line, so that it is no wider than its numbers."""
    words = r"\\".join(map(symbol, header.split()))
    return rf"{{\shortstack{{{words}}}}}"


def symbol(name: str) -> str:
    """Return the symbol of a parameter such as "eta3", or a word as it is."""
    match = SYMBOL.fullmatch(name)
    if match is None:
        return latex_text(name)
    letter = rf"\{match[1]}" if match[1] in GREEK else match[1]
    return f"${letter}_{{{match[2]}}}$" if match[2] else f"${letter}$"


def latex_text(text: str) -> str:
    # a bracket behind the end of a line would be its distance
    special = {c: f"\\{c}" for c in "&%$#_{}"} | {"~": "\\textasciitilde{}", "^": "\\textasciicircum{}"}
    special |= {"\\": "\\textbackslash{}", "<": "\\textless{}", ">": "\\textgreater{}", "|": "\\textbar{}", "[": "{[}"}
    return "".join(special.get(letter, letter) for letter in text)
