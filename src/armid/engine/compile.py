"""Compiled simulators: one generated module for each model, kept on disk so that a second start compiles nothing."""

import gc
import hashlib
import linecache
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any
from weakref import WeakKeyDictionary

from numba.core.errors import NumbaError, UnsupportedBytecodeError

from armid.engine import generate, simd, simd_math
from armid.engine.cache import VERSIONS, keep, kept_in, read_whole, write_whole
from armid.engine.generate import KernelParts, kernel_parts
from armid.errors import ArmidError
from armid.model import Model
from armid.progress import announced

UNCOMPILABLE = (NumbaError, UnsupportedBytecodeError)
# One register of AVX-512, two of AVX2. Measured on the arm: 16 lanes are slower, because their values no longer fit.
LANE_WIDTH = 8
Kernel = Callable[..., Any]
# What a generated module is made by and compiled from.
MADE_FROM = [*generate.TEMPLATES, *(Path(str(module.__file__)) for module in (generate, simd, simd_math))]
KERNELS: WeakKeyDictionary[Model, tuple[Kernel, int]] = WeakKeyDictionary()
# Threads that ask for the same model at once share one kernel, which numba then compiles once.
LOCK = RLock()
# Kernels, by `id`, that are being compiled.
COMPILING: set[int] = set()
MOST_NAMED = 3


def compile_model(model: Model) -> tuple[Kernel, int]:
    """Return `simulate` of a model, compiled at its first call, and its lane width; a model is compiled once."""
    with LOCK:
        if model not in KERNELS:
            kernel = load_module(kernel_parts(model, LANE_WIDTH)).simulate
            KERNELS[model] = (keep(kernel, kernel.py_func.__module__), LANE_WIDTH)
        return KERNELS[model]


@contextmanager
def compiling(model: Model, kernel: Kernel) -> Iterator[None]:
    """Stand around the first call of a kernel, which compiles it, and announce that.

    Python's garbage collector is kept still meanwhile: the compiler makes millions of objects that live to its end.
    Another thread that calls it meanwhile waits, and says nothing.
    """
    if getattr(kernel, "signatures", True) or id(kernel) in COMPILING:
        yield
        return
    COMPILING.add(id(kernel))
    name = " + ".join([model.plant.name, *(e.name for e in model.effects[:MOST_NAMED])])
    more = f" and {len(model.effects) - MOST_NAMED} effects more" if len(model.effects) > MOST_NAMED else ""
    kept = "; it is kept for the next time" if kept_in() else ""
    collecting = gc.isenabled()
    gc.disable()
    try:
        with announced(f"compiling {name}{more}{kept}"):
            yield
    finally:
        COMPILING.discard(id(kernel))
        if collecting:
            gc.enable()


def module_name(parts: KernelParts) -> str:
    """Return a name that changes with the model's text and with everything it is made by and compiled from."""
    digest = hashlib.sha256(repr(parts).encode())
    for file in MADE_FROM:
        digest.update(file.read_bytes())
    for version in VERSIONS:
        digest.update(version.encode())
    return f"armid_model_{digest.hexdigest()[:20]}"


def load_module(parts: KernelParts) -> ModuleType:
    """Return the generated module, from the cache folder where it is there; its text is made only where it is not."""
    name, folder = module_name(parts), kept_in()
    if name in sys.modules:
        return sys.modules[name]
    file = f"{name}.py" if folder is None else str(folder / f"{name}.py")
    content = None if folder is None else read_whole(Path(f"{file}.bin"))
    text = parts.text() if content is None else content.decode()
    if folder is not None and content is None:
        write_whole(Path(f"{file}.bin"), text.encode())
    module = ModuleType(name)
    module.__file__ = file
    # where errors look for the lines of a file that may not be there
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    sys.modules[name] = module
    exec(compile(text, file, "exec"), vars(module))
    return module


def compile_error(error: Exception) -> ArmidError:
    # numba writes in bold where colorama is installed
    text, equation = re.sub(r"\x1b\[[\d;]*m", "", str(error)), re.compile(r"(?:\bdef |<function )f__(\w+)")
    match = equation.search(text) or equation.search(definition_above(error))
    name = f"the equation '{match[1].replace('__scalar', '').replace('__', '.')}'" if match else "an equation"
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
    place = getattr(error, "loc", None) or re.search(r"Raised from (?P<filename>.+) \((?P<line>\d+)\)", str(error))
    if place is None:
        return ""
    filename, line = (place["filename"], place["line"]) if isinstance(place, re.Match) else (place.filename, place.line)
    lines = linecache.getlines(str(filename))[: int(line)]
    return next((text for text in reversed(lines) if text.startswith("def ")), "")
