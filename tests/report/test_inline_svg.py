"""SVG files become harmless parts of a page."""

import re

import pytest
from stored import SVG

from armid.errors import ArmidError
from armid.report.svg import inline


def around(inner: str) -> str:
    return f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">{inner}</svg>'


def test_ids_are_prefixed_where_they_are_referred_to_and_dropped_elsewhere():
    made = str(inline(SVG, "f1-", "A figure"))
    assert 'id="f1-c1"' in made
    assert 'clip-path="url(#f1-c1)"' in made
    assert 'href="#f1-m1"' in made
    assert "unused" not in made
    assert 'aria-label="A figure"' in made
    assert "today" not in made


def test_coordinates_are_rounded_and_sizes_are_pixels():
    made = str(inline(SVG, "", ""))
    assert 'd="M 0.12 10 L 450 200"' in made
    assert 'x="10.99"' in made
    assert 'width="600"' in made
    assert 'viewBox="0 0 450 225"' in made


def test_layers_get_a_class_that_a_slider_finds():
    made = str(inline(around('<g id="before"><path d="M 0 0"/></g><g id="other"/>'), "r1-", ""))
    assert 'class="layer-before"' in made
    assert "other" not in made


EVIL = (
    "<script>alert(1)</script>", '<g onclick="alert(1)"/>', '<a xlink:href="javascript:alert(1)"><path d="M 0 0"/></a>',
    '<image xlink:href="http://elsewhere/x.png"/>', '<image xlink:href="data:image/svg+xml;base64,PHN2Zz4="/>',
    '<use xlink:href="http://elsewhere/x.svg#a"/>', '<path style="fill: url(http://elsewhere/x)"/>',
    '<path style="fill: URL( http://elsewhere/x )"/>', '<path clip-path="url(http://elsewhere/x#a)"/>',
    "<foreignObject><iframe src='http://elsewhere'/></foreignObject>", "<style>@import url(http://elsewhere/x)</style>",
    '<animate attributeName="href" to="javascript:alert(1)"/>', '<set attributeName="onclick" to="alert(1)"/>',
    "<text>&lt;script>alert(1)&lt;/script></text>",
    '<path id="a&quot; onload=&quot;alert(1)"/><use href="#a&quot; onload=&quot;alert(1)"/>',
)  # fmt: skip


def test_nothing_that_runs_or_is_fetched_comes_through():
    for evil in EVIL:
        made = str(inline(around(evil), "", ""))
        assert not re.search(r"elsewhere|javascript|svg\+xml", made), evil
        assert not re.search(r"<(script|a|foreignObject|iframe|style|animate|set)\b", made), evil
        assert not re.search(r"\son\w+\s*=", re.sub(r'"[^"]*"', '""', made)), evil


def test_a_picture_inside_stays():
    made = str(inline(around('<image xlink:href="data:image/png;base64,AAAA" width="3" height="3"/>'), "", ""))
    assert 'href="data:image/png;base64,AAAA"' in made


def test_what_is_no_svg_and_a_bomb_of_entities_are_refused():
    levels = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))
    bomb = f'<!DOCTYPE svg [<!ENTITY l0 "lol">{levels}]><svg><text>&l11;</text></svg>'
    for text, said in (("", "is no SVG"), ("<svg", "is no SVG"), ("<html/>", "holds <html>"), (bomb, "is no SVG")):
        with pytest.raises(ArmidError, match=f"a.svg {said}"):
            inline(text, "", "", "a.svg")
