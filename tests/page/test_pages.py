"""Pages of made-up results: what they say, what they escape, how large they are."""

import json
import re
from html.parser import HTMLParser

import pytest
from stored import EVIL, SVG, loop_details, loop_report, study_report, write_loop

from armid.cli.report import LOOP, page_of_folder, result_in
from armid.errors import ArmidError
from armid.loop.document import loop_page
from armid.report.document import changed
from armid.report.html import html
from armid.study.document import study_page


class Elements(HTMLParser):
    """Collect start tags, attributes and the text outside of scripts and styles."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.texts = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes += attributes

    def handle_data(self, text):
        self.texts.append(text)

    @property
    def text(self):
        return " ".join(" ".join(self.texts).split())


def page_of(folder):
    return Elements(html(page_of_folder(folder, LOOP, "results/arm")))


def of_study(name="made_up", svgs=None):
    return html(study_page(study_report(name), svgs or {}, f"name = '{name}'", [f"{name}\n  x"], ["armid study x"]))


def test_a_closed_loop_says_what_the_issue_asks_for(tmp_path):
    page = page_of(write_loop(tmp_path / "loop"))
    text = page.text
    for wanted in (
        "What does the declared model of shell_transfer_arm lack", "Effects cannot be told apart: It lacks arm.",
        "Error on the records held out: 1.719 before, 0.3438 deg/s RMSE after; the noise is 0.229 deg/s.",
        "To be trusted: p0 = 3 MPa (2.7 to 3.3)", "arm_0.csv (train), RMSE 1.15 to 0.286 deg/s", "arm_11",
        "- arm", "+ arm + x", "armid close-loop arm", "armid report results/arm", "lower arm",
        "The first 2 of 3 records",
    ):  # fmt: skip
        assert wanted in text, wanted
    # two records, two candidates, two stored figures
    assert page.tags.count("svg") == 6
    assert page.tags.count("input") == 1


def test_without_details_and_figures_the_page_says_so(tmp_path):
    page = page_of(write_loop(tmp_path / "loop", details=False, figures=False))
    assert "details.json is not in this folder" in page.text
    assert "svg" not in page.tags
    assert "0.3438 deg/s RMSE after" in page.text


def test_names_of_files_cannot_break_the_pages(tmp_path):
    for text in (html(page_of_folder(write_loop(tmp_path / "loop", EVIL), LOOP, EVIL)), of_study(EVIL, {"a": SVG})):
        page = Elements(text)
        assert page.tags.count("script") == 1
        assert "img" not in page.tags
        assert not [name for name, _ in page.attributes if name.startswith("on")]
        assert EVIL in "".join(page.texts)


def test_nothing_is_fetched_and_only_the_page_s_own_script_runs(tmp_path):
    text = html(page_of_folder(write_loop(tmp_path / "loop"), LOOP, "x"))
    page = Elements(text)
    addresses = [value for name, value in page.attributes if name in ("href", "src", "srcset", "action", "data")]
    assert all(a.startswith(("#", "data:")) for a in addresses)
    assert "http" not in text.replace("http-equiv", "")
    policy = re.search(r'Policy" content="([^"]+)"', text).group(1)
    assert "default-src 'none'" in policy
    assert "script-src 'sha256-" in policy


def test_ids_are_unique(tmp_path):
    page = page_of(write_loop(tmp_path / "loop"))
    ids = [value for name, value in page.attributes if name == "id"]
    assert len(ids) == len(set(ids)) > 5


def test_the_same_files_give_the_same_bytes(tmp_path):
    folder = write_loop(tmp_path / "loop")
    assert html(page_of_folder(folder, LOOP, "x")) == html(page_of_folder(folder, LOOP, "x"))


def test_many_long_records_make_no_large_page():
    details = loop_details(n_records=24, n_points=1000)
    assert len(html(loop_page(loop_report(), details, {}, "x"))) < 3e6


def test_a_study_gives_its_answer_state_tables_and_file():
    page = Elements(of_study())
    for wanted in ("Is made_up right?", "Yes, made_up.", "Complete: 4 of 4 runs.", "Words of made_up.",
                   "name = 'made_up'", "armid study x"):  # fmt: skip
        assert wanted in page.text
    numbers = [value for name, value in page.attributes if name == "data-number"]
    assert numbers == ["0.02", "90.0", "Infinity", "Infinity", "3e-09", "1200.0"]


def test_what_comes_and_goes_is_marked():
    lines = changed("a\nb\nc", "a\nB\nc\nd")
    assert [(x.mark, x.text) for x in lines] == [("", "a"), ("-", "b"), ("+", "B"), ("", "c"), ("+", "d")]


@pytest.mark.parametrize(("names", "said"), [
    ((), "holds no result: study.sqlite of `armid study`, report.json of `armid close-loop` or result.json of"),
    (("report.json", "result.json"), "holds report.json and result.json, which two commands wrote"),
])  # fmt: skip
def test_folders_without_one_result_are_refused(tmp_path, names, said):
    for name in names:
        (tmp_path / name).write_text("{}")
    with pytest.raises(ArmidError, match=said):
        result_in(tmp_path)


@pytest.mark.parametrize("text", ["", "[1]", "nonsense", "[" * 100_000, "{}", '{"error": 3}', '{"steps": {}}', "\x00"])
def test_a_damaged_result_is_one_sentence(tmp_path, text):
    (tmp_path / "report.json").write_text(text)
    with pytest.raises(ArmidError, match="armid close-loop") as caught:
        page_of_folder(tmp_path, LOOP, "x")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", sorted(set(loop_details()) - {"conclusion", "n_records", "missing"}))
def test_damaged_details_are_one_sentence(tmp_path, key):
    folder = write_loop(tmp_path / "loop", figures=False)
    (folder / "details.json").write_text(json.dumps(loop_details(n_records=1) | {key: 3}))
    with pytest.raises(ArmidError, match=r"or details\.json beside it, is not what `armid close-loop` writes"):
        page_of_folder(folder, LOOP, "x")
