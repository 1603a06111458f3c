"""Work on many items, shared among threads."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

S = TypeVar("S")
T = TypeVar("T")


def side_by_side(work: Callable[[S], T], items: Iterable[S], threads: int) -> list[T]:
    """Return the work of each item, in order; the same for any number of threads.

    Fits of several candidates side by side keep two threads busier than the lanes of one fit do: measured on the arm,
    1.7 of two against 1.3.
    """
    todo = list(items)
    if threads < 2 or len(todo) < 2:
        return [work(item) for item in todo]
    # A pool of its own: work that waited for the engine's lanes in the same pool would wait for itself.
    with ThreadPoolExecutor(threads, thread_name_prefix="armid") as pool:
        return list(pool.map(work, todo))
