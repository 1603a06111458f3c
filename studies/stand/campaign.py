"""The files of a campaign, whoever makes it, and how they are put in their place."""

import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from stand import RefusalError
from stand.gyro import Gyro, Record

# The simulated arm has the declared constants to the last digit.
EXACT = ("", "[tolerances]", "default = 0.0")


def short(value: float) -> str:
    """Write a number with as many digits as it has and no more."""
    return repr(float(value)).removesuffix(".0")


def record_text(record: Record, decimals: int, time_decimals: int = 3) -> str:
    """Write a record as CSV: time to the millisecond unless told, speed with the decimals of its quantisation."""
    # a rounded -0 is written as 0
    speeds = [round(speed, decimals) + 0.0 for speed in record.speed_deg_s.tolist()]
    lines = [f"{t:.{time_decimals}f},{v:.{decimals}f}" for t, v in zip(record.time_s, speeds, strict=True)]
    return "\n".join(["time_s,angular_velocity_deg_s", *lines, ""])


def campaign_text(
    said: Sequence[str], name: str, gyro: Gyro, records: Sequence[Record], *, window_s: Sequence[float] | None = None,
    constants: Sequence[str] = EXACT,
) -> str:  # fmt: skip
    """Write campaign.toml: comments, the records, and how well the constants are known."""
    lines = [*(f"# {line}" for line in said), "", f'name = "{name}"', 'plant = "shell_transfer_arm"']
    lines.append(f"gyro_range_deg_s = {short(gyro.range_deg_s)}")
    for record in records:
        told = {"file": record.file, "role": record.role, **record.manoeuvre.told()}
        told |= {"window_s": list(window_s)} if window_s else {}
        told |= {"repeat_of": record.repeat_of} if record.repeat_of else {}
        lines += ["", "[[records]]", *(f"{key} = {json.dumps(value)}" for key, value in told.items())]
    return "\n".join([*lines, *constants, ""])


def write_files(folder: Path, files: Mapping[str, str]) -> None:
    """Write texts into a folder, which is made where it is not there."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_bytes(text.encode())


def check_place(folder: Path, force: bool, stranger: Callable[[list[str]], str], *beside: Path) -> None:
    """Refuse a place that is taken; with `force` what is there may be replaced.

    `stranger` names among the names in the folder what may not be replaced, "" where all may. `beside`: files that are
    made with the folder.
    """
    try:
        there = sorted(each.name for each in folder.iterdir()) if folder.exists() else []
    except NotADirectoryError as error:
        raise RefusalError(f"{folder} is a file, so no campaign can stand there") from error
    except OSError as error:
        raise RefusalError(f"{folder} cannot be read: {error.strerror or error}") from error
    taken = [folder] if there else [each for each in beside if each.exists()]
    if taken and not force:
        raise RefusalError(f"{taken[0]} is there and not empty; give --force to replace it")
    if there and (kept := stranger(there)):
        raise RefusalError(f"{folder} holds {kept}, so --force will not replace it")


@contextmanager
def replacing(folder: Path) -> Iterator[Path]:
    """Give a new folder beside, and move it into place in the end; an earlier folder goes only when that is done.

    Raises RefusalError when the disk or the rights do not allow it, and leaves then what was there before.
    """
    place = folder.resolve()
    fresh, old = (place.with_name(f".{place.name}.{word}-{os.getpid()}") for word in ("new", "old"))
    try:
        fresh.mkdir(parents=True)
        yield fresh
        if place.exists():
            place.rename(old)
        fresh.rename(place)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise RefusalError(f"{folder} cannot be written: {error.strerror or error}") from error
    finally:
        if old.exists() and not place.exists():
            old.rename(place)
        shutil.rmtree(fresh, ignore_errors=True)
