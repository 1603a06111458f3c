"""Worker processes on this machine that perform runs, each answered for by itself.

A run that takes too long is stopped, and a worker that dies is replaced; both lose no other run. joblib and
concurrent.futures cannot stop the one run that hangs, and when a worker dies fail with all that was under way.
"""

import os
import pickle
import signal
import struct
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path

from armid.errors import ArmidError
from armid.study.outcome import FAILED, ClaimedRun, Outcome
from armid.study.worker import FINISHED, READY, REFUSED

# Runs that a worker has before it: while it performs one, the next lies ready.
AHEAD = 2
# How often a run may take its worker with it: the first time it may have been someone else's kill.
MOST_DEATHS = 2
# How often a worker that ends before it is ready is started again: it may have been someone's kill.
MOST_STARTS = 3
# A process that does not even start within this time [s] never will.
START_S = 300.0
# Short runs are fetched from the store as many at a time as take about this long [s], but no more than so many.
BATCH_S, LARGEST_BATCH = 0.5, 64
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


LENGTH, LONGEST_MESSAGE = struct.Struct("!i"), 1 << 28


class GarbledError(OSError):
    """Tell that a worker's pipe holds what no worker writes."""

    def __str__(self) -> str:
        return "what came from the worker process is no message of ours: something in the run writes into its pipe"


@dataclass(frozen=True)
class WorkerSetup:
    """Hold what a worker is told at its start, and how long a run may take [s]."""

    kind: str
    plugins: tuple[str, ...]
    folder: Path
    time_limit: float


def performed_apart(setup: WorkerSetup, run: ClaimedRun) -> Outcome:
    worker = WorkerProcess(setup)
    try:
        return worker.perform([run])[0]
    finally:
        worker.stop()


class BatchSize:
    """Follow how long runs take lately, and tell how many of them take about as long as a batch should."""

    def __init__(self) -> None:
        self._seconds = BATCH_S

    def update(self, outcomes: Sequence[Outcome]) -> None:
        for outcome in outcomes:
            self._seconds += 0.2 * (outcome.seconds - self._seconds)

    @property
    def n_runs(self) -> int:
        return max(1, min(LARGEST_BATCH, int(BATCH_S / max(self._seconds, 1e-6))))


class LocalPool:
    """Perform runs in worker processes on this machine; given at any time, they come back one by one in any order."""

    def __init__(self, jobs: int, setup: WorkerSetup) -> None:
        self.workers = [WorkerProcess(setup) for _ in range(jobs)]
        self._waiting: deque[ClaimedRun] = deque()
        self._batch = BatchSize()

    @property
    def held(self) -> int:
        return len(self._waiting) + sum(worker.held for worker in self.workers)

    def wanted(self) -> int:
        enough = AHEAD * len(self.workers)
        return enough + self._batch.n_runs if self.held <= enough else 0

    def give(self, runs: Sequence[ClaimedRun]) -> None:
        self._waiting.extend(runs)
        self._hand_out()

    def wait(self, seconds: float) -> list[Outcome]:
        """Return what is finished, at the latest after so many seconds."""
        busy = [worker for worker in self.workers if worker.held]
        connections = [worker.connection for worker in busy]
        wait(connections, max(0.0, min([seconds, *(worker.seconds_left() for worker in busy)])))
        outcomes = [outcome for worker in busy for outcome in worker.finished()]
        self._batch.update(outcomes)
        self._hand_out()
        return outcomes

    def close(self) -> None:
        """End at once; what is not finished is lost."""
        for worker in self.workers:
            worker.stop()

    def _hand_out(self) -> None:
        for n in range(AHEAD):
            for worker in self.workers:
                if self._waiting and worker.held <= n:
                    worker.give([self._waiting.popleft()])


