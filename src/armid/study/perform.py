"""A run of any kind, with whatever it raises kept as its outcome."""

import json
import time
from datetime import UTC, datetime

from armid.model import ArmidError
from armid.registry import place_in_plugin
from armid.study.kind import KINDS
from armid.study.outcome import FAILED, Outcome, Task
from armid.study.workshop import Workshop

LONGEST_ERROR = 2000


def perform(task: Task, workshop: Workshop) -> Outcome:
    """Perform a run; one that fails is an outcome too, so that the others go on."""
    began, started_at = time.perf_counter(), datetime.now(UTC).isoformat(timespec="seconds")
    try:
        outcome: Outcome = KINDS[json.loads(task.settings)["kind"]].perform()(task, workshop)
    except (Exception, SystemExit) as error:
        seconds = time.perf_counter() - began
        return Outcome(task.run, FAILED, sentence(error), seconds=seconds, started_at=started_at)
    return outcome


def sentence(error: BaseException) -> str:
    """Return what an error says, with its kind and its place in a plug-in where it is none of ours."""
    if isinstance(error, ArmidError):
        return str(error)[:LONGEST_ERROR]
    place = place_in_plugin(error)
    where = "" if place is None else f"plug-in {place}: "
    return f"{where}{type(error).__name__}: {error}"[:LONGEST_ERROR]
