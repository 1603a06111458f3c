"""An analysis of a user: a plug-in, its contract, and its section in the report."""

import matplotlib.pyplot as plt
import pandas as pd
import pytest

from armid.cli.new import python_file
from armid.contract.check import check_thing
from armid.errors import ArmidError
from armid.registry import load_registry
from armid.study.document import ANALYSES, own_sections, parts_of, report_of


def test_the_starting_file_is_a_plug_in_that_becomes_a_section(made, tmp_path):
    (tmp_path / "my_costs.py").write_text(python_file("analysis", "my_costs"), encoding="utf-8")
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


def test_what_is_missing_is_an_empty_cell():
    frame = pd.DataFrame({"n": [1, None], "label": ["a", None]}).convert_dtypes()
    (section,) = own_sections({"mine": lambda runs: frame}, pd.DataFrame())
    assert [[c.text for c in row] for row in section.parts[0].cells()] == [["1", "a"], ["", ""]]


def test_names_of_files_differ_and_an_index_of_names_is_a_column():
    frame = pd.DataFrame({("n", "mean"): [1.5]}, index=pd.Index(["pso"], name="variant"))
    (section,) = own_sections({"mine": lambda runs: {"A b": frame, "a_B": frame}}, pd.DataFrame())
    assert [p.name for p in section.parts] == ["own_mine_a_b", "own_mine_a_b_2"]
    assert [(c.header, c.digits) for c in section.parts[0].columns] == [("variant", ""), ("n mean", ".6g")]


def test_names_of_ours_are_taken(made):
    assert len({a.name for a in ANALYSES}) == len(ANALYSES)
    with pytest.raises(ArmidError, match="analyses: 'ranks' is there already"):
        report_of(made(seeds=1), own={"ranks": lambda runs: None})
