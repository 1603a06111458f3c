"""LaTeX of tables: compiled where LaTeX is there, and no line of it is wider than the text."""

import re
import shutil
import subprocess

import numpy as np
import pytest
from made_results import PAPER_CASES, made

from armid.report.document import Column, table
from armid.report.files import latex, symbol
from armid.study.analyses.analysis import Evidence
from armid.study.analyses.paper_tables import paper_layout
from armid.study.document import report_of

PREAMBLE = r"""\documentclass{article}
\usepackage[utf8]{inputenc}
\usepackage{booktabs,siunitx,graphicx}
\begin{document}
"""


def log_of(texts, folder):
    """Compile tables in `article` and return the log."""
    if shutil.which("pdflatex") is None:
        pytest.skip("pdflatex is not installed: the width of a table cannot be measured")
    body = "\n\\clearpage\n".join(texts)
    (folder / "all.tex").write_text(f"{PREAMBLE}{body}\n\\end{{document}}\n", encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "all.tex"]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", check=False)
    assert run.returncode == 0, run.stdout[-2000:]
    return (folder / "all.log").read_text(errors="replace")


def wide(n_columns=14, n_rows=70):
    rng = np.random.default_rng(1)
    columns = ["setting", "identifier", *(Column(f"c{i}", f"largest relative error {i} [%]", ".3g")
                                          for i in range(n_columns))]  # fmt: skip
    rows = [("noise-free", f"multistart+least_squares {i}", *10.0 ** rng.uniform(-6, 4, n_columns))
            for i in range(n_rows)]  # fmt: skip
    return table("Wide & long", columns, rows, "50 % of $x_1$ <is> {odd} \\here ~ ^." * 8, "wide")


def test_tables_of_any_width_and_length_and_those_of_a_study_fit_the_text(tmp_path):
    own = [latex(t) for kind in ("table1", "table2") for t in report_of(made(seeds=2, report=kind)).tables if t.most]
    rows = [("a/very/long/path/of_a_file_that_no_line_takes/and/more_of_it.csv " * 3, 1.0), ("short", -2.5e-7)]
    texts = table("Texts", ["what", Column("v", "eta3 [%]", "+.2e")], rows, "Words.", "texts")
    log = log_of([latex(wide()), latex(texts), *own], tmp_path)
    assert "Overfull" not in log
    assert "Float too large" not in log


def test_table_1_is_laid_out_as_the_paper_prints_it():
    evidence = Evidence(made(seeds=3))
    part = paper_layout(evidence, "Table I", with_truth=True)
    rows = {(source, case): row for source, case, *row in part.frame.itertuples(index=False)}
    assert [round(100.0 * x, 3) for x in rows["the paper", "mean"][2::3]] == [0.487, 0.421, 0.171, 0.899]
    own = evidence.estimates.query("variant == 'pso' and setting == '0.3 deg/s' and case == 'row 2'")
    found = own[own["parameter"] == "eta3"]["value"].median()
    assert rows["pso, 0.3 deg/s", "row 2"][6:9] == pytest.approx([0.60, found, abs(found - 0.60) / 0.60])
    text = latex(part)
    assert r"\multicolumn{3}{c}{$\eta_{3}$}" in text
    assert text.count(r"\begin{tabular}{") == 1
    assert r"row 3 & 3.00 & 3.0321 & 1.070 & 0.90 & 0.8986 & 0.156 & 0.58" in text


def test_table_2_has_the_papers_means_and_deviations():
    found = {"p0": 3.0215e6, "k": 0.9973, "eta3": 0.5338, "n": 1.4986}, {"p0": 3.0641e6, "k": 0.9991}
    cases = [{**case, "published": {**found[0], **found[i % 2]}} for i, case in enumerate(PAPER_CASES)]
    part = paper_layout(Evidence(made(seeds=2, cases=cases)), "Table II", with_truth=False)
    rows = {(source, case): row for source, case, *row in part.frame.itertuples(index=False)}
    assert rows["the paper", "mean"][1] == pytest.approx((3 * 3.0215e6 + 2 * 3.0641e6) / 5)
    assert rows["the paper", "deviation"][1] == pytest.approx(np.std([3.0215e6] * 3 + [3.0641e6] * 2))
    assert np.isnan([rows["the paper", "row 1"][i] for i in (0, 2)]).all()


def test_every_row_of_a_long_table_is_written_once_and_names_become_symbols():
    text = latex(wide())
    assert all(len(re.findall(rf"least\\_squares {i} &", text)) == 1 for i in range(70))
    assert len(set(re.findall(r"\\label{(.*)}", text))) == text.count(r"\end{table}") == 2
    symbols = {"p0": "$p_{0}$", "eta3": r"$\eta_{3}$", "k": "$k$", "a": "a", "mass": "mass", "tau": r"$\tau$",
               "coulomb.torque_1": r"coulomb.torque\_1"}  # fmt: skip
    assert {name: symbol(name) for name in symbols} == symbols
