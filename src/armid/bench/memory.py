"""Memory of the engine beyond its output array, each time in a process of its own."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np

from armid.bench.row import Bound, Row
from armid.bench.sample import child_environment
from armid.bench.task import arm_task
from armid.engine import simulate

MEGABYTE = 2**20
# The allocator of glibc then gives back what is freed at once; else that would hide what is taken next.
PLAIN_ALLOCATOR = {"MALLOC_MMAP_THRESHOLD_": "65536", "MALLOC_TRIM_THRESHOLD_": "65536"}
CHILD = "from armid.bench.memory import beyond_output; print(beyond_output({}, {}))"


def peak_memory() -> int | None:
    """Return the largest resident memory of this process so far [byte], None where the system does not tell."""
    status = Path("/proc/self/status")
    found = re.search(r"VmHWM:\s*(\d+) kB", status.read_text()) if status.exists() else None
    if found:
        return int(found[1]) * 1024
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def forget_peak() -> None:
    """Let the peak start anew from what is resident now, where the system allows it (Linux)."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def beyond_output(n_candidates: int, n_samples: int) -> int:
    """Return by how much one simulation raises the peak, less its output array [byte]; -1 where it cannot be told."""
    task = arm_task(n_candidates, n_samples)
    # What is made once, whatever the size, must not count.
    simulate(task.model, task.manoeuvre, task.population[:1], task.schedule)
    forget_peak()
    before = peak_memory()
    run = task.run()
    after = peak_memory()
    if before is None or after is None or not np.isfinite(run.output[0, 0]):
        return -1
    return max(after - before - run.output.nbytes, 0)


def measured_apart(n_candidates: int, n_samples: int) -> int:
    """Return `beyond_output` of a fresh process [byte]."""
    command = [sys.executable, "-c", CHILD.format(n_candidates, n_samples)]
    environment = child_environment() | PLAIN_ALLOCATOR
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return int(done.stdout)


def memory_rows(n_candidates: int = 800, n_samples: int = 701) -> list[Row]:
    """Measure how the memory beyond the output grows with ten times the candidates, and ten times the samples."""
    small = measured_apart(n_candidates, n_samples)
    return [
        grown(f"memory, population {n_candidates:,} to {10 * n_candidates:,}", small,
              measured_apart(10 * n_candidates, n_samples), n_candidates * n_samples),
        grown(f"memory, {n_samples:,} to {10 * n_samples:,} samples", small,
              measured_apart(n_candidates, 10 * n_samples), n_candidates * n_samples),
    ]  # fmt: skip


def grown(what: str, small: int, large: int, n_values: int) -> Row:
    """Return the row of two measurements [byte], of which the second has ten times the values in its output."""
    if small < 0 or large < 0:
        return Row(what, None, "MB", note="this system does not tell the peak memory of a process")
    growth = 9 * 8 * n_values
    return Row(
        what, large / MEGABYTE, "MB", "the output's growth",
        max(large - small, 0) / growth, Bound(0.05, at_least=False),
        note=f"the peak is {small / MEGABYTE:.2f} MB, then {large / MEGABYTE:.2f} MB beyond the output array, which "
             f"grows by {growth / MEGABYTE:.0f} MB",
    )  # fmt: skip
