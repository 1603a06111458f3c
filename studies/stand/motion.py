"""Equations of motion of the simulated arm."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from stand.arm import GRAVITY, SHELL_INERTIA, Arm
from stand.controller import command
from stand.drive import drive, flux
from stand.effects import Effects
from stand.friction import friction, smooth_sign
from stand.manoeuvre import Manoeuvre
from stand.unlisted import base_rate, unlisted_torque

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
        """Give the inertia that turns with the arm [kg m2]: J of Eq 2, less the shell when that is loose."""
        return self.arm.inertia(self.manoeuvre.shell) - (SHELL_INERTIA if self.rocks else 0.0)

    @cached_property
    def start(self) -> State:
        """Give the state at t = 0, when the brake opens: all at rest, the gas on its polytrope."""
        angle, effects = self.manoeuvre.start, self.effects
        state = {"angle": angle, "speed": 0.0, "current": 0.0}
        if effects.gas_heat_loss:
            state["pressure"] = self.arm.pressure(angle)
        if effects.tachometer_lag:
            state["tachometer"] = 0.0
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
        declared = drive(arm, effects, now) - balance + self._gravity(now)
        unlisted = unlisted_torque(arm, effects, now, self.manoeuvre.start, balance)
        return declared - friction(arm, effects, now) - self._tray(now) + effects.torque_offset + unlisted

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
        emf = arm.emf_constant * flux(arm, effects, now) * arm.ratio_motor * now["speed"]
        resistance = arm.resistance * (1.0 + effects.winding_heating * now.get("heat", 0.0))
        brushes = effects.brush_drop * smooth_sign(current, effects.brush_width, effects.brush_tanh)
        return (voltage - resistance * current - emf - brushes) / arm.inductance

    def _added_rates(self, now: State, torque: float) -> State:
        """Give the rates of the states that effects appended."""
        rate: State = {}
        if "pressure" in now:
            rate["pressure"] = self._pressure_rate(now)
        if "tachometer" in now:
            rate["tachometer"] = (now["speed"] - now["tachometer"]) / self.effects.tachometer_lag
        if "shell_speed" in now:
            rate |= {"shell_angle": now["shell_speed"], "shell_speed": self._tray(now) / SHELL_INERTIA}
        if "base" in now:
            rate |= {"base": now["base_speed"], "base_speed": base_rate(self.effects, now, -torque)}
        if "gyro" in now:
            rate |= {"gyro": now["gyro_rate"], "gyro_rate": self._gyro_pull(now)}
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
