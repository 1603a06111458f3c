"""Pages in a real browser: nothing on the console, tables sort, figures are there, 400 pixels are enough."""

import re

import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from stored import EVIL, study_document, write_loop

from armid.cli.report import LOOP, document_of
from armid.report.html import html

pytestmark = [pytest.mark.browser, pytest.mark.slow]


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """A closed loop and a study, and both with names that would break a careless page."""
    folder, made = tmp_path_factory.mktemp("pages"), {}
    for kind, name in (("plain", "arm"), ("evil", EVIL)):
        made[f"{kind} loop"] = html(document_of(write_loop(folder / kind, name), LOOP, name))
        made[f"{kind} study"] = html(study_document(name))
    for name, text in made.items():
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
    return {name: folder / f"{name}.html" for name in made}


def seen(page, script):
    return page.execute_script(f"return {script}")


def column(page, table, number):
    return [cell.text for cell in table.find_elements(By.CSS_SELECTOR, f"tbody td:nth-child({number + 1})")]


@pytest.mark.parametrize(("width", "dark"), [(1200, False), (1200, True), (400, False), (400, True)])
def test_opens_quietly_and_does_not_scroll_sideways(pages, opened, width, dark):
    for page in (opened(path, width, dark) for path in pages.values()):
        assert page.get_log("browser") == []
        assert seen(page, "document.documentElement.scrollWidth") <= width
        assert "broken" not in page.title.split("<")[0]
        ink, paper = (
            [int(n) for n in re.findall(r"\d+", seen(page, f"getComputedStyle(document.body).{key}"))[:3]]
            for key in ("color", "backgroundColor")
        )  # fmt: skip
        assert (sum(paper) < sum(ink)) == dark
        assert contrast(ink, paper) > 7.0


def contrast(first, second):
    """Return the ratio of two colours' luminances as the web's guidelines define it (WCAG 2)."""

    def luminance(colour):
        linear = [c / 255 / 12.92 if c / 255 <= 0.04045 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in colour]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    low, high = sorted((luminance(first), luminance(second)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [1200, 400])
def test_figures_are_there_each_inside_its_card_and_follow_the_scheme(pages, opened, width, dark):
    page = opened(pages["plain loop"], width, dark)
    figures = page.find_elements(By.CSS_SELECTOR, ".card svg")
    assert len(figures) == 4
    for figure in figures:
        card = figure.find_element(By.XPATH, "..").rect
        assert figure.size["width"] > 250
        assert figure.size["height"] > 90
        assert card["x"] >= 0 <= figure.rect["x"] - card["x"]
        assert card["x"] + card["width"] <= width
        assert figure.rect["x"] + figure.rect["width"] <= card["x"] + card["width"]
    style = "getComputedStyle(document.querySelector('.card%s')).%s"
    assert seen(page, style % ("", "backgroundColor")) == ("rgb(20, 20, 20)" if dark else "rgb(255, 255, 255)")
    assert seen(page, style % (" svg", "filter")).startswith("invert" if dark else "none")


def test_a_click_sorts_numbers_by_value_and_what_is_empty_comes_last(pages, opened):
    page = opened(pages["plain study"])
    table = page.find_element(By.TAG_NAME, "table")
    who, error, cost = table.find_elements(By.CSS_SELECTOR, "th button")
    head = error.find_element(By.XPATH, "..")
    assert head.get_attribute("aria-sort") == "none"
    error.click()
    assert head.get_attribute("aria-sort") == "ascending"
    assert column(page, table, 1) == ["3e-07", "2", "inf", ""]
    error.click()
    assert head.get_attribute("aria-sort") == "descending"
    assert column(page, table, 1) == ["inf", "2", "3e-07", ""]
    cost.click()
    assert column(page, table, 2) == ["90 (1 %)", "1200 (7 %)", "inf (0 %)", ""]
    assert head.get_attribute("aria-sort") == "none"
    who.click()
    assert [text[-1] for text in column(page, table, 0)] == ["a", "b", "c", "d"]


def test_the_keyboard_sorts_and_slides(pages, opened):
    page = opened(pages["plain loop"])
    button = page.find_element(By.CSS_SELECTOR, "th button")
    button.send_keys(Keys.ENTER)
    assert button.find_element(By.XPATH, "..").get_attribute("aria-sort") == "ascending"
    slider = page.find_element(By.CSS_SELECTOR, "input[type=range]")
    opacity = "[...document.querySelectorAll('.layer-%s')].map((g) => getComputedStyle(g).opacity)"
    assert seen(page, opacity % "before") == seen(page, opacity % "after") == ["1", "1"]
    slider.send_keys(Keys.END)
    assert (seen(page, opacity % "before"), seen(page, opacity % "after")) == (["0", "0"], ["1", "1"])
    assert slider.get_attribute("aria-valuetext") == "after"
    slider.send_keys(Keys.HOME)
    assert (seen(page, opacity % "before"), seen(page, opacity % "after")) == (["1", "1"], ["0", "0"])


def test_a_script_that_came_in_would_not_run(pages, opened, tmp_path):
    text = pages["plain loop"].read_text().replace("<h1>", "<script>document.title='broken'</script><h1>")
    (tmp_path / "broken.html").write_text(text)
    page = opened(tmp_path / "broken.html")
    assert page.title == "arm: Closed loop"
    assert "Content Security Policy" in page.get_log("browser")[0]["message"]
