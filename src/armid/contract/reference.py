"""A slow, independent way to simulate a model: its plain functions, one candidate, scipy's integrator.

It shares nothing with the engine but the graph of equations, so that it can judge the engine.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from armid.errors import ArmidError
from armid.model import Manoeuvre, Model
from armid.model.graph import Node

Array = NDArray[np.float64]
Latches = tuple[float, ...]
TOLERANCE = 1e-10
# Longest step in sample intervals, so that no guard changes its sign twice in one.
LONGEST_STEP = 4.0
# Evaluations of the equations; a usual motion takes some 10,000.
MOST_RATES = 100_000


def simulate_plainly(model: Model, manoeuvre: Manoeuvre, candidate: Array) -> Array:
    """Return the recorded signal of one candidate, (n_samples,), error about 1e-9 of its size.

    DOP853, restarted at every kink and switch, and at every sample where inputs drive the machine.
    candidate: whole parameter vector, SI. Raises ArmidError when scipy does not get on.
    """
    plain = PlainModel(model, manoeuvre, candidate)
    times, states = manoeuvre.times(), plain.start()
    closed = plain.switched(times[0], states, tuple(0.0 for _ in plain.latches))
    out = np.empty(len(times))
    out[0] = plain.output(times[0], states, closed)
    length = 1 if plain.inputs else len(times) - 1
    for first in range(0, len(times) - 1, length):
        begin, n = times[first], first + 1
        while n <= first + length:
            plain.sample = first
            run = plain.integrated(begin, states, closed, times[n : first + length + 1])
            if run.status < 0:
                raise ArmidError(f"scipy does not get beyond {begin:.3g} s: {run.message}")
            hit = [(t[-1], y[-1]) for t, y in zip(run.t_events or [], run.y_events or [], strict=True) if len(t)]
            begin, states = hit[0] if run.status == 1 else (run.t[-1], run.y[:, -1])
            before, closed = closed, plain.switched(float(begin), states, closed)
            for t, y in zip(run.t, np.reshape(run.y, (len(states), -1)).T, strict=True):
                plain.sample = n
                out[n] = plain.output(t, y, closed if t == begin else before)
                n += 1
    return out


class PlainModel:
    """Evaluate the equations of a model with plain functions.

    candidate: whole parameter vector, SI; manoeuvre: constants, inputs and time grid.
    """

    def __init__(self, model: Model, manoeuvre: Manoeuvre, candidate: Array) -> None:
        self.graph = model.graph
        self.states = [k.replace(".", "__") for k in model.states]
        self.latches = [k.replace(".", "__") for k in model.latches]
        self.output_key = model.plant.output
        self.known = dict(zip((k.replace(".", "__") for k in model.parameters), map(float, candidate), strict=True))
        self.known |= dict(zip(model.constants, model.constant_values(manoeuvre.constants), strict=True))
        self.manoeuvre, self.inputs = manoeuvre, {i.name: i.hold or manoeuvre.hold for i in model.plant.inputs}
        guards = [n.key for n in self.graph.of_kind("guard")]
        self.kinks = [g for g in guards if g.removeprefix("guard__") not in self.latches]
        self.orders: dict[tuple[str, ...], list[Node]] = {}
        self.n_rates = 0
        # the sample whose value a held input has
        self.sample = 0

    def evaluate(self, keys: list[str], values: dict[str, Any]) -> list[Any]:
        known = self.known | values
        if tuple(keys) not in self.orders:
            self.orders[tuple(keys)] = self.graph.order(keys)
        for node in self.orders[tuple(keys)]:
            if node.kind == "port":
                known[node.key] = sum(known[t] for t in node.terms)
            else:
                assert node.function is not None
                known[node.key] = node.function(**{a: known[k] for a, k in node.arguments})
        return [known[k] for k in keys]

    def start(self) -> Array:
        return np.array(self.evaluate([f"initial__{s}" for s in self.states], {}), dtype=float)

    def moment(self, time: float, states: Array, closed: Latches) -> dict[str, Any]:
        values: dict[str, Any] = dict(zip(self.states, states, strict=True))
        values |= dict(zip(self.latches, closed, strict=True))
        return values | {"time": time} | {name: self.input_at(name, time) for name in self.inputs}

    def input_at(self, name: str, time: float) -> float:
        samples, place = self.manoeuvre.inputs[name], (time - self.manoeuvre.start_time) / self.manoeuvre.interval
        if self.inputs[name] == "zero":
            return float(samples[self.sample])
        return float(np.interp(place, np.arange(len(samples)), samples))

    def rates(self, time: float, states: Array, closed: Latches) -> Array:
        """Return the time derivatives.

        Raises ArmidError when they are asked for too often: the integrator does not get on.
        """
        self.n_rates += 1
        if self.n_rates > MOST_RATES:
            raise ArmidError(f"scipy does not get beyond {time:.3g} s: the equations are stiff there, or jump where no "
                             "guard is declared")  # fmt: skip
        keys = [f"rate__{s}" for s in self.states]
        return np.array(self.evaluate(keys, self.moment(time, states, closed)), dtype=float)

    def guard(self, key: str, time: float, states: Array, closed: Latches) -> float:
        return float(self.evaluate([key], self.moment(time, states, closed))[0])

    def output(self, time: float, states: Array, closed: Latches) -> float:
        return float(self.evaluate([self.output_key], self.moment(time, states, closed))[0])

    def switched(self, time: float, states: Array, closed: Latches) -> Latches:
        return tuple(
            1.0 if c or self.guard(f"guard__{k}", time, states, closed) <= 1e-12 else 0.0
            for k, c in zip(self.latches, closed, strict=True)
        )

    def integrated(self, begin: float, states: Array, closed: Latches, times: Array) -> Any:
        """Return scipy's solution at some times, which ends where a guard changes its sign."""
        keys = [f"guard__{k}" for k, c in zip(self.latches, closed, strict=True) if not c] + self.kinks
        return solve_ivp(
            lambda t, y: self.rates(t, y, closed), (begin, times[-1]), states, method="DOP853", rtol=TOLERANCE,
            atol=TOLERANCE, t_eval=times, max_step=LONGEST_STEP * self.manoeuvre.interval,
            events=[self.event(key, begin, closed) for key in keys] or None,
        )  # fmt: skip

    def event(self, key: str, begin: float, closed: Latches) -> Callable[[float, Array], float]:
        """Return a guard as an event that ends the integration, but not at once where it has just ended."""

        def event(time: float, states: Array) -> float:
            value = self.guard(key, time, states, closed)
            return value if time > begin + 1e-9 else 1.0 if value >= 0.0 else -1.0

        event.terminal = True  # type: ignore[attr-defined]
        return event
