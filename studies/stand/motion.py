"""How the simulated arm moves: its equations, a stage of a manoeuvre, a late controller, the whole manoeuvre."""

import itertools
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from stand import RefusalError
from stand.arm import GRAVITY, SHELL_INERTIA, Arm, Manoeuvre, State
from stand.effects import Effects, command, coupling, current_rate, drive, friction, hysteresis_rates, unlisted_torque

FloatArray = npt.NDArray[np.float64]


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
        sizes = {
            "pressure": effects.gas_heat_loss,
            "tachometer": effects.tachometer_lag,
            **dict.fromkeys(("drive_angle", "drive_speed"), effects.drive_compliance),
            **dict.fromkeys(("shell_angle", "shell_speed"), self.rocks),
            **dict.fromkeys(("base", "base_speed"), effects.base_compliance),
            **dict.fromkeys(("gyro", "gyro_rate"), effects.gyro_bandwidth_hz),
            "heat": effects.winding_heating,
            "charge": effects.motor_fade,
            "clock": effects.sway or effects.slipping_ripple,
            "dahl": effects.dahl,
            "bristle": effects.lugre,
            "bouc_wen": effects.bouc_wen,
            "drive_torque": effects.actuator_lag,
        }
        begins = {"angle": angle, "drive_angle": angle, "shell_angle": angle, "pressure": self.arm.pressure(angle)}
        on = ("angle", "speed", "current", *(name for name, size in sizes.items() if size))
        return {name: begins.get(name, 0.0) for name in on}

    def rates(self, values: FloatArray, closed_loop: bool, seen: FloatArray | None = None) -> list[float]:
        """Give d(state)/dt in the order of `start`, in the open-loop or the closed-loop stage.

        J d omega/dt = 2 T_d i1 eta1 eta2 eta3 - T_R + T_G (Eqs 1, 3) and L dI/dt = u - R I - E (Eq 7), each with
        the terms of the effects that are on. `seen` is the state that the controller knows of, None for the present.
        """
        now = dict(zip(self.start, values.tolist(), strict=True))
        known = now if seen is None else dict(zip(self.start, seen.tolist(), strict=True))
        torque = self._torque(now)
        voltage = command(self.arm, self.effects, self.manoeuvre, known, closed_loop)
        rate = {"angle": now["speed"], "speed": torque / self.inertia} | self._added_rates(now, torque)
        rate["current"] = current_rate(self.arm, self.effects, now, voltage)
        return [rate[name] for name in self.start]

    def _torque(self, now: State) -> float:
        """Sum the torques on the arm [N m]: of the drive, T_R = l S p (Eq 6), T_G = m g L cos(theta + alpha) (Eq 4).

        The pressure is a state when the gas exchanges heat, and a narrow oil line adds c omega abs(omega) to it; tilts
        of the trunnion and of the base are added to alpha. Cogging is A sin(w theta) + second A sin(2 w theta).
        """
        arm, effects, load = self.arm, self.effects, self.arm.load(self.manoeuvre.shell)
        pressure = now["pressure"] if "pressure" in now else arm.pressure(now["angle"])
        pressure += effects.line_loss * now["speed"] * abs(now["speed"])
        balance = arm.piston_lever * arm.piston_area * pressure
        tilt = math.radians(effects.tilt_deg) + now.get("base", 0.0)
        gravity = load.mass * GRAVITY * load.lever * math.cos(now["angle"] + arm.gravity_angle + tilt)
        waves = effects.cogging_waves * now["angle"]
        cogging = effects.cogging * (math.sin(waves) + effects.cogging_second * math.sin(2.0 * waves))
        passed = coupling(effects, now) if "drive_angle" in now else self._drive(now)
        declared = passed - balance + gravity + cogging
        unlisted = unlisted_torque(arm, effects, now, self.manoeuvre.start, balance)
        return declared - friction(arm, effects, now) - self._tray(now) + effects.torque_offset + unlisted

    def _drive(self, now: State) -> float:
        """Give the torque of the drive at the arm [N m], which an actuator may follow late."""
        return now["drive_torque"] if "drive_torque" in now else drive(self.arm, self.effects, now)

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

    def _added_rates(self, now: State, torque: float) -> State:
        """Give the rates of the states that effects appended."""
        arm, effects = self.arm, self.effects
        rate: State = {}
        if "pressure" in now:
            # n p S l omega / V - (p - p0 V0/V) / tau [Pa/s]: compression, and heat lost toward the isotherm
            volume = arm.volume(now["angle"])
            squeeze = arm.n * now["pressure"] * arm.piston_area * arm.piston_lever * now["speed"] / volume
            rate["pressure"] = squeeze - (now["pressure"] - arm.p0 * arm.gas_volume / volume) / effects.gas_heat_loss
        if "tachometer" in now:
            turning = now.get("drive_speed", now["speed"])
            rate["tachometer"] = (turning - now["tachometer"]) / effects.tachometer_lag
        if "shell_speed" in now:
            rate |= {"shell_angle": now["shell_speed"], "shell_speed": self._tray(now) / SHELL_INERTIA}
        if "base" in now:
            # w^2 (c M - beta) - 2 z w beta' [rad/s2], w = 2 pi f, M the reaction to the torque
            natural = 2.0 * math.pi * effects.base_hz
            pull = natural * (effects.base_compliance * -torque - now["base"])
            rate["base"] = now["base_speed"]
            rate["base_speed"] = natural * (pull - 2.0 * effects.base_damping * now["base_speed"])
        if "gyro" in now:
            # y'' = w^2 (omega - y) - 2 z w y', w = 2 pi f, of the gyro's own mass [rad/s3]
            natural = 2.0 * math.pi * effects.gyro_bandwidth_hz
            pull = natural * (now["speed"] - now["gyro"]) - 2.0 * effects.gyro_damping * now["gyro_rate"]
            rate |= {"gyro": now["gyro_rate"], "gyro_rate": natural * pull}
        if "drive_angle" in now:
            left = self._drive(now) - coupling(effects, now)
            rate |= {"drive_angle": now["drive_speed"], "drive_speed": left / self.drive_inertia}
        if "drive_torque" in now:
            wanted = drive(arm, effects, now)
            rate["drive_torque"] = (wanted - now["drive_torque"]) / effects.actuator_lag
        heat = now["current"] ** 2 - effects.winding_cooling * now.get("heat", 0.0)
        return rate | hysteresis_rates(effects, now) | {"heat": heat, "charge": abs(now["current"]), "clock": 1.0}


