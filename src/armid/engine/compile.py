"""Compiled simulators: one generated module for each model, kept on disk so that a second start compiles nothing."""

import hashlib
import importlib.util
import linecache
import os
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import llvmlite
import numba
import numpy as np
from numba.core.errors import NumbaError, UnsupportedBytecodeError

from armid.engine import generate, simd, simd_math
from armid.engine.generate import KernelParts, kernel_parts
from armid.errors import ArmidError
from armid.model import Model

UNCOMPILABLE = (NumbaError, UnsupportedBytecodeError)
# One register of AVX-512, two of AVX2. Measured on the arm: 16 lanes are slower, because their values no longer fit.
LANE_WIDTH = 8
Kernel = Callable[..., Any]
# What a generated module is made by and compiled from.
MADE_FROM = [generate.TEMPLATE, *(Path(str(module.__file__)) for module in (generate, simd, simd_math))]
VERSIONS = (numba.__version__, llvmlite.__version__, np.__version__, sys.version)
KERNELS: WeakKeyDictionary[Model, tuple[Kernel, int]] = WeakKeyDictionary()
# Threads that ask for the same model at once share one kernel, which numba then compiles once.
LOCK = RLock()


def compile_model(model: Model) -> tuple[Kernel, int]:
    """Return `simulate` of a model, compiled at its first call, and its lane width; a model is compiled once.

    Raises ArmidError when the source of an equation cannot be taken over, naming the equation.
    """
    with LOCK:
        if model not in KERNELS:
            kernel = load_module(kernel_parts(model, LANE_WIDTH)).simulate
            KERNELS[model] = (without_registries(kernel), LANE_WIDTH)
        return KERNELS[model]


def cache_folder() -> Path:
    """Return the folder of generated modules (ARMID_CACHE, else the user's cache folder)."""
    given = os.environ.get("ARMID_CACHE")
    if given:
        return Path(given)
    base = os.environ.get("XDG_CACHE_HOME") or (os.environ.get("LOCALAPPDATA") if os.name == "nt" else None)
    return (Path(base) if base else Path.home() / ".cache") / "armid"


def module_name(parts: KernelParts) -> str:
    """Return a name that changes with the model's text and with everything it is made by and compiled from."""
    digest = hashlib.sha256(repr(parts).encode())
    for file in MADE_FROM:
        digest.update(file.read_bytes())
    for version in VERSIONS:
        digest.update(version.encode())
    return f"armid_model_{digest.hexdigest()[:20]}"


def load_module(parts: KernelParts) -> ModuleType:
    """Return the generated module, from the cache folder where it is there; its text is made only where it is not.

    Raises ArmidError when the cache folder cannot be written.
    """
    name, folder = module_name(parts), cache_folder()
    if name in sys.modules:
        return sys.modules[name]
    path = folder / f"{name}.py"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not is_whole(path):
            text = parts.text()
            write_at_once(path, text)
            write_at_once(path.with_suffix(".sha256"), hashlib.sha256(text.encode()).hexdigest())
    except OSError as error:
        raise ArmidError(f"the cache folder {folder} cannot be written ({error.strerror}): set ARMID_CACHE to a "
                         "folder that can") from error  # fmt: skip
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def is_whole(path: Path) -> bool:
    """Tell whether a module is there and is what was written: its digest stands beside it."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest() == path.with_suffix(".sha256").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False


def write_at_once(path: Path, text: str) -> None:
    """Write a file so that another process sees all of it or nothing."""
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as part:
        part.write(text.encode())
    os.replace(part.name, path)


def without_registries(kernel: Any) -> Any:
    """Return the kernel, made to load its machine code from disk with numba's runtime alone.

    Numba loads every typing and lowering rule it has before it loads machine code that needs none of them: half of the
    time that a second start takes. What is left out here is loaded by numba itself as soon as something is compiled.
    Rests on private names of numba; where a version does not have them, the kernel stays as it is.
    """
    cache: Any = getattr(kernel, "_cache", None)
    if not (hasattr(cache, "_load_overload") and hasattr(cache, "_guard_against_spurious_io_errors")):
        return kernel
    try:
        from numba.core.runtime import rtsys
    except ImportError:
        return kernel

    def load_overload(signature: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with cache._guard_against_spurious_io_errors():
            return cache._load_overload(signature, target_context)

    cache.load_overload = load_overload
    return kernel


def compile_error(error: Exception) -> ArmidError:
    """Return the error to raise for an equation that cannot be compiled, naming the equation where numba names it."""
    text, equation = str(error), re.compile(r"\bdef f__(\w+)\(")
    found = equation.search(text) or equation.search(definition_above(error))
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
