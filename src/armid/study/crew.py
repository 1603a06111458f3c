"""Who performs the runs of a study: worker processes on this machine."""

from collections import deque
from collections.abc import Sequence
from multiprocessing.connection import wait
from typing import Protocol

from armid.study.lane import AHEAD, Lane, Workplace
from armid.study.outcome import Outcome, Task

# Short runs are fetched from the store as many at a time as take about this long [s], but no more than so many.
BATCH_S, LARGEST_BATCH = 0.5, 64


class Crew(Protocol):
    """Perform runs: given at any time, they come back one by one in any order."""

    @property
    def held(self) -> int:
        """Number of runs that were given and have not come back."""
        ...

    def wanted(self) -> int:
        """Return how many further runs to give now."""
        ...

    def give(self, tasks: Sequence[Task]) -> None:
        """Add runs."""
        ...

    def wait(self, seconds: float) -> list[Outcome]:
        """Return what is finished, at the latest after so many seconds."""
        ...

    def close(self) -> None:
        """End at once; what is not finished is lost."""
        ...


class Pace:
    """Follow how long runs take lately."""

    def __init__(self) -> None:
        self.seconds = BATCH_S

    def see(self, outcomes: Sequence[Outcome]) -> None:
        """Take finished runs into account."""
        for outcome in outcomes:
            self.seconds += 0.2 * (outcome.seconds - self.seconds)

    @property
    def batch(self) -> int:
        """How many runs take about as long as a batch should."""
        return max(1, min(LARGEST_BATCH, int(BATCH_S / max(self.seconds, 1e-6))))


class LocalCrew:
    """Perform runs in worker processes on this machine."""

    def __init__(self, jobs: int, workplace: Workplace) -> None:
        self.lanes = [Lane(workplace) for _ in range(jobs)]
        self._waiting: deque[Task] = deque()
        self._pace = Pace()

    @property
    def held(self) -> int:
        """Number of runs that were given and have not come back."""
        return len(self._waiting) + sum(lane.held for lane in self.lanes)

    def wanted(self) -> int:
        """Return how many further runs to give now."""
        enough = AHEAD * len(self.lanes)
        return enough + self._pace.batch if self.held <= enough else 0

    def give(self, tasks: Sequence[Task]) -> None:
        """Add runs."""
        self._waiting.extend(tasks)
        self._hand_out()

    def wait(self, seconds: float) -> list[Outcome]:
        """Return what is finished, at the latest after so many seconds."""
        busy = [lane for lane in self.lanes if lane.held]
        connections = [lane.connection for lane in busy]
        wait(connections, max(0.0, min([seconds, *(lane.seconds_left() for lane in busy)])))
        outcomes = [outcome for lane in busy for outcome in lane.hear()]
        self._pace.see(outcomes)
        self._hand_out()
        return outcomes

    def close(self) -> None:
        """End at once; what is not finished is lost."""
        for lane in self.lanes:
            lane.stop()

    def _hand_out(self) -> None:
        """Give each worker what it needs to go on, the least busy first."""
        for n in range(AHEAD):
            for lane in self.lanes:
                if self._waiting and lane.held <= n:
                    lane.give([self._waiting.popleft()])
