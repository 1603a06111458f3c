"""The versions of what decides a result."""

import platform
from functools import cache
from importlib.metadata import version

PACKAGES = ("armid", "numpy", "scipy", "numba", "pymoo", "nlopt")


@cache
def versions() -> dict[str, str]:
    """Return package -> version, of Python too."""
    return {"python": platform.python_version(), **{p: version(p) for p in PACKAGES}}
