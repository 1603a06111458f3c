"""What numba cannot compile, told in one sentence."""

import linecache
import re

from numba.core.errors import NumbaError, UnsupportedBytecodeError

from armid.model import ArmidError

UNCOMPILABLE = (NumbaError, UnsupportedBytecodeError)
EQUATION = re.compile(r"\bdef f__(\w+)\(")


def refusal(error: Exception) -> ArmidError:
    """Return the error to raise for an equation that cannot be compiled, naming the equation where numba tells it."""
    text = str(error)
    found = EQUATION.search(text) or EQUATION.search(definition_above(error))
    name = f"the equation '{found[1].replace('__scalar', '').replace('__', '.')}'" if found else "an equation"
    return ArmidError(f"{name} cannot be compiled ({cause(text)}): numpy, math, numbers and plain functions of numbers "
                      "are expected")  # fmt: skip


def cause(text: str) -> str:
    """Return the one line of numba's message that says most."""
    call = re.search(r"^ *>>> (.+)$", text, re.MULTILINE)
    if call and re.search(r"with_lane\(.*(Optional|none)", call[1]):
        return "it does not return a number in every case"
    if call:
        return f"numba has no {re.sub(r'lanes[0-9]+', 'float64', call[1])}"
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("Failed in")]
    return f"numba: {lines[0].split(' Raised from')[0].rstrip('.')}" if lines else "numba gives no reason"


def definition_above(error: Exception) -> str:
    """Return the head of the function in which numba met the error."""
    place = getattr(error, "loc", None) or re.search(r"Raised from (?P<filename>.+) \((?P<line>\d+)\)", str(error))
    if place is None:
        return ""
    filename, line = (place["filename"], place["line"]) if isinstance(place, re.Match) else (place.filename, place.line)
    lines = linecache.getlines(str(filename))[: int(line)]
    return next((text for text in reversed(lines) if text.startswith("def ")), "")
