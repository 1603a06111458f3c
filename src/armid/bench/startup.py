"""The second start of the program, which compiles nothing, against the import of what it stands on."""

import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

from armid.bench.row import Bound, Row
from armid.bench.sample import child_environment, write_sample
from armid.bench.timing import WALL, fastest
from armid.engine import cache_folder
from armid.errors import ArmidError

ARMID = (sys.executable, "-m", "armid")
IMPORTS = (sys.executable, "-c", "import numpy, scipy, pandas")


def run_apart(command: Sequence[str]) -> None:
    """Run a command to its end.

    Raises ArmidError with the last thing it said when it fails.
    """
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=child_environment())
    if done.returncode:
        said = done.stderr.strip().splitlines() or ["nothing"]
        raise ArmidError(f"`{' '.join(command)}` failed and said: {said[-1]}")


def compiled_files() -> set[tuple[str, int]]:
    """Return the files of the cache with the time of their last change."""
    return {(str(f), f.stat().st_mtime_ns) for f in cache_folder().rglob("*") if f.is_file()}


def startup_row(rounds: int = 8, command: Sequence[str] = ARMID, n_samples: int = 701) -> Row:
    """Measure `armid simulate` on a warm cache, by the clock on the wall.

    command: how to call armid; `simulate CAMPAIGN --out DIR` is added.
    """
    with TemporaryDirectory(prefix="armid-bench-") as folder:
        campaign = write_sample(Path(folder) / "campaign", n_samples)
        numbers = count()

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
