"""A search in a thread of its own: it ends with the run, with an error, when dropped, and at the interpreter's exit."""

import gc
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pymoo.core.problem import Problem
from pymoo.optimize import minimize
from searches import Bowl, identifier, ran

from armid.identifiers.search import Asker, in_thread

IN_THREADS = ("nelder_mead", "lbfgs", "least_squares", "multistart:bobyqa", "random+bobyqa")


def ours() -> list[threading.Thread]:
    return [t for t in threading.enumerate() if t.name == "armid search"]


@pytest.fixture(autouse=True)
def _none_is_left() -> Any:
    assert ours() == []
    yield
    assert ours() == []


@pytest.mark.parametrize("name", IN_THREADS)
def test_none_is_left_after_a_run_that_the_budget_ends_or_that_is_dropped_in_the_middle(name: str) -> None:
    ran(name, Bowl(), 30)
    assert ours() == []
    algorithm = identifier(name).build(300).setup(Bowl(), seed=1, termination=("n_eval", 300))
    while not ours():
        algorithm.next()
    assert len(ours()) == 1
    del algorithm
    gc.collect()
    assert ours() == []


class Broken(Problem):  # type: ignore[misc]
    def __init__(self, error: BaseException, after: int) -> None:
        self.bowl, self.error, self.left = Bowl(), error, after
        super().__init__(n_var=3, n_obj=1, xl=self.bowl.xl, xu=self.bowl.xu)

    def _evaluate(self, X: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        self.left -= 1
        if self.left < 0:
            raise self.error
        self.bowl._evaluate(X, out)


@pytest.mark.parametrize("name", IN_THREADS)
def test_an_error_of_the_problem_comes_out(name: str) -> None:
    for error, after in ((ZeroDivisionError("mine"), 0), (ZeroDivisionError("mine"), 5), (KeyboardInterrupt(), 5)):
        algorithm = identifier(name).build(300)
        with pytest.raises(type(error)) as came:
            minimize(Broken(error, after), algorithm, ("n_eval", 300), seed=1, copy_algorithm=False)
        assert came.value is error
        assert ours() == []


def failing(routine_error: BaseException) -> Callable[[Asker], bool]:
    def routine(ask: Asker) -> bool:
        ask(np.zeros((1, 2)))
        raise routine_error

    return routine


@pytest.mark.parametrize("error", [ValueError("of the routine"), SystemExit(3)])
def test_an_error_of_the_routine_comes_out(error: BaseException) -> None:
    from armid.identifiers.search import Told

    search = in_thread(failing(error))
    assert next(search).X.shape == (1, 2)
    with pytest.raises(type(error)) as came:
        search.send(Told(np.zeros(1)))
    assert came.value is error


HEAD = """
import signal, sys, threading, time
sys.path.insert(0, {folder!r})
from searches import Bowl, identifier
from pymoo.optimize import minimize
algorithm = identifier('multistart:bobyqa').build(10**9).setup(Bowl(), seed=1, termination=("n_eval", 10**9))
for _ in range(20):
    algorithm.next()
"""
# The interpreter exits while the algorithm is alive; Ctrl-C comes while the main thread waits for the search.
EXITS = {
    "exit": ("print('out')", "out", 0),
    "exit in a cycle": ("algorithm.me = algorithm; del algorithm; print('out')", "out", 0),
    "error": ("raise RuntimeError('mine')", "", 1),
    "ctrl-c": ("""
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Timer(0.3, lambda: signal.raise_signal(signal.SIGINT)).start()
try:
    while True:
        algorithm.next()
except KeyboardInterrupt:
    # it may have come while a thread was waited for
    for thread in [t for t in threading.enumerate() if t.name == 'armid search']:
        thread.join(10.0)
    print(sum(t.name == 'armid search' for t in threading.enumerate()), 'left')
""", "0 left", 0),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("way", EXITS)
def test_nothing_hangs_at_the_end_of_the_interpreter(way: str, request: pytest.FixtureRequest) -> None:
    tail, out, code = EXITS[way]
    script = HEAD.format(folder=str(request.path.parent)) + tail
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=100, check=False)
    assert (done.returncode, done.stdout.strip()) == (code, out), done.stderr
    assert "Fatal" not in done.stderr
