"""The whole document of a study: what it says, its files, the same bytes for the same results."""

import os
import re
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from made_results import BOX, PAPER_CASES, made

from armid.cli.new import filled
from armid.contract.check import check_thing
from armid.errors import ArmidError
from armid.registry import load_registry
from armid.report.files import markdown, write_files
from armid.study.document import ANALYSES, own_sections, parts_of, report_of
from commands import python


def written(results, folder):
    folder.mkdir(exist_ok=True)
    names = ["report.md"]
    document = report_of(results, again="armid report x")
    write_files(document, lambda name: names.append(name) or folder / name)
    (folder / "report.md").write_text(markdown(document), encoding="utf-8")
    return names


def small():
    identifiers = {"pso": 3e-3, "pso+bobyqa": 1e-6}
    return made(report="table1", failed=2, seeds=2, noises=(0.0,), identifiers=identifiers)


@pytest.fixture(scope="module")
def table1_report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    return folder, written(small(), folder)


def drawn(results):
    """Names of tables and figures, each figure drawn."""
    document = report_of(results)
    for figure in document.figures:
        plt.close(figure.draw())
    return {part.name for part in (*document.tables, *document.figures)}


@pytest.mark.nightly
def test_the_page_has_every_file_table_and_figure_and_tells_what_it_is_made_of(table1_report):
    folder, names = table1_report
    assert sorted(p.name for p in folder.iterdir()) == sorted(names)
    figures = re.findall(r"\]\(([a-z0-9_]+\.png)\)", (folder / "report.md").read_text())
    assert sorted(figures) == sorted(n for n in names if n.endswith(".png"))
    for name in figures:
        assert (folder / f"{Path(name).stem}.svg").read_text().startswith("<?xml")
        image = matplotlib.image.imread(folder / name)[:, :, :3]
        assert np.mean(image.min(axis=2) < 0.9) > 0.005, name
    text = (table1_report[0] / "report.md").read_text()
    for wanted in ("Does the report hold?", "Complete: 20 of 20 runs, 2 of them failed", "Synthetic: records are",
                   "armid report x", "mean of the rows", "failed: it broke", "Friedman's test needs"):  # fmt: skip
        assert wanted in text
    assert not re.search(r"\b(nan|None|NaN)\b", text)
    overview = pd.read_csv(folder / "overview.csv")
    assert len(overview) == 1 + 2
    assert overview.loc[overview["n_failed_runs"] > 0, "largest_worst"].iloc[0] == np.inf
    stems = {end: {Path(n).stem for n in names if n.endswith(end)} for end in (".tex", ".csv")}
    assert stems[".tex"] < stems[".csv"]
    latex = (folder / "runs.tex").read_text()
    assert len(re.findall(r"^[^\\].* \\\\$", latex, re.MULTILINE)) == 1 + 2
    assert r"diverged\\{[}\%]" in latex


@pytest.mark.nightly
def test_same_results_give_the_same_bytes_in_another_process_and_order(table1_report, tmp_path):
    """Neither hash seeds nor the order in which two runners have finished the runs enter."""
    code = (
        "import sys; sys.path[:0] = sys.argv[1:3]; import test_study_document as test\n"
        "results = test.small()\n"
        "mixed = test.replace(results, runs=results.runs.sample(frac=1.0, random_state=3), kept=results.kept[::-1])\n"
        "test.written(mixed, test.Path(sys.argv[3]))"
    )
    folders = (Path(__file__).parent, Path(__file__).parents[1], tmp_path / "out")
    done = python("-c", code, *folders, env=os.environ | {"PYTHONHASHSEED": "7"})
    assert done.returncode == 0, done.stderr
    folder, names = table1_report
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(names)
    for name in names:
        assert (folder / name).read_bytes() == (tmp_path / "out" / name).read_bytes(), name


def test_a_study_that_is_not_complete_says_so_first_and_what_cannot_be_reported_is_refused(tmp_path):
    results = made(seeds=1)
    document = report_of(replace(results, study=results.study | {"n_planned": 500}))
    assert document.warning == "NOT COMPLETE: 30 of 500 runs have ended; every number below is of these."
    assert markdown(document).index("NOT COMPLETE") < markdown(document).index("## Overview")
    with pytest.raises(ArmidError, match="has no finished run"):
        report_of(replace(results, runs=results.runs[:0], parameters=results.parameters[:0], kept=[]))
    with pytest.raises(ArmidError, match="knows its truths, a key is not expected"):
        report_of(results, tmp_path / "key.json")
    with pytest.raises(ArmidError, match="is of kind 'loop', one of identify, close_loop is expected"):
        report_of(replace(results, study=results.study | {"kind": "loop"}))


@pytest.mark.slow
@pytest.mark.parametrize(("change", "there"), [
    ({"noises": (0.3,), "identifiers": {"pso": 1e-3}, "failed": 1}, {"overview", "ecdf", "runs"}),
    ({"noises": (0.0,), "identifiers": {"pso": 1e-3, "de": 1e-2}, "fitness": ("rmse", "similarity")},
     {"fitness", "convergence_rmse"}),
    ({"noises": (0.3,), "windows": ("0-0.7 s", "whole"), "report": "table2"}, {"table2", "table_ii_as_printed"}),
])  # fmt: skip
def test_studies_of_other_shapes(change, there):
    assert there <= drawn(made(cases=PAPER_CASES[:2], seeds=1, **change))


