"""What made a result: the command and its options, as the page shows them."""

import shlex
from pathlib import Path
from typing import Any

import click


def made_by() -> dict[str, Any]:
    """Return the command that is running, as a shell takes it, and the value of each of its options."""
    context = click.get_current_context()
    words = [str(word) for word in context.find_root().obj or ()]
    return {
        "command": shlex.join(["armid", *words]),
        "settings": {name: plain(value) for name, value in context.params.items()},
    }


def plain(value: Any) -> Any:
    """Return an option as JSON can hold it."""
    if isinstance(value, tuple | list):
        return [plain(v) for v in value]
    return str(value) if isinstance(value, Path) else value
