"""Integrate a machine with its undeclared effects: classical Runge-Kutta, all records of a campaign side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from machines.catalogue import Array, Machine, Numbers
from machines.forms import Form, Here

ORDER = ("signal", "drive", "torque")
"""Places of effects in the order in which they act."""


@dataclass(frozen=True)
class Planted:
    """Hold a form with its sizes, SI; `on`: 1 for each record that has it, 0 for the others, (n_records,)."""

    form: Form
    sizes: Mapping[str, float]
    on: Any = 1.0

    def here(self) -> dict[str, Any]:
        """Return the sizes with the strength at 0 where the effect is not there."""
        return {**self.sizes, self.form.strength: self.sizes[self.form.strength] * np.asarray(self.on)}


@dataclass(frozen=True)
class Commands:
    """Compute the command u at any step: recorded inputs, a controller, and what makes it late.

    inputs: name -> values at the samples, (n_samples, n_records). n_sub: steps in a sample interval. h: step [s].
    path: states so far, (n_steps + 1, n_states, n_records).
    """

    machine: Machine
    numbers: Numbers
    inputs: Mapping[str, Array]
    n_sub: int
    h: float
    hold: str
    late: Sequence[Planted]
    path: Array

    def at(self, k: int, part: float, q: Array) -> Array:
        """Return u at step k plus a part of it, (n_records,); q: the position there."""
        lanes = np.arange(q.size)
        back = steps_back(self.late, k * self.h, self.h, q.size)
        if self.late and self.machine.controlled:
            place = np.maximum(k + part - back, 0.0)
            first = np.minimum(np.floor(place).astype(int), k)
            second, w = np.minimum(first + 1, k), place - first
            q = np.where(back > 0, (1.0 - w) * self.path[first, 0, lanes] + w * self.path[second, 0, lanes], q)
        # a value that is held belongs to the step that it begins, also for the last stage of the step before
        now = np.floor(np.maximum(k - back, 0.0) / self.n_sub + 1e-9).astype(int)
        if self.hold == "zero":
            given = {name: values[now, lanes] for name, values in self.inputs.items()}
        else:
            w = np.maximum(k + part - back, 0.0) / self.n_sub - now
            given = {name: (1.0 - w) * values[now, lanes] + w * values[np.minimum(now + 1, len(values) - 1), lanes]
                     for name, values in self.inputs.items()}  # fmt: skip
        return self.machine.command(self.numbers, given, q)


def steps_back(late: Sequence[Planted], t: float, h: float, lanes: int) -> Array:
    """Return by how many whole steps the command of each record is late, (n_records,)."""
    back = np.zeros(lanes)
    for each in late:
        s = each.here()
        part = 2.0 * (t / s["period"] % 1.0) if "period" in s else 1.0
        back = back + np.rint(s["delay"] * part / h)
    return back


@dataclass(frozen=True)
class Equations:
    """Compute the rates of a machine with the effects that act within it; states of effects follow its own."""

    machine: Machine
    numbers: Numbers
    acting: Sequence[Planted]
    sizes: Sequence[Mapping[str, Any]]
    commands: Commands

    def own(self, i: int) -> slice:
        """Return where the states of an effect are."""
        first = self.machine.n_states + sum(p.form.n_states for p in self.acting[:i])
        return slice(first, first + self.acting[i].form.n_states)

    def moment(self, k: int, part: float, x: Array) -> Here:
        """Return what the machine does, its effects left out."""
        u = self.commands.at(k, part, x[0])
        effort, load = self.machine.drive(self.numbers, u, x[1]), self.machine.load(self.numbers, x)
        return Here(self.machine, (k + part) * self.commands.h, x[0], x[1], u, effort, load)

    def rates(self, k: int, part: float, x: Array) -> Array:
        """Return the rates of all states."""
        here, changes = self.moment(k, part, x), []
        added = {"drive": np.zeros_like(x[0]), "torque": np.zeros_like(x[0])}
        for i, (each, s) in enumerate(zip(self.acting, self.sizes, strict=True)):
            value = each.form.act(s, x[self.own(i)], here)
            if each.form.n_states:
                value, rates = value
                changes += rates
            if each.form.place == "signal":
                here.u, here.effort = value, self.machine.drive(self.numbers, value, x[1])
            else:
                added[each.form.place] = added[each.form.place] + value
        effort = here.effort + added["drive"]
        return np.array(
            [*self.machine.rates(self.numbers, x[: self.machine.n_states], effort, added["torque"]), *changes]
        )

    def started(self, x: Array) -> Array:
        """Return the states with those of the effects at the start."""
        here = self.moment(0, 0.0, x)
        for i, (each, s) in enumerate(zip(self.acting, self.sizes, strict=True)):
            if each.form.start is not None:
                x[self.own(i)] = each.form.start(s, here)[: each.form.n_states]
        return x

    def after(self, k: int, x: Array) -> Array:
        """Return the states after step k, with those that effects set anew."""
        for i, (each, s) in enumerate(zip(self.acting, self.sizes, strict=True)):
            if each.form.after is not None:
                x[self.own(i)] = each.form.after(s, x[self.own(i)], self.moment(k, 1.0, x))
        return x


def simulate(
    machine: Machine, numbers: Numbers, inputs: Mapping[str, Array], dt: float, n_sub: int, hold: str,
    planted: Sequence[Planted] = (), start: Array | float = 0.0,
) -> Array:  # fmt: skip
    """Simulate records side by side.

    Parameters
    ----------
    machine : Machine
        Its equations.
    numbers : Mapping
        Its true parameters and constants, each a number or (n_records,).
    inputs : Mapping
        Name -> values at the samples, (n_records, n_samples).
    dt : float
        Sample interval [s].
    n_sub : int
        Runge-Kutta steps within it.
    hold : str
        "zero" (an input keeps its value until the next sample) or "linear".
    planted : sequence of Planted
        The undeclared effects.
    start : ndarray or float
        The first states, (n_states, n_records); 0 is rest.

    Returns
    -------
    ndarray
        Outputs at every step, without noise, (n_outputs, n_records, (n_samples - 1) n_sub + 1).
    """
    lanes, n_samples = next(iter(inputs.values())).shape
    n_steps, h, base = (n_samples - 1) * n_sub, dt / n_sub, machine.n_states
    play = next((p.here()["gap"] for p in planted if p.form.place == "play"), 0.0)
    numbers = {**numbers, "play": play}
    acting = sorted((p for p in planted if p.form.place in ORDER), key=lambda p: ORDER.index(p.form.place))
    late, path = [p for p in planted if p.form.place == "command"], np.empty((n_steps + 1, base, lanes))
    columns = {name: np.ascontiguousarray(values.T) for name, values in inputs.items()}
    commands = Commands(machine, numbers, columns, n_sub, h, hold, late, path)
    equations = Equations(machine, numbers, acting, [p.here() for p in acting], commands)
    x = np.zeros((base + sum(p.form.n_states for p in acting), lanes))
    x[:base] = path[0] = start
    x = equations.started(x)
    for k in range(n_steps):
        one = equations.rates(k, 0.0, x)
        two = equations.rates(k, 0.5, x + 0.5 * h * one)
        three = equations.rates(k, 0.5, x + 0.5 * h * two)
        four = equations.rates(k, 1.0, x + h * three)
        x = x + h / 6.0 * (one + 2.0 * two + 2.0 * three + four)
        path[k + 1] = x[:base]
        x = equations.after(k, x)
    seen = np.array([path[:, output.state].T for output in machine.outputs])
    for each in (p for p in planted if p.form.place == "sensor"):
        for lane in np.flatnonzero(np.broadcast_to(each.on, lanes)):
            seen[0, lane] = each.form.act(each.sizes, seen[0, lane], h)
    return seen