def test_all_runs_failed_and_names_of_a_file_make_names_of_files(tmp_path):
    results = made(seeds=1, noises=(0.0,), failed=15)
    assert report_of(results).answer[0] == "No run has a result."
    names = written(results, tmp_path / "out")
    assert names == ["report.md", *(f"{n}.{end}" for n in ("values", "runs", "reasons") for end in ("csv", "tex"))]
    assert "15 of them failed" in (tmp_path / "out" / "report.md").read_text()
    results = made(seeds=1, identifiers={"a|b<script>": 1e-3, "A B": 1e-2, "a/b": 1e-2}, report="table1")
    names = [t.name for t in report_of(results).tables]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[a-z0-9_]+", n) for n in names)


def test_without_a_truth_there_are_values_and_costs_and_no_errors():
    results = made(cases=PAPER_CASES[:2], seeds=2)
    results.study["cases"] = [c | {"truth": {}, "campaign": "campaigns/mine"} for c in results.study["cases"]]
    results.parameters[["truth", "relative_error"]] = np.nan
    names = drawn(results)
    assert {"values", "fixed_target", "waterfall", "convergence_fitness"} <= names
    assert not {"success", "ecdf", "valley", "overview", "error_map", "ranks"} & names
    document = report_of(results)
    assert "Records of campaigns/mine." in document.facts
    medians = results.runs.groupby("identifier")["value"].median()
    assert document.answer[0] == (
        f"No truth is known. Lowest median fitness: {medians.idxmin()}, {medians.min():.6g} of similarity."
    )


def test_twenty_cases_have_critical_differences_and_realisations_of_noise_their_bound():
    rng = np.random.default_rng(7)
    many_cases = [{"name": f"case {i}", "truth": {n: rng.uniform(*box) for n, box in BOX.items()}} for i in range(24)]
    many = report_of(made(cases=many_cases, seeds=1, noises=(0.0,)))
    assert "critical_difference" in [f.name for f in many.figures]
    results = made(cases=many_cases[:2], seeds=25, noises=(0.3,))
    noisy = report_of(results)
    assert "cramer_rao" in [t.name for t in noisy.tables]
    assert "critical_difference" not in [f.name for f in noisy.figures]
    # seeds on one record are no noise realisations
    recorded = replace(results, runs=results.runs.assign(noise_deg_s=np.nan))
    assert "cramer_rao" not in [t.name for t in report_of(recorded).tables]


def test_the_answer_is_that_of_the_main_table():
    document = report_of(made(report="table1", seeds=3, noises=(0.0, 0.3)))
    table = document.main[0].frame
    for setting in ("noise-free", "0.3 deg/s"):
        own = table[table["setting"] == setting].set_index("variant")
        said = re.search(rf"{setting}: (\S+)(?: \(mean rank [^)]+\))?, largest error of a run (\S+) % \(median\), "
                         r"(\S+) % ", document.answer[1])  # fmt: skip
        best = own.loc[said[1]]
        assert said[2] == f"{100 * best['largest_median']:.3g}"
        assert said[3] == f"{100 * best['largest_p95']:.3g}"
    assert document.answer[2] == "Complete: 90 of 90 runs."
    assert re.match(
        r"(Yes|Reproduced|Beaten|No)\b.* \(0.3 deg/s\): the paper's printed values are off by [\d.]+ %",
        document.answer[0],
    )


def test_the_starting_file_is_a_plug_in_that_becomes_a_section(tmp_path):
    (tmp_path / "my_costs.py").write_text(filled("analysis.py.txt", name="my_costs"), encoding="utf-8")
    own = load_registry([f"{tmp_path / 'my_costs.py'}:my_costs"]).analyses
    with pytest.raises(ArmidError, match="'my_costs' has no contract: `armid report DIR"):
        list(check_thing("analyses", "my_costs", own["my_costs"]))
    document = report_of(made(seeds=1, failed=1), own=own)
    section = next(s for s in document.sections if s.title == "My costs")
    assert [p.name for p in section.parts] == ["own_my_costs_medians_over_the_runs", "own_my_costs_every_run"]
    table, figure = section.parts
    assert table.frame["used"].notna().all()
    assert figure.draw().axes
    plt.close("all")


def test_tables_and_figures_in_any_form():
    frame = pd.DataFrame({"n": [1]})
    figure, axes = plt.subplots()
    assert parts_of("mine", None) == {}
    assert list(parts_of("mine", frame)) == ["mine"]
    assert parts_of("mine", (frame, axes)) == {"mine 1": frame, "mine 2": figure}
    assert parts_of("mine", {"Cost": figure}) == {"Cost": figure}
    plt.close(figure)
    index = pd.DataFrame({"n": [1]}, index=pd.Index([1], name="n"))
    for broken in (3.0, pd.Series([1]), pd.DataFrame([[1, 2]], columns=["n", "n"]), index):
        with pytest.raises(ArmidError, match="analysis 'mine' returns"):
            parts_of("mine", broken)


def test_missing_cells_are_empty_names_of_files_differ_and_names_of_ours_are_taken():
    frame = pd.DataFrame({"n": [1, None], "label": ["a", None]}).convert_dtypes()
    (section,) = own_sections({"mine": lambda runs: frame}, pd.DataFrame())
    assert [[c.text for c in row] for row in section.parts[0].cells()] == [["1", "a"], ["", ""]]
    frame = pd.DataFrame({("n", "mean"): [1.5]}, index=pd.Index(["pso"], name="variant"))
    (section,) = own_sections({"mine": lambda runs: {"A b": frame, "a_B": frame}}, pd.DataFrame())
    assert [p.name for p in section.parts] == ["own_mine_a_b", "own_mine_a_b_2"]
    assert [(c.header, c.digits) for c in section.parts[0].columns] == [("variant", ""), ("n mean", ".6g")]
    assert len({a.name for a in ANALYSES}) == len(ANALYSES)
    with pytest.raises(ArmidError, match="analyses: 'ranks' is there already"):
        report_of(made(seeds=1), own={"ranks": lambda runs: None})
