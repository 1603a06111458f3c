"""Documents of made-up results: what each renderer says, what it escapes, how large a page is."""

import json
import re
from html.parser import HTMLParser

import pytest
from stored import EVIL, SVG, loop_details, loop_report, study_document, write_loop

from armid.cli.report import LOOP, document_of, kind_in
from armid.errors import ArmidError
from armid.loop.document import loop_document
from armid.report.document import Document, Line, Listing, Section, Sentences, changed, table
from armid.report.files import latex
from armid.report.html import html
from armid.report.markdown import markdown
from armid.report.terminal import show


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
    return Elements(html(document_of(folder, LOOP, "results/arm")))


def printed(document, capsys):
    show(document)
    return capsys.readouterr().out


def test_a_closed_loop_says_what_the_issue_asks_for(tmp_path):
    page = page_of(write_loop(tmp_path / "loop"))
    for wanted in (
        "What does the declared model of shell_transfer_arm lack", "Effects cannot be told apart: It lacks arm.",
        "Error on the records held out: 1.719 before, 0.3438 deg/s RMSE after; the noise is 0.229 deg/s.",
        "To be trusted: p0 = 3 MPa (2.7 to 3.3)", "arm_0.csv (train), RMSE 1.146 to 0.2865 deg/s", "arm_11",
        "- arm", "+ arm + x", "armid close-loop arm", "armid report results/arm", "lower arm",
        "The first 2 of 3 records", "A record of this manoeuvre would separate arm_x and other with a chance of 80%",
    ):  # fmt: skip
        assert wanted in page.text, wanted
    # two records, two candidates, two stored figures
    assert page.tags.count("svg") == 6
    assert page.tags.count("input") == 1
    ids = [value for name, value in page.attributes if name == "id"]
    assert len(ids) == len(set(ids)) > 5


def test_terminal_markdown_and_page_give_the_same_answer_first(tmp_path, capsys):
    document = document_of(write_loop(tmp_path / "loop"), LOOP, "x")
    first = document.answer[0]
    assert printed(document, capsys).startswith(first)
    text, page = markdown(document), html(document)
    assert text.index(first) < text.index("\n## ")
    assert page.index(first) < page.index("<section")
    for sentence in document.answer[1:]:
        assert sentence in text
        assert sentence in page
    # every figure of the Markdown is a file that the command writes
    assert set(re.findall(r"\]\((\w+)\.png\)", text)) == {"residuals", "ranking", "diagnosis"}


def test_without_details_and_figures_the_page_says_so(tmp_path):
    page = page_of(write_loop(tmp_path / "loop", details=False, figures=False))
    assert "details.json is not in this folder" in page.text
    assert "svg" not in page.tags
    assert "0.3438 deg/s RMSE after" in page.text


def test_names_of_files_cannot_break_any_renderer(tmp_path, capsys):
    for document in (document_of(write_loop(tmp_path / "loop", EVIL), LOOP, EVIL), study_document(EVIL)):
        page = Elements(html(document, {"a": SVG}))
        assert page.tags.count("script") == 1
        assert "img" not in page.tags
        assert not [name for name, _ in page.attributes if name.startswith("on")]
        assert EVIL in "".join(page.texts)
        outside_of_code = re.sub(r"^(`{3,}).*?^\1$", "", markdown(document), flags=re.DOTALL | re.MULTILINE)
        assert not re.search(r"<|[^\\]\]\(javascript", outside_of_code)
        shown = printed(document, capsys)
        assert "[/x]" in shown
        assert "\x1b" not in shown


def test_a_table_and_a_listing_stay_what_they_are():
    columns, rows = ["who|[a](b)"], [["a\n|b"], ["[x]: javascript:1"], ["\\](c)"]]
    listing = Listing("L", (Line("a"), Line("```", "+")))
    text = markdown(Document("t", "Study", "", ("Yes.",), (Section("S", (table("T", columns, rows), listing)),)))
    assert [line.count("|") - line.count("\\|") for line in text.splitlines() if line.startswith("|")] == [2] * 5
    assert "| [x\\]: javascript:1 |" in text
    assert "| \\\\\\](c) |" in text
    assert text.rstrip().splitlines()[-4:] == ["````diff", "  a", "+ ```", "````"]
    assert "\\textbackslash" in latex(table("T", ["a"], [["\\x_&"]]))


def test_nothing_is_fetched_and_only_the_page_s_own_script_runs(tmp_path):
    folder = write_loop(tmp_path / "loop")
    text = html(document_of(folder, LOOP, "x"))
    assert text == html(document_of(folder, LOOP, "x"))
    addresses = [v for name, v in Elements(text).attributes if name in ("href", "src", "srcset", "action", "data")]
    assert all(a.startswith(("#", "data:")) for a in addresses)
    assert "http" not in text.replace("http-equiv", "")
    policy = re.search(r'Policy" content="([^"]+)"', text).group(1)
    assert "default-src 'none'" in policy
    assert "script-src 'sha256-" in policy


def test_many_long_records_make_no_large_page():
    details = loop_details(n_records=6, n_points=1000)
    assert len(html(loop_document(loop_report(), details, {}, "x"))) < 0.9e6


def test_a_study_gives_its_answer_state_tables_and_file(capsys):
    document = study_document()
    page = Elements(html(document))
    for wanted in ("Is made_up right?", "Yes, made_up.", "Complete: 4 of 4 runs.", "Words of made_up.",
                   "name = 'made_up'", "armid study x"):  # fmt: skip
        assert wanted in page.text
    numbers = [value for name, value in page.attributes if name == "data-number"]
    assert numbers == ["0.02", "90.0", "Infinity", "Infinity", "3e-09", "1200.0"]
    shown = printed(document, capsys)
    assert "identifier: made_up b" in shown
    assert "Words of made_up." in shown


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
        kind_in(tmp_path)


def test_a_damaged_result_is_one_sentence(tmp_path):
    for text in ("", "[1]", "nonsense", "[" * 100_000, "{}", '{"error": 3}', '{"steps": {}}', "\x00"):
        (tmp_path / "report.json").write_text(text)
        with pytest.raises(ArmidError, match="armid close-loop") as caught:
            document_of(tmp_path, LOOP, "x")
        assert "\n" not in str(caught.value)


def test_damaged_details_are_one_sentence(tmp_path):
    folder = write_loop(tmp_path / "loop", figures=False)
    for key in sorted(set(loop_details()) - {"conclusion", "n_records", "missing"}):
        (folder / "details.json").write_text(json.dumps(loop_details(n_records=1) | {key: 3}))
        with pytest.raises(ArmidError, match=r"or details\.json beside it, is not what `armid close-loop` writes"):
            document_of(folder, LOOP, "x")


def test_sentences_are_bullets_and_a_title_is_not_said_twice():
    document = Document("t", "Study", "", ("Yes.",), (Section("S", (Sentences(("a", "b"), "S"),)),), facts=("f",))
    assert markdown(document) == "# t\n\n**Yes.**\n\n- f\n\n## S\n\n- a\n- b\n"
