"""The versions of what decides a result."""

import platform
from collections.abc import Sequence
from importlib.metadata import version


def versions_of(packages: Sequence[str]) -> dict[str, str]:
    """Return package -> version, of Python too."""
    return {"python": platform.python_version(), **{p: version(p) for p in packages}}
