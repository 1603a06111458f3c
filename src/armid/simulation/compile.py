"""Compiled simulators: one generated module for each model, kept on disk so that a second start compiles nothing."""

import hashlib
import importlib.util
import os
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

from armid.model import ArmidError, Model
from armid.simulation import lane_math, lane_numpy
from armid.simulation.generate import generate_module
from armid.simulation.lanes import bits, functions, memory, operators, vector
from armid.simulation.loading import load_lightly

COMPILED_FROM = (bits, functions, memory, operators, vector, lane_math, lane_numpy)
# One register of AVX-512, two of AVX2. Measured on the arm: 16 lanes are slower, because their values no longer fit.
LANE_WIDTH = 8
Kernel = Callable[..., Any]


def cache_folder() -> Path:
    """Return the folder of generated modules (ARMID_CACHE, else the user's cache folder)."""
    given = os.environ.get("ARMID_CACHE")
    if given:
        return Path(given)
    base = os.environ.get("XDG_CACHE_HOME") or (os.environ.get("LOCALAPPDATA") if os.name == "nt" else None)
    return (Path(base) if base else Path.home() / ".cache") / "armid"


def module_name(text: str) -> str:
    """Return a name that changes with the text and with everything it is compiled from."""
    digest = hashlib.sha256(text.encode())
    for module in COMPILED_FROM:
        digest.update(Path(str(module.__file__)).read_bytes())
    for version in (numba.__version__, llvmlite.__version__, np.__version__, sys.version):
        digest.update(version.encode())
    return f"armid_model_{digest.hexdigest()[:20]}"


def write_once(path: Path, text: str) -> None:
    """Write a file so that another process sees all of it or nothing."""
    if path.exists() and path.read_text() == text:
        return
    with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".part", delete=False) as part:
        part.write(text)
    os.replace(part.name, path)


def load_module(text: str) -> ModuleType:
    """Return the generated module, from the cache folder where it can be written."""
    name = module_name(text)
    if name in sys.modules:
        return sys.modules[name]
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_once(folder / f"{name}.py", text)
    except OSError as error:
        raise ArmidError(f"the cache folder {folder} cannot be written ({error.strerror}): set ARMID_CACHE to a "
                         "folder that can") from error  # fmt: skip
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


LOADING = RLock()
KERNELS: WeakKeyDictionary[Model, tuple[Kernel, int]] = WeakKeyDictionary()


def compile_model(model: Model) -> tuple[Kernel, int]:
    """Return `simulate` of a model, compiled at its first call, and its lane width; a known model is looked up.

    Raises ArmidError when the source of an equation cannot be taken over, naming the equation.
    """
    # Threads that ask for the same model at once share one kernel, which numba then compiles once.
    with LOADING:
        if model not in KERNELS:
            kernel = load_module(generate_module(model, LANE_WIDTH)).simulate
            KERNELS[model] = (load_lightly(kernel), LANE_WIDTH)
        return KERNELS[model]
