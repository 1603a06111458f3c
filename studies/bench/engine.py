"""The engine against scipy and a plain compiled loop, with effects, on two threads; and the cost of a fitness."""

from functools import partial

import numpy as np
from joblib import cpu_count

from armid.problem.similarity import numerical_similarity, similarity
from bench.baselines import plain_loop, solve_with_scipy
from bench.measure import WALL, Bound, Row, Work, fastest, load_text
from bench.samples import Array, Task, arm_task

ALLOWED = 1e-5
TOLERANCES = (1e-4, 3e-5, 1e-5, 5e-6, 3e-6, 2e-6, 1e-6, 5e-7, 3e-7, 2e-7, 1e-7, 1e-8)
TIGHTEST = 1e-11
THREADED = 1280
# A fifth of what the effects declare: more friction would hold half of the candidates before their switch, and a
# motion without the switch is less work than the one it is compared with.
FRICTION = {"coulomb.level": (0.0, 100.0), "viscous.slope": (0.0, 50.0)}


def scipy_outputs(task: Task, n_candidates: int, tolerance: float) -> Array:
    """Return what scipy makes of the first candidates [rad/s], (n_candidates, n_samples)."""
    times = task.manoeuvre.times()
    return np.array([solve_with_scipy(c, times, tolerance) for c in task.population[:n_candidates]])


def loosest_tolerance(task: Task, reference: Array, n_candidates: int) -> tuple[float, float]:
    """Return the loosest tolerance with which scipy stays within the engine's allowed error, and its error [rad/s]."""
    error = np.inf
    for tolerance in TOLERANCES:
        error = task.error(scipy_outputs(task, n_candidates, tolerance), reference)
        if error <= ALLOWED:
            break
    return tolerance, error


def engine_rows(rounds: int = 20, n_candidates: int = 80, n_scipy: int = 20) -> list[Row]:
    """Measure the engine, scipy at the engine's allowed error and the plain loop in turn, on the same candidates.

    n_scipy: on so many of them scipy is measured.
    """
    task = arm_task(n_candidates)
    reference, plain = task.reference(), np.empty((n_candidates, task.manoeuvre.n_samples))
    tolerance, scipy_error = loosest_tolerance(task, reference, n_scipy)
    works: dict[str | int, Work] = {
        "engine": task.run,
        "plain": partial(plain_loop, task.population, plain, task.manoeuvre.interval),
    }
    times = task.manoeuvre.times()
    works |= {i: partial(solve_with_scipy, task.population[i], times, tolerance) for i in range(n_scipy)}
    best = fastest(works, rounds)
    seconds = {name: best[name] / n_candidates for name in ("engine", "plain")}
    seconds["scipy"] = sum(best[i] for i in range(n_scipy)) / n_scipy
    tight = task.error(scipy_outputs(task, n_scipy, TIGHTEST), reference)
    return [
        contestant(
            f"engine, population {n_candidates}, 1 core", "engine", seconds, task.error(task.run().output, reference),
            note=f"errors are against the engine cut 16 times finer, which is within {tight:.0e} rad/s of DOP853 at "
                 f"{TIGHTEST:g}",
        ),
        contestant(
            f"scipy DOP853 with event, tolerance {tolerance:g}", "scipy", seconds, scipy_error, Bound(2000),
            f"the loosest tolerance that keeps {ALLOWED:g} rad/s on {n_scipy} candidates",
        ),
        contestant("plain numba loop, RK4 1 ms", "plain", seconds, task.error(plain, reference), Bound(12)),
    ]  # fmt: skip


def contestant(
    what: str, name: str, seconds: dict[str, float], error: float, wanted: Bound | None = None, note: str = ""
) -> Row:
    """Return the row of the engine, or of one that is compared with it."""
    ratio = seconds[name] / seconds["engine"] if wanted else None
    baseline = "the engine's time" if wanted else ""
    return Row(what, seconds[name] * 1e6, "us", baseline, ratio, wanted, 1 / seconds[name], error, note)


def effects_row(rounds: int = 20, n_candidates: int = 80) -> Row:
    """Measure what Coulomb and viscous friction cost the engine."""
    bare = arm_task(n_candidates)
    task = arm_task(n_candidates, effects=("coulomb", "viscous"), bounds=FRICTION)
    best = fastest({"bare": bare.run, "task": task.run}, rounds)
    run, seconds = task.run(), best["task"] / n_candidates
    switched = np.count_nonzero(np.isfinite(next(iter(run.switch_times.values()))))
    return Row(
        "engine with coulomb + viscous", seconds * 1e6, "us", "the speed without",
        best["bare"] / best["task"], Bound(0.5), 1 / seconds, task.error(run.output, task.reference()),
        f"friction to a fifth of its bounds; {switched} of {n_candidates} candidates reach their switch",
    )  # fmt: skip


def threads_row(rounds: int = 20, n_candidates: int = THREADED, attempts: int = 12) -> Row:
    """Measure two threads against one, by the clock on the wall.

    Whatever else runs takes one of few cores away, so up to `attempts` times as many rounds are made until the shortest
    times have the wanted ratio.
    """
    task, wanted = arm_task(n_candidates), Bound(1.6)
    best = {1: np.inf, 2: np.inf}
    for _ in range(attempts):
        found = fastest({n: partial(task.run, n) for n in best}, rounds, WALL)
        best = {n: min(best[n], found[n]) for n in best}
        if wanted.holds(best[1] / best[2]):
            break
    seconds = best[2] / n_candidates
    same = bool(np.array_equal(task.run(1).output, task.run(2).output, equal_nan=True))
    return Row(
        f"engine, 2 threads, population {n_candidates:,}", seconds * 1e6, "us", "the speed of 1 thread",
        best[1] / best[2], wanted, 1 / seconds, task.error(task.run(2).output, task.reference()),
        f"{cpu_count()} cores, load {load_text()}; {'the same' if same else 'NOT the same'} bits as 1 thread",
    )  # fmt: skip


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
