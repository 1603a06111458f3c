"""A Dask cluster that performs runs in place of own worker processes."""

import logging
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any

from armid.errors import ArmidError
from armid.study.outcome import ClaimedRun, Outcome
from armid.study.pool import BatchSize, WorkerProcess, WorkerSetup

# Batches of runs that each thread of the cluster has before it.
AHEAD = 2
# How often a batch may be sent again after the loss of the workers that had it.
MOST_LOSSES = 10
CONNECT_S = 20.0
OF_THREAD = threading.local()


def perform_batch(runs: tuple[ClaimedRun, ...], setup: WorkerSetup) -> list[Outcome]:
    """Perform some runs on a worker of the cluster, in a process of their own that can be stopped."""
    process = getattr(OF_THREAD, "process", None)
    if process is None or process.setup != setup:
        if process is not None:
            process.stop()
        process = OF_THREAD.process = WorkerProcess(setup)
    return process.perform(list(runs))


class DaskPool:
    """Perform runs on a Dask cluster, as `LocalPool` does on this machine; batches of a lost worker are sent again."""

    def __init__(self, address: str, setup: WorkerSetup) -> None:
        self.setup, self.address = setup, address
        self._client, self._killed = _connected(address)
        self._batches: dict[Any, tuple[tuple[ClaimedRun, ...], int]] = {}
        self._ended: SimpleQueue[Any] = SimpleQueue()
        self._size = BatchSize()

    @property
    def held(self) -> int:
        return sum(len(runs) for runs, _ in self._batches.values())

    def wanted(self) -> int:
        with self._reached():
            batches = AHEAD * max(1, sum(self._client.nthreads().values()))
        return int(max(0, batches - len(self._batches)) * self._size.n_runs)

    def give(self, runs: Sequence[ClaimedRun]) -> None:
        size = self._size.n_runs
        for first in range(0, len(runs), size):
            self._submit(tuple(runs[first : first + size]), 0)

    def wait(self, seconds: float) -> list[Outcome]:
        with self._reached(), suppress(Empty):
            if self._client.status != "running":
                raise ConnectionError
            outcomes = self._finished(self._ended.get(timeout=seconds))
            self._size.update(outcomes)
            return outcomes
        return []

    def close(self) -> None:
        # a scheduler that has gone has nothing to cancel
        with suppress(OSError):
            self._client.cancel(list(self._batches))
        self._client.close()

    @contextmanager
    def _reached(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise ArmidError(f"the Dask cluster at {self.address} has gone: start again to go on") from error

    def _submit(self, runs: tuple[ClaimedRun, ...], losses: int) -> None:
        future = self._client.submit(perform_batch, runs, self.setup, pure=False)
        self._batches[future] = (runs, losses)
        future.add_done_callback(self._ended.put)

    def _finished(self, future: Any) -> list[Outcome]:
        runs, losses = self._batches.pop(future)
        if future.status == "finished":
            outcomes: list[Outcome] = future.result()
            return outcomes
        error = future.exception() if future.status == "error" else None
        if error is not None and not isinstance(error, self._killed):
            raise ArmidError(f"a worker of the Dask cluster fails: {error}") from error
        if losses >= MOST_LOSSES:
            raise ArmidError(f"the Dask cluster at {self.address} has lost {losses} workers over the same runs")
        self._submit(runs, losses + 1)
        return []


def _connected(address: str) -> tuple[Any, Any]:
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise ArmidError("a Dask cluster needs the package distributed: pip install 'armid[cluster]'") from error
    # a lost connection ends in one sentence; each task of the library would log a traceback first
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        client.wait_for_workers(1, timeout=CONNECT_S)
    except (OSError, TimeoutError, ValueError) as error:
        raise ArmidError(f"the Dask cluster at {address} does not answer, tcp://HOST:PORT of a scheduler with a worker "
                         "is expected") from error  # fmt: skip
    return client, distributed.KilledWorker
