"""Which campaigns the study consists of, in an order in which a study that is cut short has seen all families alike."""

import json
import os
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from machines.campaign import files_of
from machines.catalogue import MACHINES
from machines.draw import drawn, plan
from machines.make import replaced
from stand.blind.campaign import SUITE
from stand.blind.suite import read_suite
from stand.campaign import write_files
from stand.families import make

ARM = ("control", "one", "two", "three", "fault", "drawn", "wrong", "unlisted")
# The campaigns of `one` once more, their true effect taken out of the library.
HIDDEN = "hidden"
MACHINE = "machine"
# Campaigns of machines for each campaign of a family of the arm: 400 for 150.
OF_MACHINES = 400 / 150
PLANTS = Path(__file__).resolve().parents[1] / "machines" / "plants.py"


@dataclass(frozen=True)
class Task:
    """Name one campaign to be closed: its family, and its place in it."""

    family: str
    index: int

    @property
    def name(self) -> str:
        return f"{self.family}_{self.index:03d}"

    @property
    def campaign(self) -> str:
        """Name of the campaign's folder: a hidden effect is looked for on the records of another task."""
        return f"one_{self.index:03d}" if self.family == HIDDEN else self.name


def file_of(folder: Path, task: Task) -> Path:
    """Return where what a closed campaign says is kept."""
    return folder / "closed" / f"{task.name}.json"


def former_file(folder: Path, task: Task) -> Path:
    """Return where what an earlier version says of the same campaign is kept."""
    return folder / "former" / f"{task.name}.json"


def truth_file(folder: Path, task: Task) -> Path:
    return folder / "truth" / f"{task.campaign}.json"


def tasks(size: int) -> Iterator[Task]:
    """List the campaigns, families in turn; size: of each family of the arm."""
    made = 0
    for index in range(size):
        for family in (*ARM, HIDDEN):
            yield Task(family, index)
        while made < round((index + 1) * OF_MACHINES):
            yield Task(MACHINE, made)
            made += 1


def campaign_of(task: Task, folder: Path, seed: int, without_left_out: bool) -> tuple[Path, dict[str, Any]]:
    """Return the folder of a campaign, made where it is not there yet, and its truth."""
    there, key = folder / "campaigns" / task.campaign, truth_file(folder, task)
    if not key.exists():
        files, entry = made_machine(task, seed, without_left_out) if task.family == MACHINE else made_arm(task, seed)
        write_files(there, files)
        key.parent.mkdir(exist_ok=True)
        written(key, entry)
    return there, json.loads(key.read_text())


def made_arm(task: Task, seed: int) -> tuple[dict[str, str], dict[str, Any]]:
    family = "one" if task.family == HIDDEN else task.family
    return make(read_suite(SUITE), seed, (family, task.index))


def made_machine(task: Task, seed: int, without_left_out: bool) -> tuple[dict[str, str], dict[str, Any]]:
    names = [name for name, machine in MACHINES.items() if not (without_left_out and machine.left_out)]
    planned, rng = plan(seed, task.index, names)
    return files_of(task.name, drawn(planned, rng), rng)


def written(path: Path, content: Any) -> None:
    """Write JSON whole or not at all."""
    replaced(path, json.dumps(content, default=plain))


def plain(value: Any) -> Any:
    """Return a value as JSON knows it."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (set, frozenset)):
        return sorted(value)
    return str(value)


def kept_answer(path: Path, task: Task, answer: Callable[[], dict[str, Any]]) -> str:
    """Keep the answer to a campaign, or the error in which it ended, with its time; return a line about it."""
    before = seconds()
    try:
        kept = answer()
    except Exception:
        kept = {"failed": traceback.format_exc()[-2000:]}
    kept |= {"cpu_s": seconds() - before}
    written(path, kept)
    return f"{task.name} {kept['cpu_s']:.1f} s: {kept.get('verdict', 'FAILED')}"


def seconds() -> float:
    """Return the processor time of this process [s]."""
    times = os.times()
    return times.user + times.system
