"""Beyond its output a simulation needs next to no memory, however large the population."""

import tracemalloc

import numpy as np
import pytest
from arm_cases import drawn

from armid.engine import simulate
from armid.model import Manoeuvre, Model

KILOBYTE = 1024


def peak_beyond_output(arm: Model, n_candidates: int, n_samples: int, threads: int = 1) -> int:
    """Bytes that Python holds at the peak, less those of the output."""
    population = drawn(arm, n_candidates, 1)
    tracemalloc.start()
    try:
        found = simulate(arm, Manoeuvre(0.001, n_samples), population, threads=threads)
        return tracemalloc.get_traced_memory()[1] - found.output.nbytes
    finally:
        tracemalloc.stop()


def resident() -> int:
    """Largest resident size of this process so far, in bytes."""
    resource = pytest.importorskip("resource", reason="this system does not tell the resident size")
    return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * KILOBYTE


def test_memory_is_flat_beyond_the_output(arm: Model) -> None:
    simulate(arm, Manoeuvre(0.001, 9), drawn(arm, 1, 1))
    small, large = peak_beyond_output(arm, 80, 300), peak_beyond_output(arm, 1280, 2000)
    # The population itself is kept once more, lane by lane: 1280 x 4 x 8 bytes and their order.
    assert large - small <= 300 * KILOBYTE
    assert 50 * large < 1280 * 2000 * 8


def test_memory_is_flat_inside_the_compiled_loop(arm: Model) -> None:
    """What tracemalloc cannot see: the compiled loop's own arrays."""
    output = np.zeros((1280, 2000))
    del output
    simulate(arm, Manoeuvre(0.001, 2000), drawn(arm, 1280, 1))
    before = resident()
    found = simulate(arm, Manoeuvre(0.001, 2000), drawn(arm, 1280, 2))
    grown = resident() - before
    assert grown <= found.output.nbytes + 4 * KILOBYTE**2
