"""How the simulated arm moves: its equations, a stage of a manoeuvre, a late controller, the whole manoeuvre."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from stand import RefusalError
from stand.arm import GRAVITY, SHELL_INERTIA, Arm, Manoeuvre
from stand.effects import (
    Effects,
    base_rate,
    command,
    coupling,
    drive,
    flux,
    friction,
    hysteresis_rates,
    smooth_sign,
    unlisted_torque,
)

FloatArray = npt.NDArray[np.float64]
State = dict[str, float]


@dataclass(frozen=True)
class Motion:
    """Join the arm, a manoeuvre and undeclared effects into d(state)/dt.

    States: angle [rad], speed [rad/s], current [A] of one of two equal motors; an effect that needs a state appends
    it, so that without effects the equations are those of the paper and nothing else.
    """

    arm: Arm
    manoeuvre: Manoeuvre
    effects: Effects = field(default_factory=Effects)

    @cached_property
    def rocks(self) -> bool:
        """Tell whether a shell is there and loose in its tray."""
        return self.effects.rocking_hz > 0.0 and self.manoeuvre.shell

    @cached_property
    def inertia(self) -> float:
        """Give the inertia that turns with the arm [kg m2]: J of Eq 2, less a loose shell, less an elastic drive."""
        of_drive = self.drive_inertia if self.effects.drive_compliance else 0.0
        return self.arm.inertia(self.manoeuvre.shell) - of_drive - (SHELL_INERTIA if self.rocks else 0.0)

    @cached_property
    def drive_inertia(self) -> float:
        """Give the part of J that is not I6 [kg m2]: motors, gears and worm."""
        return self.arm.inertia(self.manoeuvre.shell) - self.arm.load(self.manoeuvre.shell).inertia

    @cached_property
    def start(self) -> State:
        """Give the state at t = 0, when the brake opens: all at rest, the gas on its polytrope."""
        angle, effects = self.manoeuvre.start, self.effects
        state = {"angle": angle, "speed": 0.0, "current": 0.0}
        if effects.gas_heat_loss:
            state["pressure"] = self.arm.pressure(angle)
        if effects.tachometer_lag:
            state["tachometer"] = 0.0
        if effects.drive_compliance:
            state |= {"drive_angle": angle, "drive_speed": 0.0}
        if self.rocks:
            state |= {"shell_angle": angle, "shell_speed": 0.0}
        if effects.base_compliance:
            state |= {"base": 0.0, "base_speed": 0.0}
        if effects.gyro_bandwidth_hz:
            state |= {"gyro": 0.0, "gyro_rate": 0.0}
        counters = {
            "heat": effects.winding_heating,
            "charge": effects.motor_fade,
            "clock": effects.sway or effects.slipping_ripple,
            "dahl": effects.dahl,
            "bristle": effects.lugre,
            "bouc_wen": effects.bouc_wen,
            "drive_torque": effects.actuator_lag,
        }
        return state | {name: 0.0 for name, size in counters.items() if size}

    def rates(self, values: FloatArray, closed_loop: bool, seen: FloatArray | None = None) -> list[float]:
        """Give d(state)/dt in the order of `start`, in the open-loop or the closed-loop stage.

        J d omega/dt = 2 T_d i1 eta1 eta2 eta3 - T_R + T_G (Eqs 1, 3) and L dI/dt = u - R I - E (Eq 7), each with
        the terms of the effects that are on. `seen` is the state that the controller knows of, None for the present.
        """
        now = dict(zip(self.start, values.tolist(), strict=True))
        known = now if seen is None else dict(zip(self.start, seen.tolist(), strict=True))
        torque = self._torque(now)
        voltage = command(self.arm, self.effects, self.manoeuvre, known, closed_loop)
        rate = {"angle": now["speed"], "speed": torque / self.inertia, "current": self._current_rate(now, voltage)}
        rate |= self._added_rates(now, torque)
        return [rate[name] for name in self.start]

    def _torque(self, now: State) -> float:
        """Sum the torques on the arm [N m]."""
        arm, effects = self.arm, self.effects
        balance = self._balance(now)
        passed = coupling(effects, now) if "drive_angle" in now else self._drive(now)
        declared = passed - balance + self._gravity(now) + self._cogging(now)
        unlisted = unlisted_torque(arm, effects, now, self.manoeuvre.start, balance)
        return declared - friction(arm, effects, now) - self._tray(now) + effects.torque_offset + unlisted

    def _drive(self, now: State) -> float:
        """Give the torque of the drive at the arm [N m], which an actuator may follow late."""
        return now["drive_torque"] if "drive_torque" in now else drive(self.arm, self.effects, now)

    def _cogging(self, now: State) -> float:
        """A sin(w theta) + second A sin(2 w theta) [N m]."""
        waves = self.effects.cogging_waves * now["angle"]
        return self.effects.cogging * (math.sin(waves) + self.effects.cogging_second * math.sin(2.0 * waves))

    def _gravity(self, now: State) -> float:
        """T_G = m g L cos(theta + alpha) [N m] (Eq 4), the tilt of the trunnion and of the base added to alpha."""
        load = self.arm.load(self.manoeuvre.shell)
        tilt = math.radians(self.effects.tilt_deg) + now.get("base", 0.0)
        return load.mass * GRAVITY * load.lever * math.cos(now["angle"] + self.arm.gravity_angle + tilt)

    def _balance(self, now: State) -> float:
        """T_R = l S p [N m] (Eq 6); the pressure is a state when the gas exchanges heat.

        A narrow oil line adds c omega abs(omega) to it.
        """
        pressure = now["pressure"] if "pressure" in now else self.arm.pressure(now["angle"])
        pressure += self.effects.line_loss * now["speed"] * abs(now["speed"])
        return self.arm.piston_lever * self.arm.piston_area * pressure

    def _tray(self, now: State) -> float:
        """J_s (w^2 s (1 + (s/s_0)^2) + 2 z w s') [N m], w = 2 pi f: what the tray's spring and damper pass on.

        s = theta - phi is the stretch, where the tray has play what is beyond it, and s_0 the one at which the spring
        is twice as stiff (none by default). The weight of the shell stays on the arm, so the spring is at rest when the
        arm is.
        """
        if not self.rocks:
            return 0.0
        effects, natural = self.effects, 2.0 * math.pi * self.effects.rocking_hz
        stretch, slip = now["angle"] - now["shell_angle"], now["speed"] - now["shell_speed"]
        if effects.rocking_play:
            stretch -= min(max(stretch, -effects.rocking_play), effects.rocking_play)
        if effects.rocking_stop:
            stretch *= 1.0 + (stretch / effects.rocking_stop) ** 2
        return SHELL_INERTIA * natural * (natural * stretch + 2.0 * effects.rocking_damping * slip)

    def _current_rate(self, now: State, command_volt: float) -> float:
        """L dI/dt = u - 2 R_s I - R I - E - V_b sgn(I), E = C_e Phi i1 omega, signed current (Eq 7) [A/s]."""
        arm, effects, current = self.arm, self.effects, now["current"]
        voltage = command_volt - 2.0 * effects.supply_sag * current
        emf = arm.emf_constant * flux(arm, effects, now) * arm.ratio_motor * now.get("drive_speed", now["speed"])
        resistance = arm.resistance * (1.0 + effects.winding_heating * now.get("heat", 0.0))
        brushes = effects.brush_drop * smooth_sign(current, effects.brush_width, effects.brush_tanh)
        return (voltage - resistance * current - emf - brushes) / arm.inductance

    def _added_rates(self, now: State, torque: float) -> State:
        """Give the rates of the states that effects appended."""
        rate: State = {}
        if "pressure" in now:
            rate["pressure"] = self._pressure_rate(now)
        if "tachometer" in now:
            turning = now.get("drive_speed", now["speed"])
            rate["tachometer"] = (turning - now["tachometer"]) / self.effects.tachometer_lag
        if "shell_speed" in now:
            rate |= {"shell_angle": now["shell_speed"], "shell_speed": self._tray(now) / SHELL_INERTIA}
        if "base" in now:
            rate |= {"base": now["base_speed"], "base_speed": base_rate(self.effects, now, -torque)}
        if "gyro" in now:
            rate |= {"gyro": now["gyro_rate"], "gyro_rate": self._gyro_pull(now)}
        if "drive_angle" in now:
            left = self._drive(now) - coupling(self.effects, now)
            rate |= {"drive_angle": now["drive_speed"], "drive_speed": left / self.drive_inertia}
        if "drive_torque" in now:
            wanted = drive(self.arm, self.effects, now)
            rate["drive_torque"] = (wanted - now["drive_torque"]) / self.effects.actuator_lag
        rate |= hysteresis_rates(self.effects, now)
        if "heat" in now:
            rate["heat"] = now["current"] ** 2 - self.effects.winding_cooling * now["heat"]
        return rate | {"charge": abs(now["current"]), "clock": 1.0}

    def _pressure_rate(self, now: State) -> float:
        """dp/dt = n p S l omega / V - (p - p0 V0/V) / tau [Pa/s]: compression, and heat lost toward the isotherm."""
        arm, volume = self.arm, self.arm.volume(now["angle"])
        squeeze = arm.n * now["pressure"] * arm.piston_area * arm.piston_lever * now["speed"] / volume
        return squeeze - (now["pressure"] - arm.p0 * arm.gas_volume / volume) / self.effects.gas_heat_loss

    def _gyro_pull(self, now: State) -> float:
        """Second-order lag y'' = w^2 (omega - y) - 2 z w y', w = 2 pi f, of the gyro's own mass [rad/s3]."""
        natural = 2.0 * math.pi * self.effects.gyro_bandwidth_hz
        return natural * (natural * (now["speed"] - now["gyro"]) - 2.0 * self.effects.gyro_damping * now["gyro_rate"])


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


def is_late(motion: Motion) -> bool:
    """Tell whether the controller acts on an earlier state than the present one."""
    return bool(motion.effects.controller_delay or motion.effects.controller_period)


def notice(motion: Motion, switch: float) -> float:
    """Give the time [s] at which the controller learns of the switch E: a delay after it, or at its next sample."""
    period = motion.effects.controller_period
    return math.ceil(switch / period) * period if period else switch + motion.effects.controller_delay


def late_stage(
    motion: Motion, state: FloatArray, switch: float | None, samples: FloatArray, tolerance: float
) -> FloatArray:
    """Integrate from the switch E [s] to the last sample, each sample a column; None starts in closed loop at t = 0.

    The delay is that of a delay line and not an approximation: by the method of steps each piece is no longer than
    the delay, so that all the controller sees in it lies in the piece before, and every kink falls between pieces.
    """
    pieces = _Pieces(samples)
    begin, seen = 0.0, _held(state)
    if switch is not None:
        begin = min(notice(motion, switch), float(samples[-1]))
        if begin > switch:
            found = open_piece(motion, state, (switch, begin), tolerance)
            state, seen = pieces.add(found), found.sol
    length = motion.effects.controller_delay or motion.effects.controller_period
    count = 0
    while pieces.missing:
        span = (begin + count * length, min(begin + (count + 1) * length, float(samples[-1])))
        known = _held(state) if motion.effects.controller_period else _delayed(seen, length)
        found = closed_piece(motion, state, span, tolerance, known)
        state, seen, count = pieces.add(found), found.sol, count + 1
    return np.hstack(pieces.columns)


def _held(state: FloatArray) -> Signal:
    return lambda _time: state


def _delayed(seen: Callable[[float], FloatArray], delay: float) -> Signal:
    return lambda time: seen(time - delay)


class _Pieces:
    """Collect the samples of one piece after the other."""

    def __init__(self, samples: FloatArray) -> None:
        self.samples, self.count = samples, 0
        self.columns: list[FloatArray] = []

    @property
    def missing(self) -> bool:
        """Tell whether samples are still to come."""
        return self.count < self.samples.size

    def add(self, found: Any) -> FloatArray:
        """Take the samples that a piece reaches and give its last state."""
        reached = int(np.searchsorted(self.samples, found.t[-1], side="right"))
        if reached > self.count:
            self.columns.append(found.sol(self.samples[self.count : reached]))
            self.count = reached
        return np.asarray(found.y[:, -1])


SAMPLES_PER_SECOND = 1000
TOLERANCE = 1e-11


@dataclass(frozen=True)
class Trajectory:
    """Hold a manoeuvre sampled at 1 kHz from t = 0: time [s], the states by name, the speed the gyro shows [rad/s].

    `switch_s` is the instant at which the closed loop begins [s], or None when the arm does not get there.
    """

    time_s: FloatArray
    states: dict[str, FloatArray]
    gyro: FloatArray
    switch_s: float | None


def simulate(motion: Motion, duration_s: float, tolerance: float = TOLERANCE) -> Trajectory:
    """Integrate a manoeuvre from rest and sample it at 1 kHz; `tolerance` is relative and absolute.

    DOP853 runs to the switch E, the first instant at which abs(theta_D - theta) falls to delta_E, and starts again
    from there in closed loop; a stroke no longer than delta_E is in closed loop from the start.
    Raises RefusalError when the arm leaves its travel, or when the equations are too stiff or fail.
    """
    time = np.arange(round(duration_s * SAMPLES_PER_SECOND) + 1) / SAMPLES_PER_SECOND
    start = np.array(list(motion.start.values()))
    if abs(motion.manoeuvre.target - motion.manoeuvre.start) <= motion.arm.switch_distance:
        return _trajectory(motion, time, _closed_loop(motion, start, None, time, tolerance), 0.0)
    before = open_stage(motion, start, time, tolerance)
    if not before.t_events[0].size:
        return _trajectory(motion, time, before.y, None)
    switch, state = float(before.t_events[0][0]), before.y_events[0][0]
    begins = notice(motion, switch) if is_late(motion) else switch
    rest = time[before.y.shape[1] :]
    if not rest.size:
        return _trajectory(motion, time, before.y, begins)
    after = _closed_loop(motion, state, switch, rest, tolerance)
    return _trajectory(motion, time, np.hstack((before.y, after)), begins)


def _closed_loop(
    motion: Motion, state: FloatArray, switch: float | None, samples: FloatArray, tolerance: float
) -> FloatArray:
    """Integrate from the switch E, or from t = 0 where there is none, to the last sample."""
    if is_late(motion):
        return late_stage(motion, state, switch, samples, tolerance)
    return np.asarray(closed_stage(motion, state, switch or 0.0, samples, tolerance).y)


def _trajectory(motion: Motion, time: FloatArray, values: FloatArray, switch_s: float | None) -> Trajectory:
    """Name the states and read the gyro: its lagged speed, times 1 + scale error, plus bias."""
    states = dict(zip(motion.start, values, strict=True))
    effects = motion.effects
    seen = states.get("gyro", states["speed"])
    gyro = seen * (1.0 + effects.gyro_scale) + math.radians(effects.gyro_bias_deg_s)
    return Trajectory(time, states, gyro, switch_s)
