"""The versions of what decides a result."""

from functools import cache

from armid.identification.versions import versions_of

PACKAGES = ("armid", "numpy", "scipy", "numba", "pymoo", "nlopt")


@cache
def versions() -> dict[str, str]:
    """Return package -> version, of Python too."""
    return versions_of(PACKAGES)
