"""What is measured in processes of their own: memory, large campaigns, and the second start of the program."""

import re
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from armid.engine import cache_folder, simulate
from armid.errors import ArmidError
from bench.measure import WALL, Bound, Row, fastest
from bench.samples import N_SAMPLES, arm_task, child_environment, write_sample

MEGABYTE = 2**20
# The allocator of glibc then gives back what is freed at once; else that would hide what is taken next.
PLAIN_ALLOCATOR = {"MALLOC_MMAP_THRESHOLD_": "65536", "MALLOC_TRIM_THRESHOLD_": "65536"}
UNKNOWN = "this system does not tell the peak memory of a process"
MEMORY_CHILD = "from bench.processes import beyond_output; print(beyond_output({}, {}))"


def run_apart(command: Sequence[str], failed: str = "", **environment: str) -> str:
    """Run a command to its end and return what it printed.

    Raises ArmidError with the last thing it said when it fails; failed: the words before that.
    """
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=child_environment() | environment)
    if done.returncode:
        said = done.stderr.strip().splitlines() or ["nothing"]
        words = failed or f"`{' '.join(command)}` failed and said:"
        raise ArmidError(f"{words} {said[-1]}")
    return done.stdout


def peak_memory() -> int | None:
    """Return the largest resident memory of this process so far [byte], None where the system does not tell."""
    status = Path("/proc/self/status")
    found = re.search(r"VmHWM:\s*(\d+) kB", status.read_text()) if status.exists() else None
    if found:
        return int(found[1]) * 1024
    try:
        import resource  # noqa: PLC0415 - not every system has it
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def forget_peak() -> None:
    """Let the peak start anew from what is resident now, where the system allows it (Linux)."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


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
    command = [sys.executable, "-c", MEMORY_CHILD.format(n_candidates, n_samples)]
    return int(run_apart(command, **PLAIN_ALLOCATOR))


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
        return Row(what, None, "MB", note=UNKNOWN)
    growth = 9 * 8 * n_values
    return Row(
        what, large / MEGABYTE, "MB", "the output's growth",
        max(large - small, 0) / growth, Bound(0.05, at_least=False),
        note=f"the peak is {small / MEGABYTE:.2f} MB, then {large / MEGABYTE:.2f} MB beyond the output array, which "
             f"grows by {growth / MEGABYTE:.0f} MB",
    )  # fmt: skip


POPULATION, BUDGET = 80, 160
# What the command takes, told by the process that ran it: -1 where the system does not tell.
IDENTIFY_CHILD = """
from armid.cli.main import main
from bench.processes import peak_memory
try:
    main(["identify", {folder!r}, "--budget", "{budget}"])
except SystemExit as end:
    if end.code:
        raise
print(peak_memory() or -1)
"""


def scale_rows(n_samples: int = 1_000_000, n_records: int = 500) -> list[Row]:
    """Measure the peak memory of `armid identify` on a long record, and on many records.

    Raises ArmidError when it fails.
    """
    sizes = {f"{n_samples:,} samples": (n_samples, 1), f"{n_records:,} records": (N_SAMPLES, n_records)}
    note, rows = f"peak of the whole process, {BUDGET} simulations in populations of {POPULATION}", []
    for what, (length, count_of) in sizes.items():
        with TemporaryDirectory(prefix="armid-") as place:
            campaign = write_sample(Path(place) / "campaign", length, n_records=count_of)
            command = [sys.executable, "-c", IDENTIFY_CHILD.format(folder=str(campaign), budget=BUDGET)]
            peak = int(run_apart(command, "the identification of a large campaign failed:").split()[-1])
        ratio = peak / (POPULATION * length * count_of * 8)
        known = Row(f"identify, {what}", peak / MEGABYTE, "MB", "a population's signals", ratio, note=note)
        rows.append(known if peak > 0 else Row(known.what, None, "MB", note=UNKNOWN))
    return rows


ARMID = (sys.executable, "-m", "armid")
IMPORTS = (sys.executable, "-c", "import numpy, scipy, pandas")


def startup_row(rounds: int = 8, command: Sequence[str] = ARMID, n_samples: int = 701) -> Row:
    """Measure `armid simulate` on a warm cache, by the clock on the wall.

    command: how to call armid; `simulate CAMPAIGN --out DIR` is added.
    """
    with TemporaryDirectory(prefix="armid-bench-") as folder:
        campaign = write_sample(Path(folder) / "campaign", n_samples)
        numbers = count()

        def compiled_files() -> set[tuple[str, int]]:
            return {(str(f), f.stat().st_mtime_ns) for f in cache_folder().rglob("*") if f.is_file()}

        def simulate_again() -> None:
            run_apart([*command, "simulate", str(campaign), "--out", f"{folder}/out{next(numbers)}"])

        simulate_again()
        before = compiled_files()
        best = fastest({"armid": simulate_again, "imports": partial(run_apart, IMPORTS)}, rounds, WALL, slot=0.0)
        compiled = len(compiled_files() - before)
    return Row(
        "second start: armid simulate", best["armid"], "s", "import numpy, scipy, pandas",
        best["armid"] / best["imports"], Bound(2.5, at_least=False),
        note=f"the imports take {best['imports']:.2f} s; the second start compiled "
             f"{f'{compiled} files' if compiled else 'nothing'}",
    )  # fmt: skip
