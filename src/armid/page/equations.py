"""Equations as lines, and what became of them."""

from dataclasses import dataclass
from difflib import SequenceMatcher


@dataclass(frozen=True)
class Line:
    """Hold one line; mark: "+" for one that came, "-" for one that went, "" for one that stayed."""

    text: str
    mark: str = ""


def lines(text: str) -> tuple[Line, ...]:
    """Return the lines of a text."""
    return tuple(Line(line) for line in text.splitlines())


def changed(before: str, after: str) -> tuple[Line, ...]:
    """Return the lines of two texts as one, marked where they differ."""
    old, new = before.splitlines(), after.splitlines()
    found: list[Line] = []
    for what, i, j, k, m in SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if what == "equal":
            found += [Line(t) for t in old[i:j]]
            continue
        found += [Line(t, "-") for t in old[i:j]] + [Line(t, "+") for t in new[k:m]]
    return tuple(found)
