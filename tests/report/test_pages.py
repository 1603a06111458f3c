"""Documents of made-up results: what each renderer says, what it escapes, how large a page is."""

import json
import re
from html.parser import HTMLParser
from io import StringIO
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from pandas import DataFrame, read_csv
from stored import EVIL, SVG, loop_details, loop_report, study_document, write_loop

from armid.cli.main import main
from armid.cli.report import LOOP, document_of, kind_in
from armid.errors import ArmidError
from armid.loop.document import chances_sentence, constant_sentences, loop_document
from armid.report.document import Document, Line, Listing, Section, Sentences, rmse_text, table, value_text, varying
from armid.report.files import csv, latex, markdown
from armid.report.html import html, inline
from armid.report.style import legend_below, panels, row_names, svg_text, thinned
from armid.report.terminal import show
from armid.study.analyses.errors import error_map_figure, valley_figure


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


def printed(document, capsys):
    show(document)
    return capsys.readouterr().out


def test_a_closed_loop_says_what_the_issue_asks_for(tmp_path):
    page = Elements(html(document_of(write_loop(tmp_path / "loop"), LOOP, "results/arm")))
    for wanted in (
        "What does the declared model of shell_transfer_arm lack", "Effects cannot be told apart: It lacks arm.",
        "Error on the records held out: 1.719 before, 0.3438 deg/s RMSE after; the noise is 0.229 deg/s.",
        "arm_x 0.50; other 0.45; late@arm.csv 0.02; nothing missing 0.01; something that the library does not hold "
        "0.04 (among 5 of 38 effects).",
        "To be trusted: p0 = 3 MPa (2.7 to 3.3)", "arm_0.csv (train), RMSE 1.146 to 0.2865 deg/s", "arm, 80%",
        "2.85 to 3.15", "arm_x (candidate)", "How probable each is",
        "- arm", "+ arm + x", "armid close-loop arm", "armid report results/arm", "lower arm",
        "The first 2 of 3 records", "A record of this manoeuvre would separate arm_x and other with a chance of 80%",
    ):  # fmt: skip
        assert wanted in page.text, wanted
    # two records, two stored figures
    assert page.tags.count("svg") == 4
    assert page.tags.count("input") == 1
    ids = [value for name, value in page.attributes if name == "id"]
    assert len(ids) == len(set(ids)) > 5


def test_a_constant_far_off_a_drift_and_an_output_that_is_not_there_are_called_so():
    fit = SimpleNamespace(deviations={"length": -4.02, "load_mass": 1.9}, constants={"length": -0.0402})
    assert constant_sentences(fit) == ["length is 4.0 standard deviations below its declared value (-4.0%)."]
    report = loop_report()
    report["probabilities"]["drifts"] = {"mass": 0.38, "constant:force_constant": 0.4}
    assert "; drift of mass 0.38; drift of force_constant 0.40; nothing" in chances_sentence(report)
    entry = {"rmse": None, "outputs": {"deflection": {"rmse": 0.1}}}
    assert [rmse_text({"rmse": None}, "rad"), rmse_text(entry, "rad")] == ["not finite", "not recorded"]
    assert rmse_text({"rmse": None, "outputs": {"hub": {"rmse": None}}}, "rad") == "not finite"


def test_terminal_markdown_and_page_give_the_same_answer_first(tmp_path, capsys):
    document = document_of(write_loop(tmp_path / "loop"), LOOP, "x")
    first = document.answer[0]
    assert first == f"{chances_sentence(loop_report())}."
    named, known = loop_report()["probabilities"]["among"]
    assert f"{known - named} effects are not named: the plant has no port" in document.sections[0].parts[0].caption
    assert printed(document, capsys).startswith(first)
    text, page = markdown(document), html(document)
    assert text.index(first) < text.index("\n## ")
    assert page.index(first) < page.index("<section")
    for sentence in document.answer[1:]:
        assert sentence in text
        assert sentence in page
    # every figure of the Markdown is a file that the command writes
    assert set(re.findall(r"\]\((\w+)\.png\)", text)) == {"residuals", "probabilities", "diagnosis"}


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


