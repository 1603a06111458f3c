"""Export the traces of a study as IOHprofiler files, which iohinspector and IOHanalyzer load.

One algorithm is an identifier, with its fitness where it ran on several. One function is a case under one noise, window
and fitness, since each of these is another landscape; its dimension is the number of free parameters. A run's instance
is its seed, which stands for its noise. All are minimised. A run starts at evaluation 1 and its last one is logged;
where the first simulations failed, evaluation 1 carries WORST. Failed runs have no trace and are left out.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.report.document import slug, unlike
from armid.study.analyses.analysis import outcomes
from armid.study.outcome import RunTrace
from armid.study.results import StudyResults

VERSION, SUITE = "0.3.5", "armid"
# No fitness yet, as a number that every program reads.
WORST = 1e300
# What iohinspector keeps of an instance: 16 bits.
LARGEST_INSTANCE = 65_535


@dataclass(frozen=True)
class Pair:
    """Collect the runs of one algorithm on one function.

    file: of the traces; names: of the free parameters; runs: what the description says of each.
    """

    algorithm: str
    function_id: int
    function: str
    folder: str
    names: tuple[str, ...]
    file: Path
    attributes: dict[str, str]
    runs: list[dict[str, Any]] = field(default_factory=list)


def export_ioh(results: StudyResults, path_of: Callable[[str], Path]) -> int:
    """Write one .json and one .dat for each algorithm and function; return how many runs they hold.

    path_of: file name -> where to write it. No more than one trace is in memory.
    """
    found = outcomes(results.runs, results.parameters)
    found["function"] = found["case"] + ", " + found["setting"] + ", " + found["fitness"]
    ids = {name: i for i, name in enumerate(dict.fromkeys(found["function"]), 1)}
    variants = list(dict.fromkeys(found["variant"]))
    folders = dict(zip(variants, unlike([slug(v) or "identifier" for v in variants]), strict=True))
    instances = instance_numbers(found)
    rows = {row.run: row for row in found.itertuples()}
    pairs: dict[tuple[str, str], Pair] = {}
    for trace in results.iter_traces():
        row: Any = rows.get(trace.run)
        if row is None or not trace.evaluations.size:
            continue
        key = row.variant, row.function
        if key not in pairs:
            pairs[key] = new_pair(row, ids[row.function], folders[row.variant], trace.names, path_of)
        append(pairs[key], trace, instances[row.seed], max(int(row.used), int(trace.evaluations[-1])))
    for pair in pairs.values():
        name = f"{pair.folder}/IOHprofiler_f{pair.function_id}.json"
        path_of(name).write_text(json.dumps(description(pair), indent=1) + "\n", encoding="utf-8")
    return sum(len(pair.runs) for pair in pairs.values())


def instance_numbers(found: DataFrame) -> dict[int, int]:
    """Return seed -> instance: the seed itself, or its place among the seeds where one is too large."""
    seeds = sorted({int(s) for s in found["seed"]})
    fits = not seeds or seeds[-1] <= LARGEST_INSTANCE
    return {seed: seed if fits else i for i, seed in enumerate(seeds, 1)}


def new_pair(row: Any, function_id: int, folder: str, names: tuple[str, ...], path_of: Callable[[str], Path]) -> Pair:
    """Return a pair without runs, its file of traces empty.

    Attributes are numbers only: iohinspector evaluates their text as Python, and names come out of the user's file.
    """
    file = path_of(f"{folder}/{data_file(function_id, len(names))}")
    file.write_text("", encoding="ascii")
    attributes = {"budget": f"{int(row.budget)}"}
    if np.isfinite(row.noise_deg_s):
        attributes["noise_deg_s"] = repr(float(row.noise_deg_s))
    return Pair(row.variant, function_id, row.function, folder, names, file, attributes)


def data_file(function_id: int, dimension: int) -> str:
    """Return the name of the file of traces, seen from the description."""
    return f"data_f{function_id}/IOHprofiler_f{function_id}_DIM{dimension}.dat"


def append(pair: Pair, trace: RunTrace, instance: int, used: int) -> None:
    """Append a run to the file of traces and to the description."""
    with pair.file.open("a", encoding="ascii") as file:
        file.write(" ".join(["evaluations", "raw_y", *(f"x{i}" for i in range(len(pair.names)))]) + "\n")
        file.writelines(lines(trace, used))
    best = {"evals": int(trace.evaluations[-1]), "y": float(trace.values[-1]), "x": [float(x) for x in trace.X[-1]]}
    pair.runs.append({"instance": instance, "evals": used, "best": best})


def lines(trace: RunTrace, used: int) -> Iterator[str]:
    """Yield the improvements of a run as text, from evaluation 1 to the last one."""
    if trace.evaluations[0] > 1:
        yield line(1, WORST, np.full(trace.X.shape[1], np.nan))
    for evaluation, value, x in zip(trace.evaluations, trace.values, trace.X, strict=True):
        yield line(int(evaluation), float(value), x)
    if trace.evaluations[-1] < used:
        yield line(used, float(trace.values[-1]), trace.X[-1])


def line(evaluation: int, value: float, x: np.ndarray) -> str:
    """Return one line of numbers, every digit kept."""
    return " ".join([str(evaluation), repr(value), *(repr(float(v)) for v in x)]) + "\n"


def description(pair: Pair) -> dict[str, Any]:
    """Return what the .json says of a pair."""
    return {
        "version": VERSION,
        "suite": SUITE,
        "function_id": pair.function_id,
        "function_name": pair.function,
        "maximization": False,
        "algorithm": {"name": pair.algorithm, "info": f"parameters x0, x1, ... are {', '.join(pair.names)} in SI"},
        "experiment_attributes": [{name: value} for name, value in pair.attributes.items()],
        "attributes": ["evaluations", "raw_y", *(f"x{i}" for i in range(len(pair.names)))],
        "scenarios": [{
            "dimension": len(pair.names), "path": data_file(pair.function_id, len(pair.names)), "runs": pair.runs,
        }],
    }  # fmt: skip


FILE_NAME = "report.json"


def export_reports(results: StudyResults, path_of: Callable[[str], Path]) -> int:
    """Write CAMPAIGN/report.json for each campaign that was closed, as `armid close-loop` does; return how many.

    path_of: file name -> where to write it.
    """
    loops = results.loops
    for case, report in zip(loops["case"], loops["report"], strict=True):
        text = json.dumps(report, indent=2, allow_nan=False) + "\n"
        path_of(f"{case}/{FILE_NAME}").write_text(text, encoding="utf-8")
    return len(loops)
