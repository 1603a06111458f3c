"""What contracts find, and the candidates and manoeuvres on which they are tried."""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from armid.engine import probes
from armid.errors import ArmidError
from armid.model import Array, Effect, Input, Manoeuvre, Model, Parameter, Plant
from armid.model.graph import LATE_LEAVES

TRIAL_SAMPLES, TRIAL_INTERVAL = 401, 2e-3
# The moment of gravity that a hanging axis gets, as a share of the effort scale.
GRAVITY = 0.4


@dataclass(frozen=True)
class ContractPoint:
    """One point of a contract: its name, whether it holds, what was seen, and whether nobody can tell but the user."""

    name: str
    passed: bool
    sentence: str
    unclear: bool = False


def check_parameters(parameters: Iterable[Parameter]) -> list[ContractPoint]:
    given = list(parameters)
    outside = [
        p.name for p in given if not all(p.low <= v <= p.high for v in (p.null, p.fixed, p.nominal) if v is not None)
    ]
    named = "the only parameter" if len(given) == 1 else f"all {len(given)} parameters"
    return [
        finding("bounds", [p.name for p in given if not np.isfinite([p.low, p.high]).all()],
                "bounds of {} are not finite", f"finite and ordered for {named}"),
        finding("values", outside,
                "null, fixed or nominal value of {} is outside the bounds", f"inside the bounds for {named}"),
        finding("units", [p.name for p in given if not p.unit.strip()],
                "{} has no unit: '1' is expected for a plain number", f"named for {named}"),
    ]  # fmt: skip


def finding(name: str, wrong: list[str], says: str, otherwise: str) -> ContractPoint:
    return ContractPoint(name, not wrong, says.format(", ".join(wrong)) if wrong else otherwise)


def nominal(model: Model) -> Array:
    return np.array([middle(p) if p.null is None else p.null for p in model.parameters.values()])


def middle(p: Parameter) -> float:
    return next((v for v in (p.nominal, p.fixed) if v is not None), 0.5 * (p.low + p.high))


def over_box(model: Model, n_candidates: int) -> Array:
    parameters = model.parameters.values()
    low, high = (np.array([getattr(p, side) for p in parameters]) for side in ("low", "high"))
    return probes(low, high, n_candidates)


def at_null(model: Model, n_candidates: int) -> Array:
    """Return candidates spread over the bounds, what has a null value at it, (n_candidates, n_parameters)."""
    nulls = np.array([np.nan if p.null is None else p.null for p in model.parameters.values()])
    return np.where(np.isnan(nulls), over_box(model, n_candidates), nulls)


def away(model: Model, effect: Effect, share: float) -> Array:
    """Return nominal values, those of an effect at a share of the way from null to its farther bound."""
    values = dict(zip(model.parameters, nominal(model), strict=True))
    for own in effect.parameters:
        name = f"{effect.name}.{own.name}"
        p = model.parameters[name]
        if p.null is not None:
            farther = p.high if p.high - p.null >= p.null - p.low else p.low
            values[name] = p.null + share * (farther - p.null)
    return np.array(list(values.values()))


def corners(model: Model, effect: Effect) -> Array:
    names = [f"{effect.name}.{p.name}" for p in effect.parameters if p.fixed is None]
    bounds = [(model.parameters[n].low, model.parameters[n].high) for n in names]
    values = dict(zip(model.parameters, nominal(model), strict=True))
    return np.array([list((values | dict(zip(names, corner, strict=True))).values()) for corner in product(*bounds)])


def strengths_of(effect: Effect) -> list[Parameter]:
    """Return the parameters with a null value that no declaration fixes."""
    return [p for p in effect.parameters if p.null is not None and p.fixed is None]


def from_null(model: Model, effect: Effect, shares: Array) -> Array:
    """Return nominal values with each strength of an effect in turn at shares of its range from its null.

    Shape (n_strengths, n_shares, n_parameters); into the range where the null is a bound.
    """
    start, names = nominal(model), list(model.parameters)
    moved = []
    for name in (f"{effect.name}.{p.name}" for p in strengths_of(effect)):
        p, rows = model.parameters[name], np.tile(start, (len(shares), 1))
        assert p.null is not None
        rows[:, names.index(name)] += shares * (p.high - p.low) * (1.0 if p.high > p.null else -1.0)
        moved.append(rows)
    return np.array(moved)


def trial_manoeuvres(plant: Plant) -> list[Manoeuvre]:
    """Return two manoeuvres of a plant: there and back; inputs are a sine and a sawtooth over their typical range."""
    times = TRIAL_INTERVAL * np.arange(TRIAL_SAMPLES)
    shapes = (np.sin(9.0 * times), 2.0 * ((1.3 * times) % 1.0) - 1.0)
    gain = next((c.value for c in plant.constants if c.name == "gain"), 1.0)
    size = 0.5 * plant.scales.effort / (gain or 1.0)

    def moved(driven: Input, shape: Array) -> Array:
        if driven.typical is None:
            return size * shape
        low, high = driven.typical
        return 0.5 * (low + high) + 0.5 * (high - low) * shape

    return [
        Manoeuvre(
            TRIAL_INTERVAL, TRIAL_SAMPLES, constants_of(plant, turned), {i.name: moved(i, shape) for i in plant.inputs}
        )
        for turned, shape in enumerate(shapes)
    ]


