"""How fast, how right and how large: the engine and the framework against their baselines."""

from armid.bench.bench import run_bench
from armid.bench.row import Bound, Row
from armid.bench.table import bench_table

__all__ = ["Bound", "Row", "bench_table", "run_bench"]
