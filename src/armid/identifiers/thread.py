"""A routine that calls for values, turned into a search that is asked and told: it runs in a thread of its own."""

import weakref
from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread, current_thread
from typing import Any, NamedTuple

from armid.identifiers.search import Array, Ask, Asker, Dropped, Search, Told


class End(NamedTuple):
    """How the routine ended: with a result, or with an error of its own."""

    result: bool
    error: BaseException | None


class Line:
    """The two queues between a search and its thread; the search holds it, the thread holds the queues alone."""

    def __init__(self, routine: Callable[[Asker], bool]) -> None:
        self.asked: SimpleQueue[Any] = SimpleQueue()
        self.told: SimpleQueue[Told | None] = SimpleQueue()
        self.thread = Thread(target=work, args=(routine, self.asked, self.told), name="armid search", daemon=True)
        # also at the interpreter's exit, while daemon threads still run: later nobody could wait for them
        self.hang_up = weakref.finalize(self, ended, self.told, self.thread)


def as_search(routine: Callable[[Asker], bool]) -> Search:
    """Run a routine in a thread that moves only while the search waits for its next question.

    routine: takes a function that evaluates candidates and returns whether any of them has a fitness.
    The thread ends with the routine, and when the search is closed or dropped or the interpreter exits.
    """
    line = Line(routine)
    try:
        line.thread.start()
        while not isinstance(question := line.asked.get(), End):
            line.told.put((yield question))
    finally:
        line.hang_up()
    if question.error is not None:
        raise question.error
    return question.result


def work(routine: Callable[[Asker], bool], asked: "SimpleQueue[Any]", told: "SimpleQueue[Told | None]") -> None:
    """Run the routine and say how it ended."""

    def ask(X: Array, residuals: bool = False) -> Told:
        asked.put(Ask(X, residuals))
        answer = told.get()
        if answer is None:
            raise Dropped
        return answer

    try:
        asked.put(End(routine(ask), None))
    except Dropped:
        # nobody listens; kept, its frames would hold NLopt's object and that the routine, in a circle that never ends
        return
    except BaseException as error:
        # nothing is swallowed: the thread that waits for the routine raises it
        asked.put(End(False, error))


def ended(told: "SimpleQueue[Told | None]", thread: Thread) -> None:
    """Tell a thread to end and wait for it; memory may be tidied by the thread itself, which cannot wait for itself."""
    told.put(None)
    if thread.is_alive() and thread is not current_thread():
        thread.join()