NAMES = (
    "[x](javascript:alert(1))", "swarm [/x]", "swarm [bold]", "![i](http://x/y.png)", "<b>b</b>", "<http://x.y>", "a|b",
    "*stars*", "**b**", "_under_", "~~out~~", "a\\*b*", "$\\frac$", "$x$", "$5 and $6", "&amp;", "\\[x\\](y)", "[x][y]",
    "[x]: javascript:1", "%s {0}", "# head", "* * *", "swarm\\", "nelder_mead+pso_2",
    "=1+1", "+1 of it", "-x", "@sum",
)  # fmt: skip


MARKUP = {"html_inline", "html_block", "link_open", "image", "em_open", "strong_open", "s_open", "code_inline"}


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_shown_as_it_is_by_every_renderer(name, capsys, monkeypatch):
    """Markdown, page, CSV and LaTeX are read back by parsers that are not ours; figures by the letters in them."""
    document = study_document(name)
    tokens = MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(markdown(document))
    inner = [child for token in tokens for child in token.children or ()]
    # the answer alone is strong
    assert [t.type for t in (*tokens, *inner) if t.type in MARKUP] == ["strong_open"]
    cells = [token.content for token in tokens if token.type == "td_open"]
    shown = ["".join(c.content for c in token.children) for token in tokens if token.type == "inline"]
    assert (len(cells), {f"{name} {w}" for w in "bcad"} <= set(shown)) == (12, True)
    assert f"Errors of {name}" in shown
    assert name in "".join(Elements(html(document)).texts)
    monkeypatch.setenv("COLUMNS", "200")
    assert f"{name} b" in printed(document, capsys)
    own = document.tables[0]
    mark = "'" if name[0] in "=+-@" else ""
    assert list(read_csv(StringIO(csv(own)))["who"]) == [f"{mark}{name} {w}" for w in "bcad"]
    text = latex(own)
    assert re.sub(r"\\\\|\\[{}&%$#_]", "", text).count("&") == 5
    figure, (axis,) = panels(1, 1, 3.0, 3.0)
    axis.plot([1.0, 2.0], [1.0, 20.0], label=f"a {name}")
    axis.set(title=name, xlabel=name, xscale="log")
    row_names(axis, 0, [name, name])
    legend_below(figure, 1)
    drawn = "".join(Elements(svg_text(figure)).texts)
    assert (drawn.count(name), "mathdefault" in drawn) == (5, False)


@pytest.mark.parametrize("name", ["$\\frac$", "$x$", "*a*"])
def test_names_in_figures_that_another_library_lays_out(name):
    errors = DataFrame([[0.1, 0.2], [0.3, np.inf]], index=[name, "b"], columns=[name, "d"])
    ends = DataFrame({"variant": [name, "b"] * 4, "setting": "s", "p": np.arange(8.0), "q": np.arange(8.0) ** 2})
    for figure in (error_map_figure({name: errors}), valley_figure(ends, {name: 0, "b": 1}, 1.0)):
        assert name in "".join(Elements(svg_text(figure)).texts)


def test_a_table_a_listing_and_sentences_stay_what_they_are_and_no_cell_of_a_file_is_a_formula():
    columns, rows = ["who|[a](b)"], [["a\n|b"], ["[x]: javascript:1"], ["\\](c)"]]
    listing = Listing("L", (Line("a"), Line("```", "+")))
    text = markdown(Document("t", "Study", "", ("Yes.",), (Section("S", (table("T", columns, rows), listing)),)))
    assert [line.count("|") - line.count("\\|") for line in text.splitlines() if line.startswith("|")] == [2] * 5
    assert "| [x\\]: javascript:1 |" in text
    assert "| \\\\\\](c) |" in text
    assert text.rstrip().splitlines()[-4:] == ["````diff", "  a", "+ ```", "````"]
    assert "\\textbackslash" in latex(table("T", ["a"], [["\\x_&"]]))
    # Names that begin like one are text, in the header too; numbers stay numbers.
    rows = [("=cmd|' /C calc'!A0", "-0.5", -0.5), ("\t=1", "plain", 2), (None, "@x", float("nan"))]
    lines = csv(table("x", ["=1+1", "b", "c"], rows)).splitlines()
    assert lines == ["'=1+1,b,c", "'=cmd|' /C calc'!A0,-0.5,-0.5", "'\t=1,plain,2.0", ",'@x,"]
    document = Document("t", "Study", "", ("Yes.",), (Section("S", (Sentences(("a", "b"), "S"),)),), facts=("f",))
    assert markdown(document) == "# t\n\n**Yes.**\n\n- f\n\n## S\n\n- a\n- b\n"


