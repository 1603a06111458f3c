"""Times of pieces of work, taken in turn, so that whatever disturbs the machine disturbs all of them."""

import time
from collections.abc import Callable, Hashable, Mapping
from typing import Any, TypeVar

Key = TypeVar("Key", bound=Hashable)
Clock = Callable[[], float]
Work = Callable[[], object]

# The time of the process does not count what others do on the same core; not every system has it fine enough.
CPU: Clock = time.process_time if time.get_clock_info("process_time").resolution < 1e-5 else time.perf_counter
WALL: Clock = time.perf_counter


def fastest(works: Mapping[Key, Work], rounds: int = 10, clock: Clock = CPU, slot: float = 0.02) -> dict[Key, float]:
    """Return the shortest time of each work [s].

    Each work runs once to warm up; then, in every round, all of them in turn for `slot` seconds, at least once.
    """
    for work in works.values():
        work()
    best = dict.fromkeys(works, float("inf"))
    for _ in range(rounds):
        for name, work in works.items():
            best[name] = min(best[name], shortest(work, clock, slot))
    return best


def shortest(work: Work, clock: Clock, slot: float) -> float:
    """Return the shortest time of a work that is repeated for `slot` seconds [s]."""
    best, begin = float("inf"), WALL()
    while True:
        start = clock()
        work()
        best = min(best, clock() - start)
        if WALL() - begin >= slot:
            return best


class Stopwatch:
    """Add up the time spent in calls."""

    def __init__(self, clock: Clock = CPU) -> None:
        self.clock, self.spent = clock, 0.0

    def timed(self, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """Return what a function returns, and add the time it took."""
        start = self.clock()
        result = function(*arguments, **named)
        self.spent += self.clock() - start
        return result
