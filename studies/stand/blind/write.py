"""Write a blind suite: the campaigns in one folder, the key beside it and not in it."""

import json
import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from stand.blind.campaign import Entry, make_campaign
from stand.blind.case import Case
from stand.blind.suite import Suite
from stand.refusal import RefusalError

CAMPAIGN = re.compile(r"c\d{3,}|[a-z]\d\d(_advised|_random)?")
Make = Callable[[Any], tuple[dict[str, bytes], Entry]]
"""Makes the files of a campaign, and its entry in the key."""


def key_path(folder: Path) -> Path:
    """Give where the key of a suite lies: beside its folder, FOLDER.key.json."""
    return folder.with_name(f"{folder.name}.key.json")


def check_suite_place(folder: Path, force: bool) -> None:
    """Refuse a place that holds something else; with `force` an earlier suite and its key may be replaced."""
    if not folder.name:
        raise RefusalError(f"{folder} names no folder that a suite could have")
    there = sorted(folder.iterdir()) if folder.is_dir() else []
    if folder.exists() and not folder.is_dir():
        raise RefusalError(f"{folder} is a file, so no suite can stand there")
    if not there and not key_path(folder).exists():
        return
    if not force:
        found = folder if there else key_path(folder)
        raise RefusalError(f"{found} is there already; give --force to replace the suite and its key")
    strangers = [each.name for each in there if not CAMPAIGN.fullmatch(each.name)]
    if strangers:
        raise RefusalError(f"{folder} holds {strangers[0]}, which is no blind campaign, so --force will not replace it")


def write_suite(folder: Path, suite: Suite, cases: Mapping[str, Case], seed: int, processes: int) -> None:
    """Make every campaign of a suite, as `write_campaigns` does."""
    named = {name: (name, case) for name, case in cases.items()}
    write_campaigns(folder, named, partial(_make_blind, suite, seed), {"seed": seed}, processes)


def _make_blind(suite: Suite, seed: int, named: tuple[str, Case]) -> tuple[dict[str, bytes], Entry]:
    name, case = named
    return make_campaign(name, suite, case, seed)


def write_campaigns(
    folder: Path, named: Mapping[str, Any], make: Make, head: Mapping[str, Any], processes: int
) -> None:
    """Make every campaign, in `processes` processes, and put folder and key in place when all are there.

    `named` is what `make` is given for each campaign, `head` what the key tells of all of them. What is written does
    not depend on the number of processes. Raises RefusalError when the disk does not allow it.
    """
    place = folder.resolve()
    fresh = place.with_name(f".{place.name}.new-{os.getpid()}")
    try:
        fresh.mkdir(parents=True)
        entries = _make_all(fresh, named, make, processes)
        shutil.rmtree(place, ignore_errors=True)
        fresh.rename(place)
        key = {"made_by": "studies/test_stand.py blind", "unit": "rad/s", **head, "campaigns": entries}
        key_path(place).write_text(json.dumps(key, indent=1) + "\n")
    except OSError as error:
        raise RefusalError(f"{folder} cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _make_all(fresh: Path, named: Mapping[str, Any], make: Make, processes: int) -> dict[str, Entry]:
    with _mapper(processes) as run:
        return dict(zip(named, run(partial(_make, fresh, make), named.items()), strict=True))


def _make(fresh: Path, make: Make, named: tuple[str, Any]) -> Entry:
    """Make one campaign, write its files, and give its entry in the key."""
    name, case = named
    files, entry = make(case)
    (fresh / name).mkdir()
    for file, content in files.items():
        (fresh / name / file).write_bytes(content)
    return entry


@contextmanager
def _mapper(processes: int) -> Iterator[Any]:
    """Give a map over processes, or the plain one for a single process."""
    if processes == 1:
        yield map
        return
    with ProcessPoolExecutor(processes) as pool:
        yield pool.map
