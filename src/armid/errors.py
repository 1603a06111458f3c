"""The exceptions whose text is meant for the user, by cause, and how a wrong value is shown in their sentence."""

import reprlib
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches

# Letters of a sentence at most, and those of its end, where it says what is expected.
LONGEST_SENTENCE, END = 300, 120
# Exit code of what was interrupted.
INTERRUPTED = 130


class ArmidError(ValueError):
    """Say in one sentence what was found, where, and what was expected; commands print it and exit with code 2.

    A sentence longer than 300 letters keeps its beginning and its end.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(on_a_line(sentence))


class MachineError(ArmidError):
    """Say that the machine is at fault and not what it was given: disk, memory, a cache that cannot be kept."""


class DataError(ArmidError):
    """Say what is wrong with records: campaign.toml, a CSV file, a table, an imported set."""


class ModelError(ArmidError):
    """Say what is wrong with a model: a plant, an effect, a parameter, bounds or values of parameters."""


class StudyError(ArmidError):
    """Say what is wrong with a study: its file, its identifiers, the store of its runs."""


@contextmanager
def caused_by(kind: type[ArmidError]) -> Iterator[None]:
    """Raise an ArmidError without a narrower cause as one of a kind; also a decorator."""
    try:
        yield
    except ArmidError as error:
        if type(error) is not ArmidError:
            raise
        raise kind(str(error)).with_traceback(error.__traceback__) from error.__cause__


@contextmanager
def located(where: object) -> Iterator[None]:
    """Put the place before the sentence of an ArmidError; one that says that the machine is at fault has none."""
    try:
        yield
    except MachineError:
        raise
    except ArmidError as error:
        raise ArmidError(f"{where}: {error}") from error


def printable(text: str) -> str:
    r"""Return text on one line that neither steers a terminal nor turns its direction: each such character is escaped.

    >>> printable("a\nb")
    'a\\nb'
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def on_a_line(sentence: str) -> str:
    """Return a sentence of at most 300 letters on one line, see `printable`."""
    line = printable(sentence)
    return line if len(line) <= LONGEST_SENTENCE else f"{line[: LONGEST_SENTENCE - END - 5]} ... {line[-END:]}"


# Longest list of valid words that a message shows in full [letters].
LONGEST_LIST = 120
# Valid words that a hint names where several begin with the word that was written.
MOST_BEGUN = 4


def nearest(word: str, known: Iterable[str]) -> str:
    """Return a hint with the nearest valid word, or the valid words when none is near, of many the nearest three.

    >>> nearest("coulom", ["coulomb", "viscous"])
    "did you mean 'coulomb'?"
    >>> nearest("noise", ["noise_deg_s", "noise_deg", "name"])
    'did you mean one of noise_deg_s, noise_deg?'
    >>> nearest("friction", ["coulomb", "viscous"])
    'known: coulomb, viscous'
    """
    words = [str(k) for k in known]
    begun = [w for w in words if w.startswith((f"{word}_", f"{word}/"))]
    if len(begun) > 1:
        return f"did you mean one of {', '.join(begun[:MOST_BEGUN])}?"
    close = get_close_matches(word, words, n=1, cutoff=0.6)
    if close:
        return f"did you mean '{close[0]}'?"
    if len(", ".join(words)) > LONGEST_LIST:
        # a parameter of the plant has no dot, one of an effect has one
        alike = [w for w in words if ("." in w) == ("." in word)] or words
        shown = get_close_matches(word, alike, n=3, cutoff=0.0)
        return f"known: {', '.join(shown)} and {len(words) - len(shown)} more"
    return f"known: {', '.join(words)}" if words else "there is none"


def refuse_unless_known(word: str, known: Collection[str], found: str) -> None:
    """Raise ArmidError for a word that is not among the known ones; found: the sentence before the nearest of them."""
    if word not in known:
        raise ArmidError(f"{found}: {nearest(word, known)}")


def nearest_registered(word: str, known: Iterable[str]) -> str:
    """Return `nearest` among what plug-ins add to; where none is near, how one of the user's own is named."""
    hint = nearest(word, known)
    own = "one of your own is a plug-in: the option plugin takes FILE.py:NAME, in Python plugins a list of them"
    return hint if hint.endswith("?") else f"{hint}; {own}"


BRIEF = reprlib.Repr()
BRIEF.maxstring = BRIEF.maxother = BRIEF.maxlong = 60
BRIEF.maxlist = 12


def quoted(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list) and len(value) > BRIEF.maxlist:
        return f"a list of {len(value):,}"
    try:
        return BRIEF.repr(value)
    except ValueError:
        return "a number of too many digits"
