"""Compiled simulators: one generated module for each model, kept on disk so that a second start compiles nothing.

This is the one place that knows where compiled code lies. It checks what it reads, and does without a disk if it must.
"""

import gc
import hashlib
import linecache
import os
import pickle
import re
import stat
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import llvmlite
import numba
import numpy as np
from numba.core.compiler import CompileResult
from numba.core.errors import NumbaError, UnsupportedBytecodeError
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from armid.engine import generate, simd, simd_bundles, simd_math
from armid.engine.generate import KernelParts, kernel_parts, kernel_text
from armid.errors import ArmidError
from armid.model import Model
from armid.progress import announced

VERSIONS = (numba.__version__, llvmlite.__version__, np.__version__, sys.version)
DIGEST = hashlib.sha256().digest_size
# A link is not followed, and a pipe without a writer is not waited for; what a system lacks is left out.
SAFELY = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))
OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH


def kept(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles a function as numba.njit does, and keeps the code until its file changes."""

    def compiled(function: Callable[..., Any]) -> Any:
        return keep(numba.njit(**options)(function), str(function.__code__.co_filename))

    return compiled


def keep(compiled: Any, of: str) -> Any:
    """Return a compiled function that keeps its machine code; of: the file that it is made from, or a name for that."""
    compiled._cache = KeptCode(compiled.py_func, of)
    return compiled


class KeptCode:
    """Keep the machine code of one function, as numba asks for it: one file a signature and processor.

    Each file begins with the digest of its name and content. A damaged file is removed and compiled again.
    """

    def __init__(self, function: Callable[..., Any], of: str) -> None:
        self.function, self.of = function, of

    @property
    def cache_path(self) -> str | None:
        folder = kept_in()
        return None if folder is None else str(folder)

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return what was compiled before, None where nothing was.

        Numba's own cache loads every typing and lowering rule first, which takes half of the time of a second start;
        machine code needs the runtime alone, and numba loads the rest as soon as something is compiled.
        """
        path = self._path(signature, target.codegen())
        content = None if path is None else read_whole(path)
        if content is None:
            simd.ask_lanes_first()  # it will be compiled now
            return None
        rtsys.initialize(target)
        return CompileResult._rebuild(target, *pickle.loads(content))

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled; code that numba may not keep, with addresses of this process in it, is left out."""
        path = self._path(signature, compiled.library.codegen)
        if path is not None and not compiled.library.has_dynamic_globals and not compiled.lifted:
            try:
                content = dumps(compiled._reduce())
            except RuntimeError as error:  # Ctrl-C came while numba was handed the code, and was lost there
                raise KeyboardInterrupt from error
            write_whole(path, content)

    def flush(self) -> None:
        """Forget nothing: another signature or text has another file."""

    enable = disable = flush

    def _path(self, signature: Any, codegen: Any) -> Path | None:
        folder = kept_in()
        if folder is None:
            return None
        name = f"{self.function.__module__}.{self.function.__qualname__}"
        key = repr((name, stamp_of(self.of), signature, codegen.magic_tuple(), VERSIONS))
        return folder / f"armid_code_{self.function.__name__}_{hashlib.sha256(key.encode()).hexdigest()[:24]}.bin"


@cache
def stamp_of(of: str) -> str:
    """Return the digest of a file; a name without a file stays as it is."""
    return hashlib.sha256(Path(of).read_bytes()).hexdigest() if os.path.isfile(of) else of


def read_whole(path: Path) -> bytes | None:
    """Return what this user wrote into a file, None where it is not there, foreign or damaged, which removes it."""
    try:
        with open(os.open(path, SAFELY), "rb") as file:
            if not is_private(os.fstat(file.fileno())):
                return None
            content = file.read()
    except OSError:
        return None
    if seal(path, content[DIGEST:]) == content[:DIGEST]:
        return content[DIGEST:]
    with suppress(OSError):
        path.unlink()
    return None


def is_private(entry: os.stat_result) -> bool:
    """Tell whether an open file is a plain one that nobody but this user can have written: its code is run."""
    is_own = not hasattr(os, "getuid") or (entry.st_uid == os.getuid() and not entry.st_mode & OTHERS_MAY_WRITE)
    return stat.S_ISREG(entry.st_mode) and is_own


def seal(path: Path, content: bytes) -> bytes:
    """Return the digest of a file's name and content: a whole file under the name of another is damage too."""
    return hashlib.sha256(path.name.encode() + b"/" + content).digest()


def write_whole(path: Path, content: bytes) -> None:
    """Write a file with its digest before it, so that another process sees all of it or nothing; warn if it cannot."""
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix="armid_", suffix=".part", delete=False) as part:
            part.write(seal(path, content) + content)
        os.replace(part.name, path)
    except OSError as error:
        tell(f"compiled code cannot be kept in {path.parent} ({error.strerror})")