def constants_of(plant: Plant, turned: int) -> dict[str, float]:
    """Return the constants of a manoeuvre; turned: start and target change places where the plant has both.

    A moment of gravity that is 0 by default becomes part of the effort scale: what acts on it is then seen.
    """
    keys = {k.key: k.constant for k in plant.keys}
    values = {c.name: c.value for c in plant.constants}
    if values.get("gravity_moment") == 0.0:
        return {"gravity_moment": GRAVITY * plant.scales.effort}
    start, target = keys.get("start_angle_deg"), keys.get("target_angle_deg")
    if not turned or start is None or target is None:
        return {}
    return {start: values[target], target: values[start]}


# A slow, independent way to simulate a model: its plain functions, one candidate, scipy's integrator.
#
# It shares nothing with the engine but the graph of equations, so that it can judge the engine.

Latches = tuple[float, ...]
TRIAL_TOLERANCE = 1e-10
# Longest step in sample intervals, so that no guard changes its sign twice in one.
LONGEST_OF_ORACLE = 4.0
# Evaluations of the equations; a usual motion takes some 10,000.
MOST_RATES = 100_000


def simulate_plainly(model: Model, manoeuvre: Manoeuvre, candidate: Array) -> Array:
    """Return the recorded signals of one candidate, (n_outputs, n_samples), error about 1e-9 of their size.

    DOP853, restarted at every kink and switch, at every sample where inputs drive the machine, and where what is late
    may jump or bend. No piece is longer than a dead time, so that late states are known from the pieces before.
    """
    plain = PlainModel(model, manoeuvre, candidate)
    times, states = manoeuvre.times(), plain.start()
    closed = plain.switched(times[0], states, tuple(0.0 for _ in plain.latches))
    out = np.empty((len(model.plant.outputs), len(times)))
    out[:, 0] = plain.recorded(times[0], states, closed)
    begin, n = float(times[0]), 1
    ends = plain.ends(times)
    for end in ends:
        plain.sample = n - 1
        while begin < end:
            plain.middle = 0.5 * (begin + end)
            run = plain.integrated(begin, states, closed, np.append(times[n:][times[n:] < end], end))
            if run.status < 0:
                raise ArmidError(f"scipy does not get beyond {begin:.3g} s: {run.message}")
            hit = [(t[-1], y[-1]) for t, y in zip(run.t_events or [], run.y_events or [], strict=True) if len(t)]
            begin, states = hit[0] if run.status == 1 else (run.t[-1], run.y[:, -1])
            plain.remember(run)
            before, closed = closed, plain.switched(float(begin), states, closed)
            for t, y in zip(run.t, np.reshape(run.y, (len(states), -1)).T, strict=True):
                if n < len(times) and t == times[n]:
                    plain.sample = n
                    plain.middle = np.nextafter(t, np.inf)
                    out[:, n] = plain.recorded(t, y, closed if t == begin else before)
                    n += 1
    return out


