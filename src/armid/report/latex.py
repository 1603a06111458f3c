"""LaTeX of a table: `booktabs`, numbers aligned by `siunitx`, a wide table made smaller by `graphicx` until it fits.

A long table is several floats; each repeats the headings. A document needs these three packages.
"""

import re
from collections.abc import Sequence
from itertools import groupby, pairwise

from armid.report.document import Cell, Column, Table

# Rows of one float at most: of \footnotesize, under a caption, so many fit a page of `article`.
MOST_ROWS = 38
# Text of more letters is broken to a column of this width [pt].
LONG, BROKEN = 40, 145
# A box no wider than the text.
FITTED = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{"
GREEK = (
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu", "xi",
    "pi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega",
)  # fmt: skip
SYMBOL = re.compile(rf"({'|'.join(GREEK)}|[b-zA-Z])(\d*)")
NUMBER = re.compile(r"([-+]?)(\d+)(?:\.(\d+))?(?:e([-+]?\d+))?")


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
    heads = [rf"\multicolumn{{{n}}}{{c}}{{{heading_text(group)}}}" for group, n in spans]
    rules = [
        rf"\cmidrule(lr){{{a + 1}-{b}}}" for (a, b), (group, _) in zip(pairwise(ends), spans, strict=True) if group
    ]
    return [" & ".join(heads) + r" \\", "".join(rules)]


def form(column: Column, texts: Sequence[str]) -> str:
    """Return the type of a column: `S` for numbers, with their digits; long text has a width."""
    if not column.digits:
        return f"p{{{BROKEN}pt}}" if max(map(len, texts), default=0) > LONG else "l"
    matches = [m for m in (NUMBER.fullmatch(text.replace(",", "")) for text in texts) if m]
    if not matches:
        return "r"
    sign, whole, part, power = (max(len((m[i] or "").lstrip("-+" if i == 4 else "")) for m in matches)
                                for i in (1, 2, 3, 4))  # fmt: skip
    return f"S[table-format={'-' * sign}{whole}.{part}{f'e-{power}' if power else ''}]"


def cell_text(cell: Cell, column: Column) -> str:
    if column.digits:
        number = cell.text.replace(",", "")
        return number if NUMBER.fullmatch(number) else f"{{{latex_text(cell.text)}}}"
    if column.key == "parameter":
        return symbol(cell.text)
    text = latex_text(cell.text)
    # a name of a file has no space to break it at
    return re.sub(r"(/|\\_|\.)", r"\1\\allowbreak{}", text) if len(cell.text) > LONG else text


def stacked(header: str) -> str:
    """Return a heading with each of its words on a line, so that it is no wider than its numbers."""
    words = r"\\".join(map(symbol, header.split()))
    return rf"{{\shortstack{{{words}}}}}"


def heading_text(text: str) -> str:
    return " ".join(symbol(word) for word in text.split())


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
