"""LaTeX of a table: `booktabs`, numbers aligned by `siunitx`, and no part wider than the text of the class `article`.

A table that is too wide is split between its columns, one that is too long between its rows. Each part repeats the
columns of text that it begins with. A document needs the packages `booktabs` and `siunitx`.
"""

import re
from collections.abc import Sequence
from itertools import groupby, pairwise
from math import ceil

from armid.report.document import Cell, Column, Table

# Text of `article` at 10 pt [pt], a little less so that a width which is estimated stays inside.
WIDTH, HEIGHT = 338.0, 520.0
# Of \footnotesize: half the space between columns, lines, and letters [pt]; widest text that is not broken.
SEP, LINE, BROKEN = 2.5, 10.0, 150.0
NARROW, LETTER, CAPITAL, BROAD = 2.8, 4.35, 6.1, 7.3
# Of the factor "x 10" and the sign of its power [pt].
POWER = 27.0
# Letters of a line of a caption, at \normalsize, and its height [pt].
CAPTION_LETTERS, CAPTION_LINE = 68, 12.5
GREEK = (
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu", "xi",
    "pi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega",
)  # fmt: skip
SYMBOL = re.compile(rf"({'|'.join(GREEK)}|[b-zA-Z])(\d*)")
NUMBER = re.compile(r"([-+]?)(\d+)(?:\.(\d+))?(?:e([-+]?\d+))?")


def latex(table: Table) -> str:
    """Return a table as one or several floats of LaTeX, the caption in the first."""
    rows = table.cells()
    keys = next((i for i, c in enumerate(table.columns) if c.digits), len(table.columns))
    headed = table.grouped and keys > 1
    first = list(range(headed, keys if keys < len(table.columns) else 1))
    widths = [width_of(c, [row[i] for row in rows]) for i, c in enumerate(table.columns)]
    parts = [first + own for own in split(widths, first, headed)]
    caption = latex_text(f"{table.title}. {table.note}".strip())
    left = HEIGHT - CAPTION_LINE * ceil(len(caption) / CAPTION_LETTERS) - 5.0 * LINE
    chunks = chunked(rows, max(int(left / LINE), 5), headed)
    floats: list[str] = []
    for columns in parts:
        for chunk in chunks:
            n = len(floats) + 1
            ending = "" if n == 1 else f"-{n}"
            text = caption if n == 1 else f"{latex_text(table.title)}, part {n}."
            floats.append(one_float(table, columns, chunk, widths, headed, (text, f"tab:{table.name}{ending}")))
    return "\n".join(floats)


def split(widths: Sequence[float], first: Sequence[int], headed: bool) -> list[list[int]]:
    """Return the columns of each part that follow the first ones, as many as the width takes."""
    taken = sum(widths[i] for i in first)
    parts: list[list[int]] = [[]]
    for i in range(len(widths)):
        if i in first or (headed and i == 0):
            continue
        if parts[-1] and taken + sum(widths[j] for j in parts[-1]) + widths[i] > WIDTH:
            parts.append([])
        parts[-1].append(i)
    return parts


def chunked(rows: Sequence[list[Cell]], most: int, headed: bool) -> list[list[list[Cell]]]:
    """Return rows in pieces of at most so many lines; a heading takes one and a half."""
    chunks: list[list[list[Cell]]] = [[]]
    used = 0.0
    for i, row in enumerate(rows):
        begins = headed and (i == 0 or rows[i - 1][0].text != row[0].text)
        lines = lines_of(row) + 1.5 * begins
        if chunks[-1] and used + lines > most:
            chunks.append([])
            used, lines = 0.0, lines + 1.5 * (headed and not begins)
        chunks[-1].append(row)
        used += lines
    return chunks


def one_float(
    table: Table, columns: Sequence[int], rows: Sequence[list[Cell]], widths: Sequence[float], headed: bool,
    named: tuple[str, str],
) -> str:  # fmt: skip
    shown = [table.columns[i] for i in columns]
    forms = [form(c, [row[i].text for row in rows], widths[i]) for i, c in zip(columns, shown, strict=True)]
    lines = [
        r"\begin{table}[htbp]", r"\centering", rf"\caption{{{named[0]}}}", rf"\label{{{named[1]}}}", r"\footnotesize",
        rf"\setlength{{\tabcolsep}}{{{SEP}pt}}", rf"\begin{{tabular}}{{@{{}}{' '.join(forms)}@{{}}}}", r"\toprule",
    ]  # fmt: skip
    if any(c.group for c in shown):
        lines += group_lines(shown)
    heads = [stacked(c.header.removeprefix(c.group).strip(), widths[i]) for i, c in zip(columns, shown, strict=True)]
    lines += [" & ".join(heads) + r" \\", r"\midrule"]
    for k, (heading, own) in enumerate(groupby(rows, key=lambda row: row[0].text if headed else "")):
        if headed:
            lines += [r"\addlinespace"] * (k > 0)
            lines += [rf"\multicolumn{{{len(shown)}}}{{@{{}}l}}{{\emph{{{latex_text(heading)}}}}} \\"]
        lines += [" & ".join(cell_text(row[i], c, widths[i]) for i, c in zip(columns, shown, strict=True)) + r" \\"
                  for row in own]  # fmt: skip
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""])


