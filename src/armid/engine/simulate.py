"""Simulate a population of candidates."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from itertools import count, pairwise
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike, NDArray

from armid.engine.compile import UNCOMPILABLE, Kernel, compile_error, compile_model, compiling
from armid.engine.simd import LANE_WIDTH
from armid.errors import ArmidError, nearest
from armid.model import Array, Manoeuvre, Model
from armid.model.graph import LATE_LEAVES, Node

# Parts of a population per thread: candidates that switch early take longer, so that halves would be uneven.
SHARES_OF_THREADS = 4
# A candidate one of whose signals exceeds so many times its size has diverged.
DIVERGED = 1e3
# Damping of the steps of Runge-Kutta-Chebyshev, as published; h lambda up to which a classical step is stable.
DAMPING, STABLE = 2.0 / 13.0, 2.785


@dataclass(frozen=True)
class Schedule:
    """Say how finely time is cut; the result of a candidate depends on it, never on the other candidates.

    substeps: integration steps between samples, everywhere unless `rough` is given.
    refinement: times finer for `fresh_samples` samples from a one-way switch on, where the motion is fastest, and where
        a step is rough; what is refined follows without a jump.
    stages: of one step that bears motion which decays within it, as where friction holds. It is tried where a step is
        rough and such motion is seen, before finer steps, which follow where it is rough too; 0: none is.
    rough: a sample takes one step, and where this step is rough `refinement`, in the lanes that ask for it: from which
        h (|k3 - k2| + |k1 - k2 - k3 + k4|) of its Runge-Kutta stages on, for each state [its unit], shape (n_states,).
        As accurate as `substeps` everywhere, which then only tells so; None: every sample is cut alike.
    plan: for each sample, how many sample intervals one step may span while no switch has happened (at most 8), shape
        (n_samples - 1,); None: one.
    weights: weights of the parameters in the expected time of the switch, shape (n_parameters,); candidates that switch
        at about the same time then run side by side, which is faster and changes no result.
    """

    substeps: int = 1
    refinement: int = 8
    stages: int = 0
    fresh_samples: int = 8
    plan: NDArray[np.int64] | None = None
    weights: Array | None = None
    rough: Array | None = None

    @property
    def least(self) -> int:
        """Integration steps between samples where nothing asks for more."""
        return self.substeps if self.rough is None else 1

    def spans(self, n_samples: int) -> NDArray[np.int64]:
        """Return the plan for a number of samples, no step reaching beyond the last."""
        if self.plan is None:
            return np.ones(max(n_samples, 1), dtype=np.int64)
        left = np.arange(n_samples - 1, 0, -1)
        return np.where(self.plan[: n_samples - 1] <= left, self.plan[: n_samples - 1], 1)


@dataclass(frozen=True)
class Simulation:
    """Hold what a population did.

    outputs: recorded signals, shape (n_outputs, n_candidates, n_samples), SI, NaN from the sample on at which a
        candidate diverged; output: the first of them.
    failed: shape (n_candidates,), True where it diverged.
    switch_times: latch -> time [s] of its switch, shape (n_candidates,), NaN where it never switched.
    states: state -> shape (n_candidates, n_samples); empty unless asked for.
    n_steps: integration steps between two samples, mean over the samples and over what ran side by side; four stages
        count as one.
    """

    outputs: Array
    failed: NDArray[np.bool_]
    switch_times: dict[str, Array]
    states: dict[str, Array]
    n_steps: float

    @property
    def output(self) -> Array:
        """Signal of the first output, (n_candidates, n_samples), SI."""
        return np.asarray(self.outputs[0])

    def joint(self, sizes: Sequence[float]) -> Array:
        """Return all outputs end to end as shares of their sizes, times that of the first, (n_candidates, n)."""
        if len(sizes) == 1:
            return self.output
        return np.concatenate([sizes[0] / size * y for size, y in zip(sizes, self.outputs, strict=True)], axis=-1)


def simulate(
    model: Model, manoeuvre: Manoeuvre, population: ArrayLike, schedule: Schedule = Schedule(), threads: int = 1,
    states: bool = False,
) -> Simulation:  # fmt: skip
    """Simulate every candidate of a population through one manoeuvre.

    Parameters
    ----------
    model, manoeuvre
        What moves, and what it is made to do.
    population : (n_candidates, n_parameters), SI
        Columns in the order of `model.parameters`; one candidate may come as a vector.
    schedule
        How finely time is cut.
    threads
        Candidates are shared among so many threads; the result is the same bit for bit.
    states
        Keep the states too (then no step spans several samples).

    Raises
    ------
    ArmidError
        For a wrong shape, an unknown constant, a missing input, and an equation that cannot be compiled.
    """
    as_population(model, population)
    return prepare(model, manoeuvre, schedule, states).run(population, threads)


def prepare(model: Model, manoeuvre: Manoeuvre, schedule: Schedule = Schedule(), states: bool = False) -> "Prepared":
    """Return what simulates populations through one manoeuvre as often as asked; arguments and errors as `simulate`."""
    spans = (replace(schedule, plan=None) if states else schedule).spans(manoeuvre.n_samples)
    # The plant says whether an input keeps the value of its last sample, else the record does.
    holds = [i.hold or manoeuvre.hold for i in model.plant.inputs] or [""]
    constants = np.array(model.constant_values(manoeuvre.constants))
    settings = (
        input_values(model, manoeuvre), float(manoeuvre.interval), manoeuvre.n_samples, schedule.least,
        schedule.refinement, chebyshev(schedule.stages), float(schedule.fresh_samples), spans,
        np.array([hold == "zero" for hold in holds]), float(manoeuvre.start_time),
        DIVERGED * np.array(model.plant.sizes),
        schedule.rough is not None,
        np.zeros(len(model.states)) if schedule.rough is None else 1.0 / schedule.rough,
        manoeuvre.n_before,
    )  # fmt: skip
    return Prepared(model, compile_model(model), schedule, manoeuvre.n_samples, constants, settings, states)


@dataclass(frozen=True, eq=False)
class Prepared:
    """Simulate populations through one manoeuvre, everything but the candidates made ready once.

    constants: of the manoeuvre, SI, (n_constants,), in the order of the model's. settings: arguments of the kernel
    between the candidates and where their results go.
    """

    model: Model
    kernel: Kernel
    schedule: Schedule
    n_samples: int
    constants: Array
    settings: tuple[Any, ...]
    states: bool

    def moved_constants(self, shares: Mapping[str, Array]) -> Array:
        """Return the constants of candidates, some with shares added to their value, see `run`."""
        order = list(self.model.constants)
        moved = np.tile(self.constants, (len(next(iter(shares.values()))), 1))
        for name, share in shares.items():
            moved[:, order.index(name)] *= 1.0 + share
        return moved

    def run(self, population: ArrayLike, threads: int = 1, constants: Array | None = None) -> Simulation:
        """Simulate every candidate; constants: in place of the manoeuvre's, (n_candidates, n_constants), SI."""
        model = self.model
        candidates = as_population(model, population)
        n = len(candidates)
        rows, places = arranged(candidates, self.schedule.weights)
        # Constants of all candidates stand once for each lane.
        lanes = np.where(places >= 0, places, n - 1) if constants is not None else np.zeros(LANE_WIDTH, dtype=np.int64)
        columns = np.ascontiguousarray(np.atleast_2d(self.constants if constants is None else constants)[lanes].T)
        outputs = np.empty((len(model.plant.outputs), n, self.n_samples))
        switches = np.full((len(model.latches), rows.shape[1]), np.nan)
        trace = np.empty((len(model.states), n, self.n_samples) if self.states else (0, 0, 0))
        given = (rows.ravel(), rows.shape[1], columns.ravel(), columns.shape[1], *self.settings, places)
        n_groups = rows.shape[1] // LANE_WIDTH
        repeats = np.zeros(n_groups)
        with compiling(model, self.kernel):
            run(self.kernel, given, (outputs, switches.ravel(), trace, repeats), n_groups, threads)
        kept = dict(zip(model.states, trace, strict=True)) if self.states else {}
        inverse = np.argsort(places[:n], kind="stable")
        times = {name: row[inverse] for name, row in zip(model.latches, switches, strict=True)}
        again = float(np.sum(repeats)) / max(n_groups * self.n_samples, 1)
        n_steps = self.schedule.least * (1.0 + again)
        return Simulation(outputs, np.isnan(outputs[0, :, -1]), times, kept, n_steps)