def test_nothing_is_fetched_only_the_page_s_own_script_runs_and_many_records_make_no_large_page(tmp_path):
    folder = write_loop(tmp_path / "loop")
    text = html(document_of(folder, LOOP, "x"))
    assert text == html(document_of(folder, LOOP, "x"))
    addresses = [v for name, v in Elements(text).attributes if name in ("href", "src", "srcset", "action", "data")]
    assert all(a.startswith(("#", "data:")) for a in addresses)
    assert "http" not in text.replace("http-equiv", "")
    policy = re.search(r'Policy" content="([^"]+)"', text).group(1)
    assert "default-src 'none'" in policy
    assert "script-src 'sha256-" in policy
    details = loop_details(n_records=6, n_points=1000)
    assert len(html(loop_document(loop_report(), details, {}, "x"))) < 0.9e6


def test_a_study_gives_its_answer_state_tables_and_file_and_columns_and_intervals_as_they_are(capsys):
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
    rows = [("mass", "kg", "2.5", "a", ""), ("level", "N", "", "a", ""), ("slope", "N s/m", "", "a", "")]
    columns, cells, note = varying(table("Parameters", ["name", "unit", "before", "said", "empty"], rows))
    assert [c.key for c in columns] == ["name", "unit", "before"]
    assert [[c.text for c in row] for row in cells] == [list(row[:3]) for row in rows]
    assert note == "In every line said is a."
    # an interval is shown with digits that tell its ends apart
    for ends in (("0.0118", "0.011", "0.013"), ("0.01180006", "0.01179978", "0.01180033")):
        shown = dict(zip(("value", "low", "high"), map(float, ends), strict=True), unit="kg m2", interval_holds=True)
        assert value_text(shown) == "{} kg m2 ({} to {})".format(*ends)


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
    write_loop(tmp_path / "loop", figures=False)
    (tmp_path / "details.json").write_bytes((tmp_path / "loop" / "details.json").read_bytes())
    for text in ("", "[1]", "nonsense", "[" * 100_000, "{}", '{"error": 3}', '{"steps": {}}', "\x00"):
        (tmp_path / "report.json").write_text(text)
        with pytest.raises(ArmidError, match="armid close-loop") as caught:
            document_of(tmp_path, LOOP, "x")
        assert not re.search(r"\n|Error|Expecting|line 1|codec", str(caught.value))


def test_damaged_details_and_none_are_one_sentence(tmp_path):
    """`armid export reports` writes none."""
    folder = write_loop(tmp_path / "loop", figures=False)
    words = {"headline", "conclusion", "n_records", "n_files", "missing", "models"}
    for key in (*sorted(set(loop_details()) - words), None):
        (folder / "details.json").write_text(json.dumps(loop_details(n_records=1) | {key: 3}))
        if key is None:
            (folder / "details.json").unlink()
        with pytest.raises(ArmidError, match=r"or a file next to it, is not what `armid close-loop` writes"):
            document_of(folder, LOOP, "x")


def test_damaged_curves_are_one_sentence(tmp_path):
    """They are read when their figure is drawn."""
    folder = write_loop(tmp_path / "loop", figures=False)
    details = loop_details(n_records=1)
    details["records"][0]["curves"]["before"]["y"][0] = "much"
    (folder / "details.json").write_text(json.dumps(details))
    with pytest.raises(SystemExit, match="2"):
        main(["report", str(folder)])
    assert sorted(p.name for p in folder.iterdir()) == ["details.json", "report.json"]