class PlainModel:
    """Evaluate the equations of a model with plain functions, at one whole candidate, SI."""

    def __init__(self, model: Model, manoeuvre: Manoeuvre, candidate: Array) -> None:
        self.graph = model.graph
        self.states = [k.replace(".", "__") for k in model.states]
        self.latches = [k.replace(".", "__") for k in model.latches]
        self.signals = [o.signal for o in model.plant.outputs]
        self.known = dict(zip((k.replace(".", "__") for k in model.parameters), map(float, candidate), strict=True))
        self.known |= dict(zip(model.constants, model.constant_values(manoeuvre.constants), strict=True))
        self.manoeuvre, self.inputs = manoeuvre, {i.name: i.hold or manoeuvre.hold for i in model.plant.inputs}
        guards = [n.key for n in self.graph.of_kind("guard")]
        self.kinks = [g for g in guards if g.removeprefix("guard__") not in self.latches]
        self.n_rates = 0
        # the sample whose value a held input has, and a time inside the piece that is integrated
        self.sample, self.middle = 0, manoeuvre.start_time
        self.late = {n.key: (n.needs[0], max(sum(self.known[k] for k in n.by), 0.0))
                     for n in self.graph.of_kind(*LATE_LEAVES)}  # fmt: skip
        self.pieces: list[tuple[float, Any]] = []

    def evaluate(self, keys: list[str], values: dict[str, Any]) -> list[Any]:
        known = self.graph.values(keys, self.known | values)
        return [known[k] for k in keys]

    def start(self) -> Array:
        begin = self.manoeuvre.start_time
        driven = {"time": begin} | {name: self.input_at(name, begin) for name in self.inputs}
        return np.array(self.evaluate([f"initial__{s}" for s in self.states], driven), dtype=float)

    def moment(self, time: float, states: Array, closed: Latches) -> dict[str, Any]:
        values: dict[str, Any] = dict(zip(self.states, states, strict=True))
        values |= dict(zip(self.latches, closed, strict=True))
        for key, (of, delay) in self.late.items():
            values[key] = self.late_value(of, delay, time, values)
        return values | {"time": time} | {name: self.input_at(name, time) for name in self.inputs}

    def ends(self, times: Array) -> Array:
        """Return where pieces end: at samples where inputs drive, a dead time after them, and after every dead time."""
        delays = {delay for _, delay in self.late.values() if 0.0 < delay < times[-1] - times[0]}
        if not (self.inputs or delays):
            return times[-1:]
        instants = [times[1:], *(times + delay for delay in delays)]
        if any(of in self.states for of, _ in self.late.values()) and delays:
            instants.append(np.arange(times[0], times[-1], min(delays))[1:])
        ends = np.unique(np.concatenate(instants))
        # what lies within rounding of a sample is that sample
        near = np.abs(ends[:, np.newaxis] - times).min(axis=1)
        ends = ends[(near == 0.0) | (near > 1e-9 * self.manoeuvre.interval)]
        return np.asarray(ends[(ends > times[0]) & (ends <= times[-1])])

    def remember(self, run: Any) -> None:
        if run.sol is not None and len(run.sol.ts) > 1:
            self.pieces.append((float(run.sol.ts[-1]), run.sol))

    def late_value(self, of: str, delay: float, time: float, values: Mapping[str, Any]) -> float:
        """Return a state or an input a dead time before; before the start its first value."""
        if of in self.inputs:
            return self.input_at(of, time - delay, self.middle - delay)
        if delay == 0.0:
            return float(values[of])
        when, place = time - delay, self.states.index(of)
        if when <= self.manoeuvre.start_time or not self.pieces:
            return float(self.start()[place])
        i = min(bisect_left(self.pieces, when - 1e-13, key=lambda piece: piece[0]), len(self.pieces) - 1)
        return float(self.pieces[i][1](when)[place])

    def input_at(self, name: str, time: float, inside: float | None = None) -> float:
        """Return an input; inside: a time at which it has the same value where it is held, None: the present sample."""
        samples, begin, interval = self.manoeuvre.inputs[name], self.manoeuvre.start_time, self.manoeuvre.interval
        if self.inputs[name] == "zero":
            return float(samples[self.sample if inside is None else max(int(np.floor((inside - begin) / interval)), 0)])
        return float(np.interp((time - begin) / interval, np.arange(len(samples)), samples))

    def rates(self, time: float, states: Array, closed: Latches) -> Array:
        self.n_rates += 1
        if self.n_rates > MOST_RATES:
            raise ArmidError(f"scipy does not get beyond {time:.3g} s: the equations are stiff there, or jump where no "
                             "guard is declared")  # fmt: skip
        keys = [f"rate__{s}" for s in self.states]
        return np.array(self.evaluate(keys, self.moment(time, states, closed)), dtype=float)

    def recorded(self, time: float, states: Array, closed: Latches) -> list[float]:
        return self.evaluate(self.signals, self.moment(time, states, closed))

    def switched(self, time: float, states: Array, closed: Latches) -> Latches:
        guards = self.evaluate([f"guard__{k}" for k in self.latches], self.moment(time, states, closed))
        return tuple(1.0 if c or guard <= 1e-12 else 0.0 for guard, c in zip(guards, closed, strict=True))

    def integrated(self, begin: float, states: Array, closed: Latches, times: Array) -> Any:
        """Return scipy's solution at some times, which ends where a guard changes its sign."""
        keys = [f"guard__{k}" for k, c in zip(self.latches, closed, strict=True) if not c] + self.kinks
        return solve_ivp(
            lambda t, y: self.rates(t, y, closed), (begin, times[-1]), states, method="DOP853", rtol=TRIAL_TOLERANCE,
            atol=TRIAL_TOLERANCE, t_eval=times, dense_output=bool(self.late),
            max_step=LONGEST_OF_ORACLE * self.manoeuvre.interval,
            events=[self.event(key, begin, closed) for key in keys] or None,
        )  # fmt: skip

    def event(self, key: str, begin: float, closed: Latches) -> Callable[[float, Array], float]:
        """Return a guard as an event that ends the integration, but not at once where it has just ended."""

        def event(time: float, states: Array) -> float:
            (value,) = self.evaluate([key], self.moment(time, states, closed))
            # nor where a machine rests exactly on it
            return value if time > begin + 1e-9 and value != 0.0 else 1.0 if value >= 0.0 else -1.0

        event.terminal = True  # type: ignore[attr-defined]
        return event