def stages_as_stable_as(n: int) -> int:
    """Return the fewest stages with which one step bears decays as fast as n steps of the classical method do."""
    return next(s for s in count(2) if 2.0 / 3.0 * (s**2 - 1.0) * (1.0 - 2.0 / 15.0 * DAMPING) >= STABLE * n)


@cache
def chebyshev(n: int) -> Array:
    """Return the coefficients of a Runge-Kutta-Chebyshev step of n stages, shape (n + 1, 5), none for 0.

    Second order, for motion that decays faster than h: stable up to h lambda = 2/3 (n**2 - 1) (1 - 2/15 d) with d the
    damping, where n evaluations of the rates by the classical method reach 0.7 n. Row j: mu, nu, mu~ and gamma~ of
    stage j + 1, and the fraction c of the step at which stage j stands. Source: Sommeijer, Shampine and Verwer 1998,
    doi:10.1016/S0377-0427(97)00219-7.
    """
    if n == 0:
        return np.empty((0, 5))
    w0 = 1.0 + DAMPING / n**2
    t, first, second = (np.array([Chebyshev.basis(j).deriv(k)(w0) for j in range(n + 1)]) for k in range(3))
    w1 = first[n] / second[n]
    b = np.append([second[2] / first[2] ** 2] * 2, second[2:] / first[2:] ** 2)
    mu, nu = 2.0 * b[1:] / b[:-1], -b[2:] / b[:-2]
    c = w1 * second[1:] / first[1:]
    c[0] = c[1] / first[2]
    rows = np.zeros((n + 1, 5))
    rows[:n, 0], rows[1:n, 1], rows[:n, 2], rows[1:, 4] = mu * w0, nu, mu * w1, c
    rows[0, 2] = b[1] * w1
    rows[1:n, 3] = -(1.0 - b * t)[1:n] * rows[1:n, 2]
    return rows


