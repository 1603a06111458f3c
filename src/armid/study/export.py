"""Export stored results: traces as IOHprofiler files, and the reports of closed loops.

iohinspector and IOHanalyzer load the traces. One algorithm is an identifier, with its fitness where it ran on several.
One function is a case under one noise, window and fitness, since each of these is another landscape; its dimension is
the number of free parameters. A run's instance is its seed, and so its noise. All are minimised. A run starts
at evaluation 1 and its last one is logged; where the first simulations failed, evaluation 1 carries WORST. Failed runs
have no trace and are left out.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.report.document import slug, unlike
from armid.study.analyses.analysis import outcomes, unit_of
from armid.study.results import StudyResults
from armid.study.store import RunTrace

FORMAT_VERSION, SUITE = "0.3.5", "armid"
# No fitness yet, as a number that every program reads.
WORST_VALUE = 1e300
# What iohinspector keeps of an instance: 16 bits.
LARGEST_INSTANCE = 65_535


def export_ioh(results: StudyResults, path_of: Callable[[str], Path]) -> int:
    """Write one .json and one .dat for each algorithm and function; return how many runs they hold."""
    runs = outcomes(results.runs, results.parameters, unit_of(results.study))
    runs["function"] = runs["case"] + ", " + runs["setting"] + ", " + runs["fitness"]
    ids = {name: i for i, name in enumerate(dict.fromkeys(runs["function"]), 1)}
    variants = list(dict.fromkeys(runs["variant"]))
    folders = dict(zip(variants, unlike([slug(v) or "identifier" for v in variants]), strict=True))
    instances = instance_numbers(runs)
    rows = {row.run: row for row in runs.itertuples()}
    pairs: dict[tuple[str, str], tuple[dict[str, Any], Path]] = {}
    for trace in results.iter_traces():
        row: Any = rows.get(trace.run)
        if row is None or not trace.evaluations.size:
            continue
        key = folders[row.variant], row.function
        if key not in pairs:
            pair = _description(row, ids[row.function], trace.names)
            pairs[key] = pair, path_of(f"{key[0]}/{pair['scenarios'][0]['path']}")
            pairs[key][1].write_text("", encoding="ascii")
        pair, file = pairs[key]
        used = max(int(row.used), int(trace.evaluations[-1]))
        with file.open("a", encoding="ascii") as data:
            data.write(" ".join(pair["attributes"]) + "\n")
            data.writelines(lines(trace, used))
        best = {"evals": int(trace.evaluations[-1]), "y": float(trace.values[-1]), "x": [float(x) for x in trace.X[-1]]}
        pair["scenarios"][0]["runs"].append({"instance": instances[row.seed], "evals": used, "best": best})
    for (folder, _), (pair, _) in pairs.items():
        text = json.dumps(pair, indent=1) + "\n"
        path_of(f"{folder}/IOHprofiler_f{pair['function_id']}.json").write_text(text, encoding="utf-8")
    return sum(len(pair["scenarios"][0]["runs"]) for pair, _ in pairs.values())


def _description(row: Any, function_id: int, names: tuple[str, ...]) -> dict[str, Any]:
    """Return what the .json says of one algorithm on one function, still without runs.

    Attributes are numbers only: iohinspector evaluates their text as Python, and names come out of the user's file.
    """
    attributes = [{"budget": f"{int(row.budget)}"}]
    if np.isfinite(row.noise_deg_s):
        attributes.append({"noise_deg_s": repr(float(row.noise_deg_s))})
    data = f"data_f{function_id}/IOHprofiler_f{function_id}_DIM{len(names)}.dat"
    return {
        "version": FORMAT_VERSION,
        "suite": SUITE,
        "function_id": function_id,
        "function_name": row.function,
        "maximization": False,
        "algorithm": {"name": row.variant, "info": f"parameters x0, x1, ... are {', '.join(names)} in SI"},
        "experiment_attributes": attributes,
        "attributes": ["evaluations", "raw_y", *(f"x{i}" for i in range(len(names)))],
        "scenarios": [{"dimension": len(names), "path": data, "runs": []}],
    }


def instance_numbers(runs: DataFrame) -> dict[int, int]:
    """Return seed -> instance: the seed itself, or its place among the seeds where one is too large."""
    seeds = sorted({int(s) for s in runs["seed"]})
    fits = not seeds or seeds[-1] <= LARGEST_INSTANCE
    return {seed: seed if fits else i for i, seed in enumerate(seeds, 1)}


def lines(trace: RunTrace, used: int) -> Iterator[str]:
    def line(evaluation: int, value: float, x: np.ndarray) -> str:
        return " ".join([str(evaluation), repr(value), *(repr(float(v)) for v in x)]) + "\n"

    if trace.evaluations[0] > 1:
        yield line(1, WORST_VALUE, np.full(trace.X.shape[1], np.nan))
    for evaluation, value, x in zip(trace.evaluations, trace.values, trace.X, strict=True):
        yield line(int(evaluation), float(value), x)
    if trace.evaluations[-1] < used:
        yield line(used, float(trace.values[-1]), trace.X[-1])


def export_reports(results: StudyResults, path_of: Callable[[str], Path]) -> int:
    """Write CAMPAIGN/report.json for each campaign that was closed, as `armid close-loop` does; return how many."""
    loops = results.loops
    for case, report in zip(loops["case"], loops["report"], strict=True):
        text = json.dumps(report, indent=2, allow_nan=False) + "\n"
        path_of(f"{case}/report.json").write_text(text, encoding="utf-8")
    return len(loops)