def group_lines(shown: Sequence[Column]) -> list[str]:
    """Return the headings over several columns, and the rules below them."""
    spans = [(group, len(list(own))) for group, own in groupby(shown, key=lambda c: c.group)]
    ends = [sum(n for _, n in spans[:i]) for i in range(len(spans) + 1)]
    heads = [rf"\multicolumn{{{n}}}{{c}}{{{heading_text(group)}}}" for group, n in spans]
    rules = [
        rf"\cmidrule(lr){{{a + 1}-{b}}}" for (a, b), (group, _) in zip(pairwise(ends), spans, strict=True) if group
    ]
    return [" & ".join(heads) + r" \\", "".join(rules)]


def form(column: Column, texts: Sequence[str], width: float) -> str:
    """Return the type of a column: `S` for numbers, with their digits; broken text has a width."""
    if not column.digits:
        return "l" if width < BROKEN else f"p{{{BROKEN - 2 * SEP:.0f}pt}}"
    found = numbers(texts)
    if not found:
        return "r"
    sign, whole, part, power = digits_of(found)
    return f"S[table-format={'-' * sign}{whole}.{part}{f'e-{power}' if power else ''}]"


def numbers(texts: Sequence[str]) -> list[re.Match[str]]:
    return [m for m in (NUMBER.fullmatch(text.replace(",", "")) for text in texts) if m]


def digits_of(found: Sequence[re.Match[str]]) -> list[int]:
    """Return the most letters of sign, whole part, decimals and exponent among some numbers."""
    return [max(len((m.group(i) or "").lstrip("-+" if i == 4 else "")) for m in found) for i in (1, 2, 3, 4)]


def cell_text(cell: Cell, column: Column, width: float) -> str:
    if column.digits:
        number = cell.text.replace(",", "")
        return number if NUMBER.fullmatch(number) else f"{{{latex_text(cell.text)}}}"
    if column.key == "parameter":
        return symbol(cell.text)
    text = latex_text(cell.text)
    return text if width < BROKEN else r"\raggedright " + re.sub(r"(/|\\_|\.)", r"\1\\allowbreak{}", text)


def width_of(column: Column, cells: Sequence[Cell]) -> float:
    """Return the width of a column with the space around it, estimated [pt]; long text is broken."""
    texts = [c.text for c in cells]
    longest = max((letters(t) for t in texts), default=0.0)
    if column.digits and (found := numbers(texts)):
        sign, whole, part, power = digits_of(found)
        aligned = CAPITAL * sign + LETTER * (whole + part) + NARROW + (POWER + LETTER * power) * (power > 0)
        longest = max([aligned, *(letters(t) for t in texts if not NUMBER.fullmatch(t.replace(",", "")))])
    words = column.header.removeprefix(column.group).split() or [""]
    return max(min(longest, BROKEN), *(letters(w) for w in words)) + 2 * SEP


def lines_of(row: Sequence[Cell]) -> int:
    return max(ceil(1.15 * letters(c.text) / BROKEN) for c in row) or 1


def letters(text: str) -> float:
    """Return the width of a text in small letters [pt], estimated."""
    return sum(BROAD if c in "mwMW%@" else CAPITAL if c.isupper() or c in "+=<>-" else NARROW if c in "il.,:;'|jtf "
               else LETTER for c in text)  # fmt: skip


def stacked(header: str, width: float) -> str:
    """Return a heading in as many lines as the width of its column asks for."""
    lines: list[str] = []
    for word in header.split():
        if lines and letters(f"{lines[-1]} {word}") <= width - 2 * SEP:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    text = r"\\".join(heading_text(line) for line in lines)
    return f"{{{text}}}" if len(lines) < 2 else rf"{{\begin{{tabular}}[b]{{@{{}}c@{{}}}}{text}\end{{tabular}}}}"


def heading_text(text: str) -> str:
    return " ".join(symbol(word) for word in text.split())


def symbol(name: str) -> str:
    """Return the symbol of a parameter such as "eta3", or a word as it is."""
    found = SYMBOL.fullmatch(name)
    if found is None:
        return latex_text(name)
    letter = rf"\{found[1]}" if found[1] in GREEK else found[1]
    return f"${letter}_{{{found[2]}}}$" if found[2] else f"${letter}$"


def latex_text(text: str) -> str:
    # a bracket behind the end of a line would be its distance
    special = {c: f"\\{c}" for c in "&%$#_{}"} | {"~": "\\textasciitilde{}", "^": "\\textasciicircum{}"}
    special |= {"\\": "\\textbackslash{}", "<": "\\textless{}", ">": "\\textgreater{}", "|": "\\textbar{}", "[": "{[}"}
    return "".join(special.get(letter, letter) for letter in text)