def as_population(model: Model, population: ArrayLike) -> Array:
    candidates = np.atleast_2d(np.asarray(population, dtype=np.float64))
    if candidates.ndim != 2 or candidates.shape[1] != len(model.parameters):
        raise ArmidError(f"a population of shape {candidates.shape} was given: (n_candidates, "
                         f"{len(model.parameters)}) is expected for {', '.join(model.parameters)}")  # fmt: skip
    return candidates


def input_values(model: Model, manoeuvre: Manoeuvre) -> Array:
    names = [i.name for i in model.plant.inputs]
    for name in names:
        if name not in manoeuvre.inputs:
            raise ArmidError(f"the manoeuvre lacks the input '{name}' of plant '{model.plant.name}'")
        if np.shape(manoeuvre.inputs[name]) != (manoeuvre.n_samples,):
            raise ArmidError(f"input '{name}' has shape {np.shape(manoeuvre.inputs[name])}: ({manoeuvre.n_samples},) "
                             "is expected")  # fmt: skip
    if not names:
        return np.zeros((1, 1))
    rows = [np.concatenate([manoeuvre.before.get(name, ()), manoeuvre.inputs[name]]) for name in names]
    return np.array(rows, dtype=np.float64)


def arranged(candidates: Array, weights: Array | None) -> tuple[Array, NDArray[np.int64]]:
    """Return parameters as rows, one column for each lane, and the candidate of each lane (-1: padding)."""
    n, padding = len(candidates), -len(candidates) % LANE_WIDTH
    # within one group the order saves nothing
    order = np.arange(n) if weights is None or n <= LANE_WIDTH else np.argsort(candidates @ weights, kind="stable")
    lanes = np.append(order, np.repeat(order[-1:], padding))
    return np.ascontiguousarray(candidates[lanes].T), np.append(order, np.full(padding, -1))


