"""Valid tables of TOML with things taken out, put in and replaced, and how they are written."""

import json
from typing import Any

from hypothesis import strategies as st

# Larger numbers of seeds or cases are allowed, and take memory.
NUMBERS = st.one_of(
    st.integers(-3, 100), st.floats(), st.sampled_from([0, 1, -1, 10**12, 10**400, 1e308, 5e-324, 1e30, float("nan")])
)
WORDS = st.one_of(
    st.sampled_from([
        "", "train", "holdout", "linear", "zero", "lower.csv", "../lower.csv", "/etc/passwd", "a\\b.csv", "\0", "pso",
        "pso+bobyqa", "multistart:lbfgs", "+", "rmse", "coulomb", "whole", "name", "p0", "coulomb.level", "drive_V",
        "u", "driven_axis", "shell_transfer_arm", "table1", "identify", "x" * 300, "[", "é\u2028",
    ]), st.text(max_size=8),
)  # fmt: skip
SCALARS = st.one_of(NUMBERS, WORDS, st.booleans())
VALUES = st.recursive(
    SCALARS, lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(WORDS, inner, max_size=3)),
    max_leaves=6,
)  # fmt: skip


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path to every part of a table."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else []
    return [p for key in keys for p in ((*path, key), *places(value[key], (*path, key)))]


@st.composite
def mutated(draw: st.DrawFn, table: dict[str, Any]) -> dict[str, Any]:
    """Return a table with up to three parts replaced, taken out, put in under another key, or there twice."""
    changed = json.loads(json.dumps(table))
    for _ in range(draw(st.integers(1, 3))):
        there = places(changed)
        if not there:
            break
        *way, last = draw(st.sampled_from(there))
        holder = changed
        for key in way:
            holder = holder[key]
        change(draw, holder, last)
    return changed


def change(draw: st.DrawFn, holder: Any, key: Any) -> None:
    """Change one part of a table or a list in place."""
    what = draw(st.sampled_from(["replace", "replace", "out", "in", "twice"]))
    if what == "replace":
        holder[key] = draw(VALUES)
    elif what == "out":
        del holder[key]
    elif isinstance(holder, list):
        holder.append(holder[key] if what == "twice" else draw(VALUES))
    else:
        holder[draw(WORDS)] = holder[key] if what == "twice" else draw(VALUES)


def written(value: Any) -> str:
    """Return a value as TOML writes it in one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for lone surrogates, which no UTF-8 file holds
        return json.dumps(value.encode("utf-8", "replace").decode())
    if isinstance(value, dict):
        return "{" + ", ".join(f"{written(str(k))} = {written(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(written, value)) + "]"
    return repr(value)


def toml_of(table: dict[str, Any]) -> bytes:
    """Return a file of TOML."""
    return "".join(f"{written(str(k))} = {written(v)}\n" for k, v in table.items()).encode()