class WorkerProcess:
    """Hand runs to a worker process, one after the other; start it anew when it dies or a run takes too long.

    Such a run is an outcome too: it has failed. Raises ArmidError when the worker cannot be started.
    """

    def __init__(self, setup: WorkerSetup, clock: Callable[[], float] = time.monotonic) -> None:
        self.setup, self._clock = setup, clock
        self.waiting: deque[ClaimedRun] = deque()
        self._sent: deque[ClaimedRun] = deque()
        self._deaths: dict[str, int] = {}
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._ready, self._since = False, 0.0
        self._inbox, self._unready = bytearray(), 0

    @property
    def held(self) -> int:
        return len(self.waiting) + len(self._sent)

    @property
    def connection(self) -> Connection:
        """The end of the pipe on which the worker is heard, a worker being started where there is none."""
        if self._connection is None:
            self._connection = self._start()
        return self._connection

    def give(self, runs: list[ClaimedRun]) -> None:
        self.waiting.extend(runs)
        self._send()

    def seconds_left(self) -> float:
        limit = self.setup.time_limit if self._ready else START_S
        return self._since + limit - self._clock() if self._sent or not self._ready else limit

    def finished(self) -> list[Outcome]:
        """Return what the worker has finished, without waiting; a dead worker or one that hangs is dealt with."""
        outcomes: list[Outcome] = []
        try:
            for word, content in self._messages():
                outcomes += self._take(word, content)
        except (EOFError, OSError) as error:
            return outcomes + self._after_death(str(error) if isinstance(error, GarbledError) else "")
        if self.held and self.seconds_left() <= 0.0:
            started = self._ready
            self.stop()
            if not started:
                raise ArmidError(f"a worker process cannot start: it was not ready within {START_S:g} s")
            outcomes += self._failed(f"stopped at the time limit of {self.setup.time_limit:g} s")
        return outcomes

    def perform(self, runs: list[ClaimedRun]) -> list[Outcome]:
        self.give(runs)
        outcomes: list[Outcome] = []
        while self.held:
            self.connection.poll(max(0.0, min(self.seconds_left(), 1.0)))
            outcomes += self.finished()
        return outcomes

    def stop(self) -> None:
        """End the worker at once; what it was at is lost."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        if self._connection is not None:
            self._connection.close()
        self._process, self._connection, self._ready = None, None, False
        self._inbox.clear()

    def _start(self) -> Connection:
        ours, theirs = Pipe()
        command = [sys.executable, "-P", "-m", "armid.study.worker", str(theirs.fileno()), str(os.getpid())]
        nothing = subprocess.DEVNULL
        with theirs, sigint_blocked():
            # a session of its own: Ctrl-C reaches the process that decides, and no worker
            self._process = subprocess.Popen(
                command, stdin=nothing, stdout=nothing, stderr=nothing, pass_fds=(theirs.fileno(),),
                start_new_session=True, env=os.environ | dict.fromkeys(THREADS, "1"),
            )  # fmt: skip
        self._ready, self._since = False, self._clock()
        # one that has died already is found by `finished`
        with suppress(OSError):
            ours.send((self.setup.kind, self.setup.plugins, str(self.setup.folder)))
        return ours

    def _messages(self) -> Iterator[tuple[str, object]]:
        """Yield what has come as a whole; a part of a message waits for the rest, so that nothing is waited for here.

        A message is its length in four bytes, as `Connection.send` writes it, and a pickled pair of word and content.
        Raises EOFError when the worker has closed its end, GarbledError for what is no message.
        """
        while self.connection.poll():
            part = os.read(self.connection.fileno(), 1 << 16)
            if not part:
                raise EOFError
            self._inbox += part
        while len(self._inbox) >= LENGTH.size:
            (length,) = LENGTH.unpack(self._inbox[: LENGTH.size])
            if not 0 < length <= LONGEST_MESSAGE:
                raise GarbledError
            if len(self._inbox) < LENGTH.size + length:
                return
            content = bytes(self._inbox[LENGTH.size : LENGTH.size + length])
            del self._inbox[: LENGTH.size + length]
            try:
                word, found = pickle.loads(content)
            except Exception as error:
                raise GarbledError from error
            yield word, found

    def _take(self, word: str, content: object) -> list[Outcome]:
        self._since = self._clock()
        outcomes: list[Outcome] = []
        if word == FINISHED:
            if not (isinstance(content, Outcome) and self._sent and content.run == self._sent[0].run):
                raise GarbledError
            self._sent.popleft()
            outcomes.append(content)
        elif word == READY:
            self._ready, self._unready = True, 0
        elif word == REFUSED:
            raise ArmidError(str(content))
        else:
            raise GarbledError
        self._send()
        return outcomes

    def _send(self) -> None:
        """Keep the worker supplied; no more than it can hold unread, so that neither side ever waits for the other."""
        with suppress(OSError):
            while self.waiting and self._ready and len(self._sent) < AHEAD:
                if not self._sent:
                    self._since = self._clock()
                self.connection.send(self.waiting[0])
                self._sent.append(self.waiting.popleft())

    def _after_death(self, cause: str) -> list[Outcome]:
        """Start anew; a run that has taken two workers with it has failed. cause: "" for how the process ended."""
        assert self._process is not None
        started = self._ready
        if cause:
            self._process.kill()
        cause = cause or f"the worker process ended {_cause(self._process.wait())}"
        self.stop()
        self._unready += not started
        if not started and self._unready < MOST_STARTS:
            return []
        if not started:
            raise ArmidError(f"a worker process cannot start: {cause.replace('the worker process ended', 'it ends')}")
        if not self._sent:
            return []
        run = self._sent[0].run
        self._deaths[run] = self._deaths.get(run, 0) + 1
        if self._deaths[run] < MOST_DEATHS:
            self._take_back()
            return []
        return self._failed(f"{cause}, {MOST_DEATHS} times")

    def _failed(self, error: str) -> list[Outcome]:
        run = self._sent.popleft().run
        self._take_back()
        return [Outcome(run, FAILED, error, seconds=max(0.0, self._clock() - self._since))]

    def _take_back(self) -> None:
        """Put runs that a lost worker had before it back to the front."""
        self.waiting.extendleft(reversed(self._sent))
        self._sent.clear()


@contextmanager
def sigint_blocked() -> Iterator[None]:
    """Let what is started meanwhile begin its life without SIGINT, until it ignores it by itself."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cause(code: int) -> str:
    if code >= 0:
        return f"with code {code}"
    try:
        return f"by {signal.Signals(-code).name}"
    except ValueError:
        return f"by signal {-code}"
