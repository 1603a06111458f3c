"""The one exception whose text is meant for the user, and how a wrong value is shown in its sentence."""

import reprlib
from collections.abc import Iterable
from difflib import get_close_matches


class ArmidError(ValueError):
    """Say in one sentence what was found, where, and what was expected; commands print it and exit with code 2.

    Line ends and control characters, which come from names in files and options, are shown as escapes.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__("".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in sentence))


def nearest(word: str, known: Iterable[str]) -> str:
    """Return a hint with the nearest valid word, or the list of valid words when none is near.

    >>> nearest("coulom", ["coulomb", "viscous"])
    "did you mean 'coulomb'?"
    >>> nearest("friction", ["coulomb", "viscous"])
    'known: coulomb, viscous'
    """
    words = [str(k) for k in known]
    close = get_close_matches(word, words, n=1, cutoff=0.6)
    if close:
        return f"did you mean '{close[0]}'?"
    return f"known: {', '.join(words)}" if words else "there is none"


BRIEF = reprlib.Repr()
BRIEF.maxstring = BRIEF.maxother = BRIEF.maxlong = 60
BRIEF.maxlist = 12


def shown(value: object) -> str:
    """Return a value as a short text on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    try:
        return BRIEF.repr(value)
    except ValueError:
        return "a number of too many digits"
