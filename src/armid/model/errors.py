"""The one exception whose text is meant for the user."""

from collections.abc import Iterable
from difflib import get_close_matches


class ArmidError(ValueError):
    """Say in one sentence what was found, where, and what was expected; commands print it and exit with code 2."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return a hint with the nearest valid word, or the list of valid words when none is near."""
    words = [str(k) for k in known]
    close = get_close_matches(word, words, n=1, cutoff=0.6)
    if close:
        return f"did you mean '{close[0]}'?"
    return f"known: {', '.join(words)}" if words else "there is none"
