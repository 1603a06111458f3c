"""Who performs the runs of a study: a Dask cluster."""

import threading
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any

from armid.errors import ArmidError
from armid.study.outcome import Outcome, Task
from armid.study.pool import Lane, Pace, Workplace

# Parcels of runs that each thread of the cluster has before it.
AHEAD = 2
# How often a parcel may be sent again after the loss of the workers that had it.
MOST_LOSSES = 10
CONNECT_S = 20.0
OF_THREAD = threading.local()


def perform_parcel(tasks: tuple[Task, ...], workplace: Workplace) -> list[Outcome]:
    """Perform some runs on a worker of the cluster, in a process of their own that can be stopped."""
    lane = getattr(OF_THREAD, "lane", None)
    if lane is None or lane.workplace != workplace:
        if lane is not None:
            lane.stop()
        lane = OF_THREAD.lane = Lane(workplace)
    return lane.perform(list(tasks))


class DaskCrew:
    """Perform runs on a Dask cluster; parcels whose worker is lost are sent again.

    address: of the scheduler, as tcp://host:8786.
    Raises ArmidError when `distributed` is not installed and when the cluster does not answer.
    """

    def __init__(self, address: str, workplace: Workplace) -> None:
        self.workplace, self.address = workplace, address
        self._client, self._killed = connected(address)
        self._parcels: dict[Any, tuple[tuple[Task, ...], int]] = {}
        self._ended: SimpleQueue[Any] = SimpleQueue()
        self._pace = Pace()

    @property
    def held(self) -> int:
        """Number of runs that were given and have not come back."""
        return sum(len(tasks) for tasks, _ in self._parcels.values())

    def wanted(self) -> int:
        """Return how many further runs to give now."""
        parcels = AHEAD * max(1, sum(self._client.nthreads().values()))
        return int(max(0, parcels - len(self._parcels)) * self._pace.batch)

    def give(self, tasks: Sequence[Task]) -> None:
        """Add runs."""
        size = self._pace.batch
        for first in range(0, len(tasks), size):
            self._submit(tuple(tasks[first : first + size]), 0)

    def wait(self, seconds: float) -> list[Outcome]:
        """Return what is finished, at the latest after so many seconds."""
        if self._client.status != "running":
            raise ArmidError(f"the Dask cluster at {self.address} has gone: start again to go on")
        with suppress(Empty):
            outcomes = self._finished(self._ended.get(timeout=seconds))
            self._pace.see(outcomes)
            return outcomes
        return []

    def close(self) -> None:
        """End at once; what is not finished is lost."""
        self._client.cancel(list(self._parcels))
        self._client.close()

    def _submit(self, tasks: tuple[Task, ...], losses: int) -> None:
        future = self._client.submit(perform_parcel, tasks, self.workplace, pure=False)
        self._parcels[future] = (tasks, losses)
        future.add_done_callback(self._ended.put)

    def _finished(self, future: Any) -> list[Outcome]:
        tasks, losses = self._parcels.pop(future)
        if future.status == "finished":
            outcomes: list[Outcome] = future.result()
            return outcomes
        error = future.exception() if future.status == "error" else None
        if error is not None and not isinstance(error, self._killed):
            raise ArmidError(f"a worker of the Dask cluster fails: {error}") from error
        if losses >= MOST_LOSSES:
            raise ArmidError(f"the Dask cluster at {self.address} has lost {losses} workers over the same runs")
        self._submit(tasks, losses + 1)
        return []


def connected(address: str) -> tuple[Any, Any]:
    """Return a client of a cluster, and the error of a lost worker.

    Raises ArmidError with one sentence where there is none.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise ArmidError("--dask needs the package distributed: pip install 'armid[cluster]'") from error
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        client.wait_for_workers(1, timeout=CONNECT_S)
    except (OSError, TimeoutError, ValueError) as error:
        raise ArmidError(f"the Dask cluster at {address} does not answer, tcp://HOST:PORT of a scheduler with a worker "
                         "is expected") from error  # fmt: skip
    return client, distributed.KilledWorker
