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

Array = NDArray[np.float64]
TOLERANCE = 1e-10
# Evaluations of the equations; a usual motion takes some 10,000.
MOST_RATES = 100_000


class PlainModel:
    """Evaluate the equations of a model with plain functions.

    candidate: whole parameter vector, SI; manoeuvre: constants, inputs and time grid.
    """

    def __init__(self, model: Model, manoeuvre: Manoeuvre, candidate: Array) -> None:
        self.graph = model.graph
        self.states = [k.replace(".", "__") for k in model.states]
        self.latches = [k.replace(".", "__") for k in model.latches]
        self.output_key = model.plant.output
        values = dict(zip((k.replace(".", "__") for k in model.parameters), map(float, candidate), strict=True))
        values |= dict(zip(model.constants, model.constant_values(manoeuvre.constants), strict=True))
        self.known = values
        self.manoeuvre, self.inputs = manoeuvre, {i.name: i.hold or manoeuvre.hold for i in model.plant.inputs}
        guards = [n.key for n in self.graph.of_kind("guard")]
        self.kinks = [g for g in guards if g.removeprefix("guard__") not in self.latches]
        self.n_rates = 0
        # the sample whose value a held input has
        self.sample = 0

    def evaluate(self, keys: list[str], values: dict[str, Any]) -> list[Any]:
        """Return the values of some nodes."""
        known = self.known | values
        for node in self.graph.order(keys):
            if node.kind == "port":
                known[node.key] = sum(known[t] for t in node.terms)
            else:
                assert node.function is not None
                known[node.key] = node.function(**{a: known[k] for a, k in node.arguments})
        return [known[k] for k in keys]

    def start(self) -> Array:
        """Return the initial states."""
        return np.array(self.evaluate([f"initial__{s}" for s in self.states], {}), dtype=float)

    def moment(self, time: float, states: Array, closed: tuple[float, ...]) -> dict[str, Any]:
        """Return what moves, by key, at one time."""
        values: dict[str, Any] = dict(zip(self.states, states, strict=True))
        values |= dict(zip(self.latches, closed, strict=True))
        return values | {"time": time} | {name: self.input_at(name, time) for name in self.inputs}

    def input_at(self, name: str, time: float) -> float:
        """Return an input between its samples."""
        samples, place = self.manoeuvre.inputs[name], (time - self.manoeuvre.start_time) / self.manoeuvre.interval
        if self.inputs[name] == "zero":
            return float(samples[self.sample])
        return float(np.interp(place, np.arange(len(samples)), samples))

    def rates(self, time: float, states: Array, closed: tuple[float, ...]) -> Array:
        """Return the time derivatives.

        Raises ArmidError when they are asked for too often: the integrator does not get on.
        """
        self.n_rates += 1
        if self.n_rates > MOST_RATES:
            raise ArmidError(f"scipy does not get beyond {time:.3g} s: the equations are stiff there, or jump where no "
                             "guard is declared")  # fmt: skip
        keys = [f"rate__{s}" for s in self.states]
        return np.array(self.evaluate(keys, self.moment(time, states, closed)), dtype=float)

    def guard(self, key: str, closed: tuple[float, ...]) -> Callable[[float, Array], float]:
        """Return a guard as a function of time and states."""
        return lambda t, y: float(self.evaluate([key], self.moment(t, y, closed))[0])

    def output(self, time: float, states: Array, closed: tuple[float, ...]) -> float:
        """Return the recorded signal."""
        return float(self.evaluate([self.output_key], self.moment(time, states, closed))[0])


def simulate_plainly(model: Model, manoeuvre: Manoeuvre, candidate: Array) -> Array:
    """Return the recorded signal of one candidate, (n_samples,), error about 1e-9 of its size.

    DOP853, restarted at every kink and switch, and at every sample where inputs drive the machine.
    Raises ArmidError when scipy does not get on.
    """
    plain = PlainModel(model, manoeuvre, candidate)
    times, states = manoeuvre.times(), plain.start()
    closed = tuple(0.0 for _ in plain.latches)
    closed = switched(plain, times[0], states, closed)
    out = np.empty(len(times))
    out[0] = plain.output(times[0], states, closed)
    for i in range(1, len(times)):
        states, closed = carried(plain, times[i - 1], times[i], states, closed)
        plain.sample = i
        out[i] = plain.output(times[i], states, closed)
    return out


def switched(plain: PlainModel, time: float, states: Array, closed: tuple[float, ...]) -> tuple[float, ...]:
    """Return the latches after a look at their guards."""
    return tuple(
        1.0 if c or plain.guard(f"guard__{k}", closed)(time, states) <= 1e-12 else 0.0
        for k, c in zip(plain.latches, closed, strict=True)
    )


def carried(
    plain: PlainModel, begin: float, end: float, states: Array, closed: tuple[float, ...]
) -> tuple[Array, tuple[float, ...]]:
    """Return states and latches at the end of an interval, restarting where a guard changes its sign."""
    while begin < end:
        keys = [f"guard__{k}" for k, c in zip(plain.latches, closed, strict=True) if not c] + plain.kinks
        events = [terminal(plain.guard(key, closed), begin) for key in keys]
        run = solve_ivp(lambda t, y: plain.rates(t, y, closed), (begin, end), states, method="DOP853",  # noqa: B023
                        rtol=TOLERANCE, atol=TOLERANCE, events=events or None)  # fmt: skip
        states = run.y[:, -1]
        closed = switched(plain, float(run.t[-1]), states, closed)
        begin = float(run.t[-1]) if run.status == 1 else end
    return states, closed


def terminal(guard: Callable[[float, Array], float], begin: float) -> Callable[[float, Array], float]:
    """Return an event that ends the integration, but not at once where it has just ended."""

    def event(time: float, states: Array) -> float:
        return guard(time, states) if time > begin + 1e-9 else 1.0 if guard(time + 0.0, states) >= 0.0 else -1.0

    event.terminal = True  # type: ignore[attr-defined]
    return event
