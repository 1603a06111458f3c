"""What it costs to compare a candidate with a measurement."""

from functools import partial

import numpy as np

from armid.bench.row import Row
from armid.bench.task import arm_task
from armid.bench.timing import Work, fastest
from armid.problem.similarity import numerical_similarity, similarity


def fitness_rows(rounds: int = 20, n_candidates: int = 80) -> list[Row]:
    """Measure the similarity degree S and its numerical part S1, per candidate."""
    task = arm_task(n_candidates)
    simulated, interval = task.run().output, task.manoeuvre.interval
    measured = simulated[0] + np.random.default_rng(3).normal(0.0, np.deg2rad(0.2), simulated.shape[1])
    works: dict[str, Work] = {
        "S": partial(similarity, measured, simulated, interval),
        "S1": partial(numerical_similarity, measured, simulated),
    }
    best = fastest(works, rounds)
    return [
        Row("fitness: similarity S", best["S"] / n_candidates * 1e6, "us"),
        Row("fitness: numerical similarity S1", best["S1"] / n_candidates * 1e6, "us"),
    ]
