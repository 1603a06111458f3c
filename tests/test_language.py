"""The floor of plain language: words that are not used, and sentences that are too long, in source and pages."""

import ast
import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted((ROOT / "src" / "armid").rglob("*.py"))
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *(ROOT / "src").rglob("*.md"),
        *(ROOT / "studies").rglob("*.md"),
        ROOT / "results" / "README.md",
    ]
)
WORDS = re.compile(
    r"\b(told|said|beside|of which|(?<!there )is none|(?<!there )is no (?!longer|later|wider|worse)|for want of|"
    r"whoever|comes to|stands for|in the place of|asked of|as of|at a loss|belied)\b"
)
MOST_WORDS = 30
EXCEPTIONS = (
    r"told (apart|from)",  # the field has no shorter word for two causes that records cannot separate
    r"told :",  # the argument `told` of close_loop and infer
    r"beside (ours|the paper's)",  # titles of Table I and II on committed pages
    r"beside: ",  # an argument of that name
)


def prose(text):
    """Return a text without code and quotes."""
    text = re.sub(r"```.*?```", " ", text, flags=re.S)
    text = re.sub(r"`[^`\n]*`|\"[^\"\n]*\"", "X", text)
    for exception in EXCEPTIONS:
        text = re.sub(exception, "X", text)
    return text


def texts_of(path):
    """Yield line and text of the strings, docstrings and comments of a module, or of a page."""
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        yield 1, source
        return
    inside = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.JoinedStr):
            inside |= {id(part) for part in node.values}
            yield node.lineno, "".join(p.value if isinstance(p, ast.Constant) else "X" for p in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
            yield node.lineno, node.value
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


def sentences(text):
    """Yield the sentences of a text: no headings, tables, lists aligned in columns, statements of SQL."""
    for part in re.split(r"\n\s*\n", text):
        lines = part.strip().splitlines()
        if re.match(r"\s*(SELECT|CREATE|INSERT)\b", part) or any(re.search(r"\w {2,}\w", line) for line in lines):
            continue
        kept = " ".join(line.strip() for line in lines if not line.lstrip().startswith(("|", "#", "!")))
        yield from re.split(r"(?<=[.!?:;])\s+| - (?=`)", kept)


def is_long(sentence):
    words = re.findall(r"[A-Za-z][a-z]+(?:[-'][a-z]+)*", re.sub(r"\([^()]*\)", "", sentence))
    return len(words) > MOST_WORDS


@pytest.mark.parametrize("paths", [SOURCES, PAGES], ids=["source", "pages"])
def test_sentences_are_short_and_of_the_words_that_are_used(paths):
    found = []
    for path, (line, text) in ((each, part) for each in paths for part in texts_of(each)):
        wrong = [m.group(0) for m in WORDS.finditer(prose(text))] + [*filter(is_long, sentences(prose(text)))]
        found += [f"{path.relative_to(ROOT)}:{line}: {words}" for words in wrong]
    assert not found, "\n".join(found)


def test_the_floor_holds_what_it_says():
    assert all(map(WORDS.search, ("a fault that is none", "it is no cause", "as of now")))
    assert not any(map(WORDS.search, ("there is no file", "it is None", "no longer")))
    assert is_long(" ".join(["word"] * 31))
    assert not is_long(" ".join(["word"] * 30) + " (and many more of them)")
