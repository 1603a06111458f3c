"""How a wrong value is shown in a sentence."""

import reprlib

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