def cache_folder() -> Path:
    """Return the folder of compiled code, whether it can be used or not.

    It is one of this user inside the folder that ARMID_CACHE names, which may hold other things; else the user's cache.
    """
    given = os.environ.get("ARMID_CACHE")
    if given:
        return Path(given) / (f"armid-{os.getuid()}" if hasattr(os, "getuid") else "armid")
    base = os.environ.get("XDG_CACHE_HOME") or (os.environ.get("LOCALAPPDATA") if os.name == "nt" else None)
    try:
        return (Path(base) if base else Path.home() / ".cache") / "armid"
    except RuntimeError:
        return Path(os.devnull) / "armid"


def kept_in() -> Path | None:
    """Return the folder of compiled code, None where none can be used, with one warning."""
    folder = cache_folder()
    why = unusable(folder)
    if why:
        tell(f"compiled code is not kept: {folder} cannot be used ({why}); ARMID_CACHE may name another folder")
        return None
    return folder


@cache
def tell(sentence: str) -> None:
    warnings.warn(sentence, stacklevel=2)


@cache
def unusable(folder: Path) -> str:
    """Return why a folder cannot keep compiled code, "" where it can.

    Its permissions stay as they are: `is_private` judges each file, and others cannot write a file that it accepts.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        # the second of a link is the folder that it leads to
        if hasattr(os, "getuid") and {folder.lstat().st_uid, folder.stat().st_uid} != {os.getuid()}:
            return "it is somebody else's"
        with tempfile.TemporaryFile(dir=folder) as probe:
            return "" if is_private(os.fstat(probe.fileno())) else "others may write into its files"
    except OSError as error:
        return error.strerror or str(error)


UNCOMPILABLE = (NumbaError, UnsupportedBytecodeError)
Kernel = Callable[..., Any]
# What a generated module is made by and compiled from.
MADE_FROM = [*generate.TEMPLATES, *(Path(str(module.__file__)) for module in (generate, simd, simd_bundles, simd_math))]
KERNELS: WeakKeyDictionary[Model, Kernel] = WeakKeyDictionary()
# Threads that ask for the same model at once share one kernel, which numba then compiles once.
LOCK = RLock()
# Kernels, by `id`, that are being compiled.
COMPILING: set[int] = set()
MOST_COMPILED = 3


def compile_model(model: Model) -> Kernel:
    """Return `simulate` of a model, compiled at its first call; a model is compiled once."""
    with LOCK:
        if model not in KERNELS:
            kernel = load_module(kernel_parts(model)).simulate
            KERNELS[model] = keep(kernel, kernel.py_func.__module__)
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
    name = " + ".join([model.plant.name, *(e.name for e in model.effects[:MOST_COMPILED])])
    more = f" and {len(model.effects) - MOST_COMPILED} effects more" if len(model.effects) > MOST_COMPILED else ""
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
    text = kernel_text(parts) if content is None else content.decode()
    if folder is not None and content is None:
        write_whole(Path(f"{file}.bin"), text.encode())
    module = ModuleType(name)
    module.__file__ = file
    # where errors look for the lines of a file that may not be there
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    sys.modules[name] = module
    exec(compile(text, file, "exec"), vars(module))
    return module


# What takes the result of an equation, in numba's words: a lane, or a tuple of several results.
TAKES_RESULTS = r"(with_lane\(|bundle\(\w*Tuple\()"
NO_NUMBER_IN_A_BRANCH = "it does not return a number in every case"
SEVERAL_NUMBERS = "it returns several numbers"
# What is expected in place of that.
EXPECTED = {NO_NUMBER_IN_A_BRANCH: "a number from each branch is", SEVERAL_NUMBERS: "one number is"}


def compile_error(error: Exception) -> ArmidError:
    # numba writes in bold where colorama is installed
    text, equation = re.sub(r"\x1b\[[\d;]*m", "", str(error)), re.compile(r"(?:\bdef |<function )f__(\w+)")
    match = equation.search(text) or equation.search(definition_above(error))
    name = f"the equation '{match[1].replace('__scalar', '').replace('__', '.')}'" if match else "an equation"
    why = cause(text)
    expected = EXPECTED.get(why, "numpy, math, numbers and plain functions of numbers are")
    return ArmidError(f"{name} cannot be compiled ({why}): {expected} expected")


def cause(text: str) -> str:
    """Return the one line of numba's message that says most."""
    call = re.search(r"^ *>>> (.+)$", text, re.MULTILINE)
    if call and re.search(rf"{TAKES_RESULTS}.*(Optional|none)", call[1]):
        return NO_NUMBER_IN_A_BRANCH
    if call and re.search(rf"{TAKES_RESULTS}.*(array|Tuple|list)\(", call[1]):
        return SEVERAL_NUMBERS
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
