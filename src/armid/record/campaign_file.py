"""Files of a campaign: the text of campaign.toml, and CSV files that must lie in its folder."""

import os.path
import tomllib
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from armid.model import ArmidError, nearest
from armid.record.shown import shown

NAME = "campaign.toml"
SUFFIX = ".csv"


def campaign_path(path: str | Path) -> Path:
    """Return the campaign.toml that a folder or a file stands for.

    Raises ArmidError when there is none.
    """
    if not os.path.exists(path):
        raise ArmidError(f"campaign {shown(str(path))} does not exist, a folder with a {NAME} is expected")
    if os.path.isfile(path):
        return Path(path)
    if not os.path.isfile(os.path.join(path, NAME)):
        raise ArmidError(f"campaign {shown(str(path))} holds no {NAME}, a folder with one is expected")
    return Path(path) / NAME


def folder_name(toml: Path) -> str:
    """Return what messages put before the files of a campaign: `c00/`."""
    name = toml.parent.name or toml.parent.resolve().name
    return f"{name if name.isprintable() else shown(name)}/" if name else ""


def load_toml(path: Path, named: str = "") -> dict[str, Any]:
    """Return the tables of a TOML file; named: how messages name it, "": by its own name.

    Raises ArmidError, with the line, for what is no UTF-8 text or no TOML.
    """
    where = named or path.name
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ArmidError(f"{where} cannot be read: {error.strerror or error}") from error
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ArmidError(f"{where}, line {line}: not readable as text, TOML in UTF-8 is expected") from error
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ArmidError(f"{where} is nested too deeply, plain tables of TOML are expected") from error
    except ValueError as error:
        # TOMLDecodeError tells the line; numbers of too many digits come as a plain ValueError
        raise ArmidError(f"{where} is no valid TOML: {str(error)[:200]}") from error


def record_path(folder: Path, file: str, where: str) -> Path:
    """Return where the file of a record is.

    Raises ArmidError for a name that leads out of the folder (also through a link), is no CSV file, or does not exist.
    """
    pure = PurePosixPath(file.replace("\\", "/"))
    if pure.is_absolute() or PureWindowsPath(file).drive or ".." in pure.parts:
        raise ArmidError(f"{where}: file {shown(file)} leads out of the campaign's folder, a file inside is expected")
    if pure.suffix.lower() != SUFFIX or not file.isprintable():
        raise ArmidError(f"{where}: file {shown(file)} is no CSV file, a name that ends in {SUFFIX} is expected")
    path = os.path.join(folder, file)
    if not os.path.isfile(path):
        there = sorted(p.name for p in folder.glob(f"*{SUFFIX}"))
        raise ArmidError(f"{where}: file {shown(file)} does not exist, {nearest(file, there)}")
    real = Path(os.path.realpath(path))
    if not real.is_relative_to(os.path.realpath(folder)):
        raise ArmidError(f"{where}: file {shown(file)} links out of the campaign's folder, a file inside is expected")
    return real
