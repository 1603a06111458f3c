"""Write a table: Markdown for the page, CSV with every digit, LaTeX for a paper."""

from pandas import DataFrame

from armid.study.tables.table import Table, shown_rows


def markdown(table: Table) -> str:
    """Return the table in Markdown, numbers to the right."""
    header = [escaped(c.header) for c in table.columns]
    rule = ["---:" if c.digits else "---" for c in table.columns]
    lines = [header, rule, *([escaped(text) for text in row] for row in shown_rows(table))]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def escaped(text: str) -> str:
    """Return text that stays one cell and carries no HTML."""
    for plain, safe in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("|", "\\|"), ("\n", " ")):
        text = text.replace(plain, safe)
    return text


def csv(table: Table) -> str:
    """Return every row and number of the table, SI, as CSV; its header holds the keys of the frame."""
    return str(table.frame.to_csv(index=False, lineterminator="\n"))


def latex(table: Table) -> str:
    """Return the table as a LaTeX float with booktabs rules."""
    frame = DataFrame(shown_rows(table), columns=[c.header for c in table.columns])
    align = "".join("r" if c.digits else "l" for c in table.columns)
    title = latex_text(table.title)
    return frame.to_latex(
        index=False, escape=True, column_format=align, caption=title, label=f"tab:{table.name}", position="htbp"
    )


def latex_text(text: str) -> str:
    """Return text in which LaTeX reads no command."""
    special = {c: f"\\{c}" for c in "&%$#_{}"} | {"~": "\\textasciitilde{}", "^": "\\textasciicircum{}"}
    special["\\"] = "\\textbackslash{}"
    return "".join(special.get(letter, letter) for letter in text)
