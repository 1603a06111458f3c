"""A Dask cluster that performs runs in place of own worker processes."""

import logging
import threading
from concurrent.futures import Future
from contextlib import suppress
from importlib import import_module
from typing import Any

from armid.errors import ArmidError
from armid.study.outcome import MissingRun, Outcome
from armid.study.workers.pool import Worker, WorkerSetup

CONNECT_S = 20.0
OF_THREAD = threading.local()


def perform_on_cluster(run: MissingRun, setup: WorkerSetup) -> Outcome:
    """Perform a run on a worker of the cluster, in a process of its own that can be stopped."""
    worker = getattr(OF_THREAD, "worker", None)
    if worker is None or worker.setup != setup:
        if worker is not None:
            worker.stop()
        worker = OF_THREAD.worker = Worker(setup)
    return worker.perform(run)


class DaskPool:
    """Perform runs on a Dask cluster, as `LocalPool` does on this machine; runs of a lost worker are made again."""

    def __init__(self, address: str, setup: WorkerSetup) -> None:
        self.setup, self.address = setup, address
        self._client = _connected(address)
        self._executor = self._client.get_executor(pure=False)

    @property
    def width(self) -> int:
        """How many runs are performed at a time; ArmidError when the cluster has gone."""
        try:
            if self._client.status != "running":
                raise ConnectionError
            return max(1, sum(map(int, self._client.nthreads().values())))
        except OSError as error:
            raise ArmidError(f"the Dask cluster at {self.address} has gone: start again to go on") from error

    def submit(self, run: MissingRun) -> "Future[Outcome]":
        """Perform a run as soon as a worker is idle."""
        future: Future[Outcome] = self._executor.submit(perform_on_cluster, run, self.setup)
        return future

    def close(self) -> None:
        """End at once; what is not finished is lost."""
        # a scheduler that has gone has nothing to cancel
        with suppress(OSError):
            self._executor.shutdown(wait=False)
        self._client.close()


def _connected(address: str) -> Any:
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
    return client
