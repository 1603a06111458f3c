"""Equations of motion of the simulated arm."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from stand.arm import GRAVITY, SHELL_INERTIA, Arm
from stand.effects import Effects
from stand.manoeuvre import Manoeuvre

State = dict[str, float]


def smooth_sign(value: float, width: float) -> float:
    """Give the sign of a value, smoothed over a width of the same unit: x / sqrt(x^2 + w^2)."""
    return value / math.hypot(value, width)


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
        if effects.winding_heating:
            state["heat"] = 0.0
        if self.rocks:
            state |= {"shell_angle": angle, "shell_speed": 0.0}
        if effects.gyro_bandwidth_hz:
            state |= {"gyro": 0.0, "gyro_rate": 0.0}
        return state

    def rates(self, values: npt.NDArray[np.float64], closed_loop: bool) -> list[float]:
        """Give d(state)/dt in the order of `start`, in the open-loop or the closed-loop stage.

        J d omega/dt = 2 T_d i1 eta1 eta2 eta3 - T_R + T_G (Eqs 1, 3) and L dI/dt = u - R I - E (Eq 7), each with
        the terms of the effects that are on.
        """
        now = dict(zip(self.start, values.tolist(), strict=True))
        torque = self._drive(now) - self._balance(now) + self._gravity(now) - self._friction(now) - self._tray(now)
        rate = {"angle": now["speed"], "speed": torque / self.inertia, "current": self._current_rate(now, closed_loop)}
        rate |= self._added_rates(now)
        return [rate[name] for name in self.start]

    def _gravity(self, now: State) -> float:
        """T_G = m g L cos(theta + alpha) [N m] (Eq 4), the tilt of the trunnion added to alpha."""
        load = self.arm.load(self.manoeuvre.shell)
        tilt = math.radians(self.effects.tilt_deg)
        return load.mass * GRAVITY * load.lever * math.cos(now["angle"] + self.arm.gravity_angle + tilt)

    def _balance(self, now: State) -> float:
        """T_R = l S p [N m] (Eq 6); the pressure is a state when the gas exchanges heat."""
        pressure = now["pressure"] if "pressure" in now else self.arm.pressure(now["angle"])
        return self.arm.piston_lever * self.arm.piston_area * pressure

    def _flux(self, current: float) -> float:
        """Phi = K abs(I) [Wb] (Eq 7), over 1 + abs(I)/I_s when the iron saturates."""
        saturation = self.effects.flux_saturation
        return self.arm.excitation * abs(current) / (1.0 + (abs(current) / saturation if saturation else 0.0))

    def _drive(self, now: State) -> float:
        """2 T_d i1 eta1 eta2 eta3 [N m], T_d = C_T Phi I (Eqs 3, 7); a braking worm may lose a share of eta3."""
        arm, current = self.arm, now["current"]
        torque = arm.torque_constant * self._flux(current) * current
        with_motion = smooth_sign(now["speed"] * math.copysign(1.0, current), self.effects.worm_width)
        eta3 = arm.eta3 * (1.0 - self.effects.worm_loss * 0.5 * (1.0 - with_motion))
        return 2.0 * torque * arm.ratio_motor * arm.eta1 * arm.eta2 * eta3

    def _friction(self, now: State) -> float:
        """T_c sgn + T_s exp(-(omega/omega_s)^2) sgn + b omega + c omega abs(omega) [N m], against the motion."""
        effects, speed = self.effects, now["speed"]
        coulomb = effects.coulomb * smooth_sign(speed, effects.coulomb_width)
        fading = effects.stribeck * math.exp(-((speed / effects.stribeck_speed) ** 2))
        stribeck = fading * smooth_sign(speed, effects.stribeck_width)
        return coulomb + stribeck + effects.viscous * speed + effects.drag * speed * abs(speed)

    def _tray(self, now: State) -> float:
        """J_s (w^2 (theta - phi) + 2 z w (omega - psi)) [N m], w = 2 pi f: what the tray's spring and damper pass on.

        The weight of the shell stays on the arm, so the spring is at rest when the arm is.
        """
        if not self.rocks:
            return 0.0
        natural = 2.0 * math.pi * self.effects.rocking_hz
        stretch, slip = now["angle"] - now["shell_angle"], now["speed"] - now["shell_speed"]
        return SHELL_INERTIA * natural * (natural * stretch + 2.0 * self.effects.rocking_damping * slip)

    def _command(self, now: State, closed_loop: bool) -> float:
        """Voltage demanded of the drive [V]: full supply before E; after it K_p (theta_D - theta) - K_d k omega.

        The threshold circuit shrinks the closed-loop demand toward 0 by u_th; the supply clips it.
        """
        supply, arm = self.manoeuvre.supply_volt, self.arm
        if not closed_loop:
            return math.copysign(supply, self.manoeuvre.target - self.manoeuvre.start)
        speed = now.get("tachometer", now["speed"]) + math.radians(self.effects.tachometer_offset_deg_s)
        demand = arm.position_gain * (self.manoeuvre.target - now["angle"]) - arm.speed_gain * arm.k * speed
        return math.copysign(min(max(abs(demand) - arm.threshold, 0.0), supply), demand)

    def _current_rate(self, now: State, closed_loop: bool) -> float:
        """L dI/dt = u - 2 R_s I - R I - E - V_b sgn(I), E = C_e Phi i1 omega, signed current (Eq 7) [A/s]."""
        arm, effects, current = self.arm, self.effects, now["current"]
        voltage = self._command(now, closed_loop) - 2.0 * effects.supply_sag * current
        emf = arm.emf_constant * self._flux(current) * arm.ratio_motor * now["speed"]
        resistance = arm.resistance * (1.0 + effects.winding_heating * now.get("heat", 0.0))
        brushes = effects.brush_drop * smooth_sign(current, effects.brush_width)
        return (voltage - resistance * current - emf - brushes) / arm.inductance

    def _added_rates(self, now: State) -> State:
        """Give the rates of the states that effects appended."""
        rate: State = {}
        if "pressure" in now:
            rate["pressure"] = self._pressure_rate(now)
        if "tachometer" in now:
            rate["tachometer"] = (now["speed"] - now["tachometer"]) / self.effects.tachometer_lag
        if "heat" in now:
            rate["heat"] = now["current"] ** 2
        if "shell_speed" in now:
            rate |= {"shell_angle": now["shell_speed"], "shell_speed": self._tray(now) / SHELL_INERTIA}
        if "gyro" in now:
            rate |= {"gyro": now["gyro_rate"], "gyro_rate": self._gyro_pull(now)}
        return rate

    def _pressure_rate(self, now: State) -> float:
        """dp/dt = n p S l omega / V - (p - p0 V0/V) / tau [Pa/s]: compression, and heat lost toward the isotherm."""
        arm, volume = self.arm, self.arm.volume(now["angle"])
        squeeze = arm.n * now["pressure"] * arm.piston_area * arm.piston_lever * now["speed"] / volume
        return squeeze - (now["pressure"] - arm.p0 * arm.gas_volume / volume) / self.effects.gas_heat_loss

    def _gyro_pull(self, now: State) -> float:
        """Second-order lag y'' = w^2 (omega - y) - 2 z w y', w = 2 pi f, of the gyro's own mass [rad/s3]."""
        natural = 2.0 * math.pi * self.effects.gyro_bandwidth_hz
        return natural * (natural * (now["speed"] - now["gyro"]) - 2.0 * self.effects.gyro_damping * now["gyro_rate"])
