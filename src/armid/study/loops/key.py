"""The truth of blind campaigns, which is opened when they are reported and not before."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from armid.model import ArmidError

Entry = Mapping[str, Any]


def read_key(path: Path, made_by: str = "") -> dict[str, Entry]:
    """Return campaign -> what is true of it.

    path: a JSON file whose `campaigns` holds class, parameters, effects, noise, floor and declared_fit of each.
    made_by: the command that makes campaigns and key, told where the file is absent.

    Raises ArmidError for a file that is not there or is no key.
    """
    if not path.is_file():
        made = f"`{made_by}` makes it with the campaigns" if made_by else "the file that holds the truth is expected"
        raise ArmidError(f"key {path} does not exist: {made}")
    try:
        campaigns = json.loads(path.read_text(encoding="utf-8"))["campaigns"]
        return {str(name): check_entry(entry) for name, entry in campaigns.items()}
    except (OSError, ValueError) as error:
        raise ArmidError(f"key {path} cannot be read: {error}") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise ArmidError(f"key {path} is no key of blind campaigns: {error} is not as expected") from error


def check_entry(entry: Entry) -> Entry:
    """Return an entry that holds what a report asks of it."""
    for name in ("class", "parameters", "declared_fit"):
        entry[name]
    for effect in entry["effects"]:
        for name in ("name", "listed", "matching", "strength", "form", "port"):
            effect[name]
    entry["noise"]["kind"], entry["floor"]["holdout"]
    return entry
