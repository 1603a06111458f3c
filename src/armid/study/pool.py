"""Who performs the runs of a study: worker processes on this machine, each run with a time limit, or a Dask cluster.

A run that takes too long is stopped, and a worker that dies is replaced; both lose no other run. A worker is a program
of its own, `python -m armid.study.pool FILE_DESCRIPTOR PARENT`, and no child of multiprocessing: a script needs no main
guard, and workers of Dask may have workers.
"""

import logging
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Lock
from typing import Any

from armid.errors import INTERRUPTED, ArmidError
from armid.study.cases import RunCache
from armid.study.spec import study_registry
from armid.study.store import FAILED, MissingRun, Outcome
from armid.study.tasks import perform, task_type

# How often a run may take its worker with it: the first time it may have been someone else's kill.
MOST_DEATHS = 2
# How often a worker that ends before it is ready is started again: it may have been someone's kill.
MOST_STARTS = 3
# A process that does not even start within this time [s] never will.
START_S = 300.0
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
READY, REFUSED, FINISHED, LATE, DIED = "ready", "refused", "finished", "late", "died"
NO_MESSAGE = "sent what is not a message of ours: something in the run writes into its pipe"


@dataclass(frozen=True)
class WorkerSetup:
    """Hold what a worker gets at its start, and how long a run may take [s]."""

    kind: str
    plugins: tuple[str, ...]
    folder: Path
    time_limit: float


class Worker:
    """Hold a process that performs runs, one after the other; it is started when the first one comes."""

    def __init__(self, setup: WorkerSetup) -> None:
        self.setup = setup
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._lock, self._is_stopped = Lock(), False

    def perform(self, run: MissingRun) -> Outcome:
        """Return what a run gave; one that takes too long, or two workers with it, has failed.

        Raises ArmidError when no worker can be started or the machine is at fault, CancelledError when stopped.
        """
        for _ in range(MOST_DEATHS):
            if self._connection is None:
                self._start()
            began = time.monotonic()
            word, content = self._answer(run, self.setup.time_limit)
            if word == FINISHED and isinstance(content, Outcome) and content.run == run.run:
                return content
            self._end()
            if word == REFUSED:
                raise ArmidError(content)
            if word == LATE:
                error = f"stopped at the time limit of {self.setup.time_limit:g} s"
                break
            error = f"the worker process {content if word == DIED else NO_MESSAGE}, {MOST_DEATHS} times"
        return Outcome(run.run, FAILED, error, seconds=time.monotonic() - began)

    def close(self) -> None:
        """End the worker at once and for good; what it was at is lost."""
        with self._lock:
            self._is_stopped = True
            if self._process is not None:
                self._process.kill()
                self._process.wait()

    def _start(self) -> None:
        for _ in range(MOST_STARTS):
            ours, theirs = Pipe()
            command = [sys.executable, "-P", "-m", "armid.study.pool", str(theirs.fileno()), str(os.getpid())]
            nothing = subprocess.DEVNULL
            with self._lock, theirs, sigint_blocked():
                if self._is_stopped:
                    raise CancelledError
                # a session of its own: Ctrl-C reaches the process that decides, and no worker
                self._process = subprocess.Popen(
                    command, stdin=nothing, stdout=nothing, stderr=nothing, pass_fds=(theirs.fileno(),),
                    start_new_session=True, env=os.environ | dict.fromkeys(THREADS, "1"),
                )  # fmt: skip
            self._connection = ours
            word, content = self._answer((self.setup.kind, self.setup.plugins, str(self.setup.folder)), START_S)
            if word == READY:
                return
            self._end()
            if word == REFUSED:
                raise ArmidError(content)
        cause = f"was not ready within {START_S:g} s" if word == LATE else content
        raise ArmidError(f"a worker process cannot start: it {cause}")

    def _answer(self, message: Any, seconds: float) -> tuple[str, Any]:
        """Return word and content of the worker's answer to a message, LATE after so many seconds without one."""
        assert self._process is not None
        assert self._connection is not None
        try:
            self._connection.send(message)
            if not self._connection.poll(seconds):
                return LATE, ""
            word, content = self._connection.recv()
            return word, content
        except (EOFError, OSError):
            code = self._process.wait()
            return DIED, f"ended with code {code}" if code >= 0 else f"ended by {signal.Signals(-code).name}"
        except Exception:
            # the bytes are not a pickle, or the object is not a word and its content
            return DIED, NO_MESSAGE

    def _end(self) -> None:
        assert self._process is not None
        assert self._connection is not None
        self._process.kill()
        self._process.wait()
        self._connection.close()
        self._connection = None


def performed_apart(setup: WorkerSetup, run: MissingRun) -> Outcome:
    """Perform one run in a process of its own."""
    with closing(Worker(setup)) as worker:
        return worker.perform(run)


# The worker of a thread, here and on a cluster.
OF_THREAD = threading.local()


class LocalPool:
    """Perform runs in worker processes on this machine, each with a thread that waits for it; width: how many."""

    def __init__(self, jobs: int, setup: WorkerSetup) -> None:
        self.width = jobs
        self._workers = [Worker(setup) for _ in range(jobs)]
        unclaimed = iter(self._workers)
        self._threads = ThreadPoolExecutor(jobs, initializer=lambda: setattr(OF_THREAD, "worker", next(unclaimed)))

    def submit(self, run: MissingRun) -> Future[Outcome]:
        """Perform a run as soon as a worker is idle."""
        return self._threads.submit(lambda: OF_THREAD.worker.perform(run))

    def close(self) -> None:
        """End at once; what is not finished is lost."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.close()
        self._threads.shutdown()


@contextmanager
def sigint_blocked() -> Iterator[None]:
    """Let what is started meanwhile begin its life without SIGINT, until it ignores it by itself."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# Time in which a cluster has to answer [s].
CONNECT_S = 20.0


def perform_on_cluster(run: MissingRun, setup: WorkerSetup) -> Outcome:
    """Perform a run on a worker of the cluster, in a process of its own that can be stopped."""
    worker = getattr(OF_THREAD, "worker", None)
    if worker is None or worker.setup != setup:
        if worker is not None:
            worker.close()
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


# How often a worker looks whether the process that it works for still lives [s].
LOOKS_EVERY_S = 1.0


def main(descriptor: int, parent: int) -> None:
    """Be a worker: receive kind, plug-ins and folder, then perform runs one by one until the other end is closed."""
    # Ctrl-C and its like are for the process that decides: a run is made whole, or not at all
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    connection = Connection(descriptor)
    try:
        kind, plugins, folder = connection.recv()
        # what runs need is imported before the first: where that fails no worker starts, and no run is to blame
        task_type(kind)
        cache = RunCache(study_registry(plugins), Path(folder))
        connection.send((READY, None))
        while True:
            connection.send((FINISHED, perform(connection.recv(), cache)))
    except ArmidError as error:
        # plug-ins that cannot be read, or the machine is at fault: what else a run raises is its outcome
        connection.send((REFUSED, str(error)))
    except KeyboardInterrupt:
        os._exit(INTERRUPTED)
    except (EOFError, OSError):
        # the process that we work for has closed its end, or has ended
        os._exit(0)


def _end_with(parent: int) -> None:
    """End this process soon after the one that it works for has ended, also in the middle of a run."""
    while os.getppid() == parent:
        time.sleep(LOOKS_EVERY_S)
    os._exit(1)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
