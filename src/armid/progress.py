"""Report work that takes long: through the log `armid`, which the commands print, and by bars."""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from typing import TYPE_CHECKING, Any

from armid.errors import ArmidError, nearest, printable

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import TaskID

LOG = logging.getLogger("armid")
# When work is announced, and how often again [s].
SLOW_S, AGAIN_S = 2.0, 15.0
# Where no bar can be drawn, so many seconds pass between two lines.
SILENT_S = 60.0
LEVELS = ("debug", "info", "warning", "error")


@contextmanager
def announced(sentence: str) -> Iterator[None]:
    """Tell what is being done where it takes more than 2 s, and every 15 s from then on with the time that it took."""
    began, ended = monotonic(), Event()

    def announce() -> None:
        if not ended.wait(SLOW_S):
            LOG.info(sentence)
            while not ended.wait(AGAIN_S):
                LOG.info("%s (%.0f s)", sentence, monotonic() - began)

    Thread(target=announce, daemon=True).start()
    try:
        yield
    finally:
        ended.set()


def set_log_level(level: str) -> None:
    """Print what armid is doing on the error stream, from a level on.

    Parameters
    ----------
    level : {"debug", "info", "warning", "error"}
        "info" announces work that takes longer than 2 s (reading, compiling, planning); "warning" is silent about it.

    Returns
    -------
    None

    Raises
    ------
    ArmidError
        For another level.
    """
    if level not in LEVELS:
        raise ArmidError(f"the log level is {level!r}: {nearest(str(level), LEVELS)}")
    if not any(handler.name == LOG.name for handler in LOG.handlers):
        handler = logging.StreamHandler()
        handler.name = LOG.name
        handler.setFormatter(logging.Formatter("armid: %(message)s"))
        LOG.addHandler(handler)
    LOG.setLevel(level.upper())


def console() -> "Console | None":
    """Return the console on which bars are drawn, in a terminal or a notebook; None elsewhere."""
    # a kernel is at work where the shell has one: that somebody imported its package says nothing
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    is_notebook = hasattr(shell, "kernel")
    if not (is_notebook or sys.stderr.isatty()):
        return None
    from rich.console import Console

    # one line that is drawn anew is within a notebook's reach, and asks for no widgets
    return Console(stderr=True, force_jupyter=False, force_terminal=is_notebook or None)


@contextmanager
def search_bar(is_shown: bool = True) -> Iterator[Callable[[Any], None]]:
    """Yield a function that draws the state of a search, a Meter, with rate and time left, if there is a console.

    A state whose `what` says that it counts something else than simulations gets a bar of its own.
    """
    drawn_on = console() if is_shown else None
    if drawn_on is None:
        yield lambda meter: None
        return
    from rich.progress import BarColumn, Progress, TimeRemainingColumn

    columns = ("{task.completed:.0f}/{task.total:.0f} {task.description}", BarColumn(), "{task.fields[rate]:.0f}/s",
               TimeRemainingColumn(), "{task.fields[best]}")  # fmt: skip
    with Progress(*columns, console=drawn_on) as bar:
        tasks: dict[str, TaskID] = {}

        def update(state: Any) -> None:
            what = getattr(state, "what", "simulations")
            best = f"best {state.best_f:.6g}" if what == "simulations" else ""
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=state.budget, best=best, rate=0.0)
            # rich does not know a speed until it has seen two steps
            rate = bar.tasks[tasks[what]].speed or 0.0
            bar.update(tasks[what], total=state.budget, completed=state.used, best=best, rate=rate)

        yield update


@contextmanager
def status_line(is_shown: bool = True) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows a sentence and the time; where no bar can be drawn it prints one once a minute."""
    drawn_on = console() if is_shown else None
    if drawn_on is None:
        began = last = monotonic()

        def now_and_then(sentence: str) -> None:
            nonlocal last
            if is_shown and monotonic() - last >= SILENT_S:
                last = monotonic()
                print(printable(f"{last - began:.0f} s: {sentence}"), file=sys.stderr, flush=True)

        yield now_and_then
        return
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TimeElapsedColumn(), TextColumn("{task.description}", markup=False)
    with Progress(*columns, console=drawn_on, transient=True) as bar:
        task = bar.add_task("identifying the declared model (compiling at first)", total=None)
        yield lambda sentence: bar.update(task, description=printable(sentence))
