"""What a command has stored in a folder, and what of it a page can be made from."""

import json
from pathlib import Path
from typing import Any

from armid.model import ArmidError

STUDY, LOOP, IDENTIFICATION = "study.sqlite", "report.json", "result.json"
MADE_BY = {STUDY: "armid study", LOOP: "armid close-loop", IDENTIFICATION: "armid identify"}
DETAILS = "details.json"


def result_in(folder: Path) -> str:
    """Return the file that says what a folder holds; a study's store may be named itself.

    Raises ArmidError for a folder without any, and for one with the results of two commands.
    """
    if folder.name == STUDY:
        return STUDY
    there = [name for name in MADE_BY if (folder / name).is_file()]
    if len(there) == 1 or STUDY in there:
        return there[0]
    if there:
        raise ArmidError(f"{folder} holds {' and '.join(there)}, which two commands wrote: one of them is expected")
    names = [f"{name} of `{command}`" for name, command in MADE_BY.items()]
    raise ArmidError(f"{folder} holds no result: {', '.join(names[:-1])} or {names[-1]} is expected")


def read_json(path: Path, command: str) -> dict[str, Any]:
    """Return a stored JSON table.

    Raises ArmidError for a file that is none.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ArmidError(f"{path} is no JSON ({error}): what `{command}` wrote is expected") from error
    if not isinstance(found, dict):
        raise ArmidError(f"{path} holds no table: what `{command}` wrote is expected")
    return found


def details_in(folder: Path, command: str) -> dict[str, Any]:
    """Return the details beside a result, empty where an earlier version of armid wrote none."""
    path = folder / DETAILS
    return read_json(path, command) if path.is_file() else {}


def drawings_in(folder: Path, names: tuple[str, ...]) -> dict[str, str]:
    """Return name -> text of the SVG files that are there, in order."""
    files = {name: folder / f"{name}.svg" for name in names}
    return {name: path.read_text(encoding="utf-8") for name, path in files.items() if path.is_file()}
