"""Identification of a long record and of many records: that it works, and its peak memory in a process of its own."""

import subprocess
import sys
import tempfile
from pathlib import Path

from armid.bench.memory import MEGABYTE
from armid.bench.row import Row
from armid.bench.sample import child_environment, write_sample
from armid.bench.task import N_SAMPLES
from armid.errors import ArmidError

POPULATION, BUDGET = 80, 160
# What the command takes, told by the process that ran it: -1 where the system does not tell.
CHILD = """
from armid.cli.main import main
from armid.bench.memory import peak_memory
try:
    main(["identify", {folder!r}, "--budget", "{budget}"])
except SystemExit as end:
    if end.code:
        raise
print(peak_memory() or -1)
"""


def peak_apart(folder: Path) -> int:
    """Identify a campaign as the command does, and return the peak memory of its process [byte], -1 if not known.

    Raises ArmidError when it fails.
    """
    command = [sys.executable, "-c", CHILD.format(folder=str(folder), budget=BUDGET)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=child_environment())
    if done.returncode:
        raise ArmidError(f"the identification of a large campaign failed: {done.stderr.strip().splitlines()[-1]}")
    return int(done.stdout.split()[-1])


def scale_rows(n_samples: int = 1_000_000, n_records: int = 500) -> list[Row]:
    """Measure the peak memory of `armid identify` on a long record, and on many records."""
    with tempfile.TemporaryDirectory(prefix="armid-") as place:
        long = peak_apart(write_sample(Path(place) / "long", n_samples))
        many = peak_apart(write_sample(Path(place) / "many", N_SAMPLES, n_records=n_records))
    return [
        scale_row(f"identify, {n_samples:,} samples", long, n_samples),
        scale_row(f"identify, {n_records:,} records", many, n_records * N_SAMPLES),
    ]


def scale_row(what: str, peak: int, n_values: int) -> Row:
    """Return the row of one peak [byte], beside what the signals of a population take."""
    if peak < 0:
        return Row(what, None, "MB", note="this system does not tell the peak memory of a process")
    signals = POPULATION * n_values * 8
    note = f"peak of the whole process, {BUDGET} simulations in populations of {POPULATION}"
    return Row(what, peak / MEGABYTE, "MB", "a population's signals", peak / signals, note=note)
