"""Integrate one stage of a manoeuvre."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from stand.motion import Motion
from stand.refusal import RefusalError

FloatArray = npt.NDArray[np.float64]
Signal = Callable[[float], FloatArray]
MOST_RATES = 300_000
"""Evaluations of the equations that a stage may take; a usual one takes some 10,000."""


def open_stage(motion: Motion, state: FloatArray, samples: FloatArray, tolerance: float) -> Any:
    """Integrate from t = 0 under full supply until the switch E, which is the first event, or the last sample."""
    span = (0.0, float(samples[-1]))
    return _integrate(motion, state, span, tolerance, _ending(_to_switch(motion), True), t_eval=samples)


def open_piece(motion: Motion, state: FloatArray, span: tuple[float, float], tolerance: float) -> Any:
    """Integrate a span [s] under full supply past the switch E, with a solution at any time of it."""
    return _integrate(motion, state, span, tolerance, _ending(_to_switch(motion), False), dense_output=True)


def closed_stage(motion: Motion, state: FloatArray, begin: float, samples: FloatArray, tolerance: float) -> Any:
    """Integrate in closed loop from `begin` [s] to the last sample."""
    span = (begin, float(samples[-1]))
    never = _ending(_to_switch(motion), False)
    return _integrate(motion, state, span, tolerance, never, closed_loop=True, t_eval=samples)


def closed_piece(motion: Motion, state: FloatArray, span: tuple[float, float], tolerance: float, seen: Signal) -> Any:
    """Integrate a span [s] in closed loop with a controller that knows the state `seen` at each time."""
    never = _ending(_to_switch(motion), False)
    return _integrate(motion, state, span, tolerance, never, closed_loop=True, seen=seen, dense_output=True)


def _integrate(
    motion: Motion,
    state: FloatArray,
    span: tuple[float, float],
    tolerance: float,
    switch: Any,
    closed_loop: bool = False,
    seen: Signal | None = None,
    **wanted: Any,
) -> Any:
    """Integrate by DOP853; the first event is the switch E, the second the end of the travel, which is refused."""
    count = itertools.count()

    def rates(time: float, values: FloatArray) -> list[float]:
        if next(count) > MOST_RATES:
            raise RefusalError(f"{motion.manoeuvre.name} is too stiff to integrate: an effect is too fast or too large")
        return motion.rates(values, closed_loop, seen(time) if seen else None)

    events = [switch, _ending(_to_stops(motion), True)]
    found: Any = solve_ivp(rates, span, state, method="DOP853", events=events, rtol=tolerance, atol=tolerance, **wanted)
    if found.t_events[1].size:
        where = f"at {found.t_events[1][0]:.3f} s, and the stand has no end stops"
        raise RefusalError(f"{motion.manoeuvre.name} would leave the travel of -55 to 45 deg {where}")
    if not found.success or not np.isfinite(found.y).all():
        raise RefusalError(f"{motion.manoeuvre.name} cannot be integrated with these values: {found.message}")
    return found


def _to_switch(motion: Motion) -> Callable[[FloatArray], float]:
    """Give the distance to E [rad]: abs(theta_D - theta) - delta_E."""
    target, distance = motion.manoeuvre.target, motion.arm.switch_distance
    return lambda values: abs(target - float(values[0])) - distance


def _to_stops(motion: Motion) -> Callable[[FloatArray], float]:
    """Give the distance to the nearer end of the travel [rad]."""
    low, high = motion.arm.travel
    return lambda values: min(float(values[0]) - low, high - float(values[0]))


def _ending(distance: Callable[[FloatArray], float], terminal: bool) -> Any:
    """Make an event of scipy where a distance falls to 0."""

    def event(_time: float, values: FloatArray) -> float:
        return distance(values)

    event.terminal = terminal  # type: ignore[attr-defined]
    event.direction = -1.0  # type: ignore[attr-defined]
    return event
