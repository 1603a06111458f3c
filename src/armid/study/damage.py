"""A store whose content is not what was written to it."""

import json
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from armid.model import ArmidError

# What the description of a study holds in every version of this format.
WORDS = ("name", "cases")


@contextmanager
def whole(file: Path, what: str) -> Iterator[None]:
    """Turn content that cannot be decoded into one sentence.

    Raises ArmidError naming the file and what of it is damaged.
    """
    try:
        yield
    except (json.JSONDecodeError, UnicodeDecodeError, zlib.error) as error:
        raise ArmidError(f"{file} is damaged: {what} cannot be read ({error})") from error


def description_of(file: Path, text: str) -> dict[str, Any]:
    """Return the description of a study.

    Raises ArmidError when it is none.
    """
    with whole(file, "the description of the study"):
        found = json.loads(text)
    missing = [word for word in WORDS if not isinstance(found, dict) or word not in found]
    if missing:
        raise ArmidError(f"{file} is damaged: the description of the study lacks '{missing[0]}'")
    return dict(found)
