"""Made-up results of studies, drawn by a seeded generator: they test statistics and layout, and claim nothing."""

from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from armid.study.store import RunTrace

UNITS = {"p0": "Pa", "k": "1", "eta3": "1", "n": "1"}
BOX = {"p0": (2.6e6, 3.5e6), "k": (0.6, 1.1), "eta3": (0.45, 0.70), "n": (0.9, 1.5)}
# Table I of the paper: truth and what it identified.
TRUE = {"p0": (3.20e6, 3.10e6, 3.00e6, 2.90e6, 2.80e6), "k": (1.00, 0.95, 0.90, 0.85, 0.80),
        "eta3": (0.62, 0.60, 0.58, 0.55, 0.50), "n": (1.00, 1.10, 1.20, 1.30, 1.40)}  # fmt: skip
FOUND = {"p0": (3.2114e6, 3.0887e6, 3.0321e6, 2.9096e6, 2.7912e6), "k": (1.0026, 0.9518, 0.8986, 0.8587, 0.8038),
         "eta3": (0.6213, 0.6011, 0.5786, 0.5511, 0.5001), "n": (1.0124, 1.0915, 1.2126, 1.3111, 1.4081)}  # fmt: skip


@dataclass
class MadeResults:
    """Results of a study that nobody ran."""

    runs: pd.DataFrame
    parameters: pd.DataFrame
    study: dict[str, Any]
    kept: list[RunTrace] = field(default_factory=list)

    def iter_traces(self):
        yield from self.kept

    def text_of(self, digest):
        return f"equations of {digest}"


PAPER_CASES = [
    {"name": f"row {i + 1}", "truth": {p: TRUE[p][i] for p in UNITS}, "published": {p: FOUND[p][i] for p in UNITS}}
    for i in range(5)
]
LOW, HIGH = np.array([BOX[p] for p in UNITS]).T


def one_trace(run, truth, end, used, rng):
    """Return improvements that start all over the box and end where the run ended."""
    evaluations = np.unique(np.concatenate(([1], rng.integers(2, used, 25), [used - 3]))).astype(np.int64)
    share = np.linspace(0.0, 1.0, evaluations.size) ** 0.3
    X = end + (rng.uniform(LOW, HIGH) - end) * (1.0 - share[:, np.newaxis])
    values = np.linalg.norm((X - truth) / truth, axis=1) + 1e-12
    return RunTrace(run, evaluations, np.minimum.accumulate(values), X, tuple(UNITS))


def made(
    cases=PAPER_CASES, identifiers=None,
    noises=(0.0, 0.3), seeds=5, fitness=("similarity",),
    windows=("0-0.7 s",), failed=0, budget=3000, report="",
):  # fmt: skip
    """Make up results; identifiers: label -> median error; failed: how many runs at the end fail."""
    rng = np.random.default_rng(1)
    identifiers = identifiers or {"pso": 3e-3, "cmaes": 1e-4, "de+bobyqa": 1e-6}
    runs, parameters, traces = [], [], []
    settings = list(product(noises, windows, fitness, range(1, seeds + 1)))
    for case, (label, scale), (noise, window, name, seed) in product(cases, identifiers.items(), settings):
        run, truth = f"r{len(runs):05d}", np.array([case["truth"][p] for p in UNITS])
        deviation = 2e-3 * noise / 0.3 * np.abs(truth) + 1e-9 * np.abs(truth)
        error = scale * np.exp(rng.normal(0.0, 1.0)) * rng.choice([-1.0, 1.0], 4)
        end = np.clip(truth * (1.0 + error) + (rng.normal(0.0, 1.0, 4) * deviation if noise else 0.0), LOW, HIGH)
        used = int(rng.integers(budget // 2, budget))
        trace = one_trace(run, truth, end, used, rng)
        runs.append({
            "run": run, "case": case["name"], "identifier": label, "fitness": name, "noise_deg_s": noise,
            "window": window, "seed": seed, "budget": budget, "used": float(used), "n_failed": 2.0,
            "value": trace.values[-1], "stopped": "budget used", "status": "done", "error": "",
            "seconds": rng.uniform(), "train_rmse": 0.01, "train_s": 1.0 - trace.values[-1], "train_s1": 0.99,
            "train_s2": 1.0, "holdout_rmse": np.nan, "started_at": "never", "model": "m", "versions": "v",
        })  # fmt: skip
        parameters += [{
            "run": run, "parameter": p, "unit": UNITS[p], "value": end[i], "truth": truth[i], "low": LOW[i],
            "high": HIGH[i], "relative_error": abs(end[i] - truth[i]) / abs(truth[i]), "deviation": deviation[i],
            "correlation_max": 0.99, "at_bound": end[i] in (LOW[i], HIGH[i]),
        } for i, p in enumerate(UNITS)]  # fmt: skip
        traces.append(trace)
    frame, rows = pd.DataFrame(runs), pd.DataFrame(parameters)
    if failed:
        lost = set(frame["run"].iloc[-failed:])
        at = frame["run"].isin(lost)
        frame.loc[at, ["status", "error", "stopped"]] = ["failed", "it broke\nin the middle", ""]
        frame.loc[at, ["used", "n_failed", "value", "train_s"]] = np.nan
        rows = rows[~rows["run"].isin(lost)]
        traces = [t for t in traces if t.run not in lost]
    study = {
        "name": "made_up", "question": "Does the report hold?", "kind": "identify", "report": report, "text": "",
        "plant": "shell_transfer_arm", "effects": [], "cases": cases, "identifiers": list(identifiers),
        "versions": {"armid": "0"}, "n_planned": len(frame), "n_done": len(frame) - failed, "n_failed": failed,
    }  # fmt: skip
    return MadeResults(frame, rows, study, traces)