@cache
def pool_of(threads: int) -> ThreadPoolExecutor:
    """Return the pool of so many threads; it stays, as starting threads takes as long as many simulations."""
    return ThreadPoolExecutor(threads, thread_name_prefix="armid")


def run(kernel: Kernel, given: tuple[Any, ...], results: tuple[Array, ...], n_groups: int, threads: int) -> None:
    """Fill the results group by group; threads take neighbouring groups."""
    try:
        if threads < 2 or n_groups < 2:
            kernel(*given, 0, n_groups, *results)
            return
        edges = np.linspace(0, n_groups, min(SHARES_OF_THREADS * threads, n_groups) + 1).astype(int)
        pool = pool_of(threads)
        parts = [pool.submit(kernel, *given, int(a), int(b), *results) for a, b in pairwise(edges)]
        for part in parts:
            part.result()
    except UNCOMPILABLE as error:
        raise compile_error(error) from error


def along(
    model: Model, manoeuvre: Manoeuvre, candidate: Array, schedule: Schedule, names: Sequence[str]
) -> dict[str, Array]:
    """Return states, inputs, quantities, ports or `time` of one candidate on the samples, name -> (n_samples,), SI.

    names: as equations spell them; an effect's own are qualified (`shell_rocking.twist`), aliases are understood.
    """
    run = simulate(model, manoeuvre, candidate[np.newaxis], schedule, states=True)
    times = manoeuvre.times()
    values: dict[str, Any] = dict(zip(map(flat, model.parameters), map(float, candidate), strict=True))
    values |= dict(zip(model.constants, model.constant_values(manoeuvre.constants), strict=True))
    values |= {i.name: np.asarray(manoeuvre.inputs[i.name], dtype=float) for i in model.plant.inputs}
    values |= {flat(name): state[0] for name, state in run.states.items()} | {"time": times}
    values |= {flat(name): np.where(times >= when[0], 1.0, 0.0) for name, when in run.switch_times.items()}
    values |= {node.key: late_values(node, manoeuvre, model, values) for node in model.graph.of_kind(*LATE_LEAVES)}
    keys = {name: flat(model.plant.aliases.get(name, name)) for name in names}
    for name, key in keys.items():
        if key not in model.graph.nodes:
            raise ArmidError(f"'{name}' is not a name of plant '{model.plant.name}': "
                             f"{nearest(name, model.graph.nodes)}")  # fmt: skip
    values = model.graph.values(keys.values(), values)
    return {
        name: np.broadcast_to(np.asarray(values[key], dtype=float), times.shape).copy() for name, key in keys.items()
    }


def late_values(node: Node, manoeuvre: Manoeuvre, model: Model, values: Mapping[str, Any]) -> Array:
    """Return a late state or input on the samples, (n_samples,); a state runs straight between samples.

    values: key -> value of parameters, states and inputs.
    """
    delay = max(sum(values[by] for by in node.by), 0.0) / manoeuvre.interval
    before = np.asarray(manoeuvre.before.get(node.needs[0], ()), dtype=float)
    known = np.concatenate([before, values[node.needs[0]]])
    places = len(before) + np.arange(manoeuvre.n_samples) - delay
    holds = {i.name: i.hold or manoeuvre.hold for i in model.plant.inputs}
    if holds.get(node.needs[0]) == "zero":
        return np.asarray(known[np.maximum(np.floor(places).astype(int), 0)])
    return np.asarray(np.interp(places, np.arange(len(known)), known))


def flat(name: str) -> str:
    return name.replace(".", "__")