def around(inner):
    return f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">{inner}</svg>'


def test_a_figure_in_the_page_keeps_what_is_shown():
    made = str(inline(SVG, "f1-", "A figure"))
    assert 'id="f1-c1"' in made
    assert 'clip-path="url(#f1-c1)"' in made
    assert 'href="#f1-m1"' in made
    assert 'aria-label="A figure"' in made
    assert "today" not in made
    # coordinates are rounded and sizes are pixels
    assert 'd="M 0.12 10 L 450 200"' in made
    assert 'x="10.99"' in made
    assert 'width="600"' in made
    assert 'viewBox="0 0 450 225"' in made
    # layers get a class that a slider finds
    made = str(inline(around('<g id="before"><path d="M 0 0"/></g><g id="other"/>'), "r1-", ""))
    assert 'class="layer-before"' in made
    picture = str(inline(around('<image xlink:href="data:image/png;base64,AAAA" width="3" height="3"/>'), "", ""))
    assert 'href="data:image/png;base64,AAAA"' in picture


HOSTILE = (
    "<script>alert(1)</script>", '<g onclick="alert(1)"/>', '<a xlink:href="javascript:alert(1)"><path d="M 0 0"/></a>',
    '<image xlink:href="http://elsewhere/x.png"/>', '<image xlink:href="data:image/svg+xml;base64,PHN2Zz4="/>',
    '<use xlink:href="http://elsewhere/x.svg#a"/>', '<path style="fill: url(http://elsewhere/x)"/>',
    '<path style="fill: URL( http://elsewhere/x )"/>', '<path clip-path="url(http://elsewhere/x#a)"/>',
    "<foreignObject><iframe src='http://elsewhere'/></foreignObject>", "<style>@import url(http://elsewhere/x)</style>",
    '<animate attributeName="href" to="javascript:alert(1)"/>', '<set attributeName="onclick" to="alert(1)"/>',
    "<text>&lt;script>alert(1)&lt;/script></text>",
    '<path id="a&quot; onload=&quot;alert(1)"/><use href="#a&quot; onload=&quot;alert(1)"/>',
)  # fmt: skip


def test_nothing_that_runs_or_is_fetched_comes_through_and_no_svg_and_bombs_are_refused():
    for evil in HOSTILE:
        made = str(inline(around(evil), "", ""))
        assert not re.search(r"elsewhere|javascript|svg\+xml", made), evil
        assert not re.search(r"<(script|a|foreignObject|iframe|style|animate|set)\b", made), evil
        assert not re.search(r"\son\w+\s*=", re.sub(r'"[^"]*"', '""', made)), evil
    levels = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))
    bomb = f'<!DOCTYPE svg [<!ENTITY l0 "lol">{levels}]><svg><text>&l11;</text></svg>'
    nested = f"<svg>{'<g>' * 20_000}{'</g>' * 20_000}</svg>"
    no_svg = [(text, "is not an SVG") for text in ("", "<svg", bomb, nested)]
    for text, said in (*no_svg, ("<html/>", "holds <html>")):
        with pytest.raises(ArmidError, match=f"a.svg {said}"):
            inline(text, "", "", "a.svg")


@given(st.integers(0, 4000), st.integers(4, 600), st.integers(0, 2**32 - 1))
def test_few_points_rising_with_both_ends_and_the_extremes(n, most, seed):
    values = np.random.default_rng(seed).standard_normal(n).round(1)
    kept = thinned(values, most)
    assert len(kept) <= max(most, 4)
    assert np.all(np.diff(kept) > 0)
    if n:
        assert (kept[0], kept[-1]) == (0, n - 1)
        assert values[kept].min() == values.min()
        assert values[kept].max() == values.max()
    if n <= most:
        assert len(kept) == n
