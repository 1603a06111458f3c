"""Integrate a machine with its undeclared effects: classical Runge-Kutta, all records of a campaign side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from machines.catalogue import Array, Machine, Numbers
from machines.forms import Form, Here


@dataclass(frozen=True)
class Planted:
    """Hold a form with its sizes, SI; `on`: 1 for each record that has it, 0 for the others, (n_records,)."""

    form: Form
    sizes: Mapping[str, float]
    on: Any = 1.0

    def here(self) -> dict[str, Any]:
        """Return the sizes with the strength at 0 where the effect is not there."""
        return {**self.sizes, self.form.strength: self.sizes[self.form.strength] * np.asarray(self.on)}


def simulate(
    machine: Machine, numbers: Numbers, inputs: Mapping[str, Array], dt: float, n_sub: int, hold: str,
    planted: Sequence[Planted] = (), start: Sequence[Any] = (),
) -> Array:  # fmt: skip
    """Simulate records side by side.

    Parameters
    ----------
    machine, numbers : the machine and its true parameters and constants, each a number or (n_records,).
    inputs : name -> values at the samples, (n_records, n_samples).
    dt, n_sub : sample interval [s], Runge-Kutta steps within it.
    hold : "zero" (an input keeps its value until the next sample) or "linear".
    planted : the undeclared effects.
    start : the first states, rest at 0 without.

    Returns
    -------
    ndarray
        Outputs at every step, without noise, (n_outputs, n_records, (n_samples - 1) n_sub + 1).
    """
    h, shape = dt / n_sub, next(iter(inputs.values())).shape
    n_steps, lanes = (shape[1] - 1) * n_sub, shape[0]
    numbers = {"play": 0.0, **numbers}
    acting = [p for p in planted if p.form.place != "sensor"]
    for each in acting:
        if each.form.place == "play":
            numbers["play"] = each.here()["gap"]
    late = [p for p in acting if p.form.place == "command"]
    acting = [p for p in acting if p.form.place in ("signal", "drive", "torque")]
    acting.sort(key=lambda p: ("signal", "drive", "torque").index(p.form.place))
    sizes = [p.here() for p in acting]
    base = machine.n_states
    x = np.zeros((base + sum(p.form.n_states for p in acting), lanes))
    x[:base] = np.asarray(start)[:, None] if np.ndim(start) == 1 and len(start) else (start if len(start) else 0.0)
    inputs = {name: np.ascontiguousarray(values.T) for name, values in inputs.items()}
    path = np.empty((n_steps + 1, base, lanes))

    def given(k: int, part: float, back: Any) -> dict[str, Array]:
        """Return the inputs at step k plus a part of it, `back` steps earlier, (n_records,)."""
        now = np.maximum(k + part - back, 0.0) / n_sub
        # a value that is held belongs to the step that it begins, also for the last stage of the step before
        first = np.maximum(np.floor(np.maximum(k - back, 0.0) / n_sub + 1e-9), 0.0).astype(int)
        if hold == "zero":
            return {name: values[first, columns] for name, values in inputs.items()}
        second = np.minimum(first + 1, shape[1] - 1)
        w = now - first
        return {name: (1.0 - w) * v[first, columns] + w * v[second, columns] for name, v in inputs.items()}

    columns = np.arange(lanes)

    def command(k: int, part: float, q: Array) -> Array:
        if not late:
            return machine.command(numbers, given(k, part, np.zeros(lanes)), q)
        back = steps_back(late, k * h, h, lanes)
        if machine.controlled:
            place = np.maximum(k + part - back, 0.0)
            i = np.minimum(np.floor(place).astype(int), k)
            j = np.minimum(i + 1, k)
            w = place - i
            earlier = (1.0 - w) * path[i, 0, columns] + w * path[j, 0, columns]
            q = np.where(back > 0, earlier, q)
        return machine.command(numbers, given(k, part, back), q)

    def rates(k: int, part: float, x: Array) -> tuple[Array, Here]:
        at = Here(machine, (k + part) * h, x[0], x[1], command(k, part, x[0]), x[0], x[0])
        at.load = machine.load(numbers, x)
        extra, torque = np.zeros(lanes), np.zeros(lanes)
        own: list[Array] = []
        z = base
        effort_known = False
        for each, s in zip(acting, sizes, strict=True):
            if each.form.place != "signal" and not effort_known:
                at.effort, effort_known = machine.drive(numbers, at.u, x[1]), True
            value, changes = each.form.act(s, x[z : z + each.form.n_states], at)
            z += each.form.n_states
            own += changes
            if each.form.place == "signal":
                at.u = value
            elif each.form.place == "drive":
                extra = extra + value
            else:
                torque = torque + value
        if not effort_known:
            at.effort = machine.drive(numbers, at.u, x[1])
        return np.array([*machine.rates(numbers, x[:base], at.effort + extra, torque), *own]), at

    path[0] = x[:base]
    z = base
    at = Here(machine, 0.0, x[0], x[1], command(0, 0.0, x[0]), x[0], x[0])
    at.effort, at.load = machine.drive(numbers, at.u, x[1]), machine.load(numbers, x)
    for each, s in zip(acting, sizes, strict=True):
        if each.form.start is not None:
            x[z : z + each.form.n_states] = each.form.start(s, at)[: each.form.n_states]
        z += each.form.n_states
    for k in range(n_steps):
        one, _ = rates(k, 0.0, x)
        two, _ = rates(k, 0.5, x + 0.5 * h * one)
        three, _ = rates(k, 0.5, x + 0.5 * h * two)
        four, at = rates(k, 1.0, x + h * three)
        x = x + h / 6.0 * (one + 2.0 * two + 2.0 * three + four)
        path[k + 1] = x[:base]
        z = base
        for each, s in zip(acting, sizes, strict=True):
            if each.form.after is not None:
                at.u = command(k, 1.0, x[0])
                x[z : z + each.form.n_states] = each.form.after(s, x[z : z + each.form.n_states], at)
            z += each.form.n_states
    seen = np.array([path[:, output.state].T for output in machine.outputs])
    for each in planted:
        if each.form.place == "sensor":
            on = np.broadcast_to(np.asarray(each.on), lanes)
            for lane in np.flatnonzero(on):
                seen[0, lane] = each.form.act(each.sizes, seen[0, lane], h)
    return seen


def steps_back(late: Sequence[Planted], t: float, h: float, lanes: int) -> Array:
    """Return by how many whole steps the command of each record is late, (n_records,)."""
    back = np.zeros(lanes)
    for each in late:
        s = each.here()
        part = 2.0 * (t / s["period"] % 1.0) if "period" in s else 1.0
        back = back + np.rint(s["delay"] * part / h)
    return back
