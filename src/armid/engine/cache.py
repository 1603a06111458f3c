"""Compiled code on disk: the one place that says where it is, checks what it reads, and does without if it must."""

import hashlib
import os
import pickle
import sys
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

VERSIONS = (numba.__version__, llvmlite.__version__, np.__version__, sys.version)
# What stands in a folder of ours, also that of an earlier version: names begin so.
OURS = ("armid_", "__pycache__", "tmp")
DIGEST = hashlib.sha256().digest_size


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

    Before each file stands the digest of its name and the rest. What is damaged is removed and compiled again.
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
    """Return the digest of a file, a name that is none as it is."""
    return hashlib.sha256(Path(of).read_bytes()).hexdigest() if os.path.isfile(of) else of


def read_whole(path: Path) -> bytes | None:
    """Return what was written into a file, None where it is not there or was damaged, which removes it."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if seal(path, content[DIGEST:]) == content[:DIGEST]:
        return content[DIGEST:]
    with suppress(OSError):
        path.unlink()
    return None


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
    """Return the folder of compiled code (ARMID_CACHE, else the user's cache folder), whether it can be used or not."""
    given = os.environ.get("ARMID_CACHE")
    if given:
        return Path(given)
    base = os.environ.get("XDG_CACHE_HOME") or (os.environ.get("LOCALAPPDATA") if os.name == "nt" else None)
    try:
        return (Path(base) if base else Path.home() / ".cache") / "armid"
    except RuntimeError:
        return Path(os.devnull) / "armid"


def kept_in() -> Path | None:
    """Return the folder of compiled code, None where none can be used, which is told once."""
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

    Who writes there runs code in our name: one of our own that others may write is closed to them, and what they have
    put there goes; one of somebody else is not used.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if hasattr(os, "getuid"):
            found = folder.stat()
            if found.st_uid != os.getuid():
                return "it is somebody else's"
            if found.st_mode & 0o022:
                entries = list(folder.iterdir())
                if not all(entry.name.startswith(OURS) for entry in entries):
                    return "others may write there, and it holds more than compiled code"
                folder.chmod(0o700)
                for entry in entries:
                    if entry.is_file() and entry.lstat().st_uid != os.getuid():
                        entry.unlink()
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return error.strerror or str(error)
