"""File names out of free text."""

import re


def slug(*texts: str) -> str:
    """Return a file name of letters, digits and underscores: "pso, literal" becomes "pso_literal"."""
    return re.sub(r"[^A-Za-z0-9]+", "_", "_".join(texts)).strip("_").lower()


def unlike(names: list[str]) -> list[str]:
    """Return the names with a number behind those that are there already."""
    found: list[str] = []
    for name in names:
        again = sum(re.fullmatch(rf"{re.escape(name)}(_\d+)?", f) is not None for f in found)
        found.append(f"{name}_{again + 1}" if again else name)
    return found
