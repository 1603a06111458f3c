"""Put a finished campaign in its place, whole or not at all."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from stand.refusal import RefusalError


def check_place(folder: Path, force: bool) -> None:
    """Refuse a place that holds something else; with `force` an earlier campaign may be replaced."""
    try:
        if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
            return
    except OSError as error:
        raise RefusalError(f"{folder} cannot be read: {error.strerror or error}") from error
    if not folder.is_dir():
        raise RefusalError(f"{folder} is a file, so no campaign folder can stand there")
    if not force:
        raise RefusalError(f"{folder} is not empty; give --force to replace the campaign in it")
    if not (folder / "campaign.toml").is_file():
        raise RefusalError(f"{folder} holds no campaign.toml, so --force will not replace what is in it")


def write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write the files into a folder beside, then move it into place; an earlier folder goes only when that is done.

    Raises RefusalError when the disk or the rights do not allow it, and leaves then what was there before.
    """
    place = folder.resolve()
    fresh, old = (place.with_name(f".{place.name}.{word}-{os.getpid()}") for word in ("new", "old"))
    try:
        fresh.mkdir(parents=True)
        for name, content in files.items():
            (fresh / name).write_bytes(content)
        _exchange(place, fresh, old)
    except OSError as error:
        raise RefusalError(f"{folder} cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _exchange(place: Path, fresh: Path, old: Path) -> None:
    """Move the fresh folder to its place and drop the one that stood there, which comes back if that fails."""
    if place.exists():
        place.rename(old)
    try:
        fresh.rename(place)
    except OSError:
        if old.exists():
            old.rename(place)
        raise
    shutil.rmtree(old, ignore_errors=True)