MOST_RATES = 300_000
"""Evaluations of the equations that a stage may take; a usual one takes some 10,000."""
SAMPLES_PER_SECOND = 1000
TOLERANCE = 1e-11


def integrate(
    motion: Motion,
    state: FloatArray,
    span: tuple[float, float],
    tolerance: float,
    closed_loop: bool = True,
    to_switch: bool = False,
    seen: Any = None,
    **wanted: Any,
) -> Any:
    """Integrate a span [s] by DOP853, to the switch E where that is asked for; `wanted` are options of `solve_ivp`.

    `seen` is the state that the controller holds, or the solution that it sees late; None for the present state.
    Raises RefusalError when the arm leaves its travel, or when the equations are too stiff or fail.
    """
    count, arm, target = itertools.count(), motion.arm, motion.manoeuvre.target

    def rates(time: float, values: FloatArray) -> list[float]:
        if next(count) > MOST_RATES:
            raise RefusalError(f"{motion.manoeuvre.name} is too stiff to integrate: an effect is too fast or too large")
        known = seen(time - motion.effects.controller_delay) if callable(seen) else seen
        return motion.rates(values, closed_loop, known)

    def distance_to_stops(_time: float, values: FloatArray) -> float:
        return min(float(values[0]) - arm.travel[0], arm.travel[1] - float(values[0]))

    def distance_to_switch(_time: float, values: FloatArray) -> float:
        return abs(target - float(values[0])) - arm.switch_distance

    events: list[Any] = [distance_to_stops, *([distance_to_switch] if to_switch else [])]
    for event in events:
        event.terminal, event.direction = True, -1.0
    found: Any = solve_ivp(rates, span, state, method="DOP853", events=events, rtol=tolerance, atol=tolerance, **wanted)
    if found.t_events[0].size:
        where = f"at {found.t_events[0][0]:.3f} s, and the stand has no end stops"
        raise RefusalError(f"{motion.manoeuvre.name} would leave the travel of -55 to 45 deg {where}")
    if not found.success or not np.isfinite(found.y).all():
        raise RefusalError(f"{motion.manoeuvre.name} cannot be integrated with these values: {found.message}")
    return found


def notice(motion: Motion, switch: float) -> float:
    """Give the time [s] at which the controller learns of the switch E: a delay after it, or at its next sample."""
    period = motion.effects.controller_period
    return math.ceil(switch / period) * period if period else switch + motion.effects.controller_delay


def after_switch(
    motion: Motion, state: FloatArray, switch: float | None, samples: FloatArray, tolerance: float
) -> FloatArray:
    """Integrate from the switch E [s] to the last sample, each sample a column; None starts in closed loop at t = 0.

    The delay is that of a delay line and not an approximation: by the method of steps each piece is no longer than
    the delay, so that all the controller sees in it lies in the piece before, and every kink falls between pieces.
    """
    end, effects = float(samples[-1]), motion.effects
    length = effects.controller_delay or effects.controller_period
    if not length:
        return np.asarray(integrate(motion, state, (switch or 0.0, end), tolerance, t_eval=samples).y)
    begin = 0.0 if switch is None else min(notice(motion, switch), end)
    open_loop = [(switch, begin)] if switch is not None and switch < begin else []
    pieces = ((begin + i * length, min(begin + (i + 1) * length, end)) for i in itertools.count())
    columns, seen, reached = [], state, 0
    for span in itertools.chain(open_loop, pieces):
        found = integrate(motion, state, span, tolerance, span[0] >= begin, seen=seen, dense_output=True)
        state = found.y[:, -1]
        seen = found.sol if effects.controller_delay else state
        first, reached = reached, int(np.searchsorted(samples, span[1], side="right"))
        if reached > first:
            columns.append(found.sol(samples[first:reached]))
        if reached == samples.size:
            break
    return np.hstack(columns)


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
    start, begins = np.array(list(motion.start.values())), None
    if abs(motion.manoeuvre.target - motion.manoeuvre.start) <= motion.arm.switch_distance:
        values, begins = after_switch(motion, start, None, time, tolerance), 0.0
    else:
        before = integrate(motion, start, (0.0, float(time[-1])), tolerance, False, True, t_eval=time)
        values, rest = before.y, time[before.y.shape[1] :]
        if before.t_events[1].size:
            switch = float(before.t_events[1][0])
            begins = notice(motion, switch)
            if rest.size:
                after = after_switch(motion, before.y_events[1][0], switch, rest, tolerance)
                values = np.hstack((values, after))
    states, effects = dict(zip(motion.start, values, strict=True)), motion.effects
    seen = states.get("gyro", states["speed"])
    gyro = seen * (1.0 + effects.gyro_scale) + math.radians(effects.gyro_bias_deg_s)
    return Trajectory(time, states, gyro, begins)
