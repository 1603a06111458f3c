"""What the simulated arm has and the declared equations lack."""

import math
from collections.abc import Iterable
from dataclasses import Field, dataclass, field, fields
from typing import Any

from stand.refusal import RefusalError

POSITIVE = ("_width", "_speed", "_exponent", "_radius", "_width_deg", "_fade_deg", "base_hz")
"""Ends of the names of details that divide, so that 0 has no meaning."""


def _size(unit: str, note: str, signed: bool = False, limit: float = math.inf) -> Any:
    """Declare the size of an effect; 0 switches the effect off."""
    return field(default=0.0, metadata={"unit": unit, "note": note, "signed": signed, "limit": limit})


def _detail(default: float, unit: str, note: str, of: str, signed: bool = False) -> Any:
    """Declare a number that shapes an effect and means nothing without it; the default is an estimate."""
    return field(default=default, metadata={"unit": unit, "note": note, "of": of, "signed": signed, "limit": math.inf})


def _tanh(of: str) -> Any:
    """Declare the choice of how an effect smooths its sign."""
    return _detail(0.0, "1", "1 = its sign is smoothed by tanh(x / w), 0 = by x / sqrt(x^2 + w^2)", of)


@dataclass(frozen=True)
class Effects:
    """Hold the size of each undeclared effect; all 0 is the declared arm exactly.

    Units are SI unless the name ends in one. The sizes that a real arm might show are given in the notes: they are
    estimates. Oil-line loss does what `drag` does with c l S, and seal friction what `coulomb` does with F l. The last
    block holds what has no name in any library of effects.
    """

    coulomb: float = _size("N m", "friction of constant size against the motion, 20-80")
    coulomb_width: float = _detail(0.005, "rad/s", "speed over which its sign is smoothed", "coulomb")
    coulomb_tanh: float = _tanh("coulomb")
    stribeck: float = _size("N m", "friction that fades as the arm gets moving, 20-80")
    stribeck_speed: float = _detail(0.15, "rad/s", "speed at which it has faded to 1/e, 0.1-0.2", "stribeck")
    stribeck_width: float = _detail(0.005, "rad/s", "speed over which its sign is smoothed", "stribeck")
    stribeck_tanh: float = _tanh("stribeck")
    stribeck_rational: float = _detail(0.0, "1", "1 = it fades as 1/(1 + (omega/omega_s)^2)", "stribeck")
    stribeck_exponent: float = _detail(2.0, "1", "power of the speed in its exponential", "stribeck")
    viscous: float = _size("N m s/rad", "friction in proportion to the speed, 5-30")
    drag: float = _size("N m s2/rad2", "friction in proportion to the squared speed, 5-30")
    seal_friction: float = _size("N", "friction of the piston's seals, at the lever l, 100-400")
    seal_width: float = _detail(0.002, "rad/s", "speed over which its sign is smoothed by tanh", "seal_friction")
    asymmetric_friction: float = _size("N m", "friction of another size in either direction, 20-80")
    asymmetric_share: float = _detail(0.5, "1", "share more when lowering", "asymmetric_friction", signed=True)
    torque_offset: float = _size("N m", "constant torque on the shaft, 5-30", signed=True)
    tilt_deg: float = _size("deg", "slope of the vehicle, added to the angle in gravity, 1-5", signed=True)
    worm_loss: float = _size("1", "share of eta3 lost in the drive torque when the worm brakes, 0.1-0.8", limit=1.0)
    worm_width: float = _detail(0.005, "rad/s", "speed over which that switch is smoothed", "worm_loss")
    worm_tanh: float = _tanh("worm_loss")
    worm_braking: float = _size("1", "share of the way from eta3 to 2 - 1/eta3 that a braking worm goes, 0.3-1")
    braking_width: float = _detail(0.002, "rad/s", "speed over which that switch is smoothed by tanh", "worm_braking")
    worm_speed: float = _size("1", "share of eta3 lost where the worm does not slide, 0.05-0.15", False, 1.0)
    worm_fade: float = _detail(0.0, "rad/s", "speed at which it has faded to 1/e; 0 = as AGMA says", "worm_speed")
    worm_radius: float = _detail(0.03, "m", "radius at which the worm slides", "worm_speed")
    drive_gain: float = _size("1", "relative error of the motors' torque, 0.03-0.1", signed=True)
    flux_saturation: float = _size("A", "current that halves the flux per ampere, 80-300; 0 = none")
    flux_root: float = _size("A", "the same with K I/sqrt(1 + (I/I_s)^2), 80-300; 0 = none")
    flux_atan: float = _size("A", "the same with K I_s atan(I/I_s), 80-300; 0 = none")
    brush_drop: float = _size("V", "voltage lost at the brushes, 0.5-2")
    brush_width: float = _detail(0.5, "A", "current over which its sign is smoothed", "brush_drop")
    brush_tanh: float = _tanh("brush_drop")
    winding_heating: float = _size("1/(A2 s)", "relative rise of R per squared ampere and second, 5e-6-5e-5")
    winding_cooling: float = _detail(0.0, "1/s", "rate at which its heat is lost again", "winding_heating")
    supply_sag: float = _size("ohm", "resistance of the supply that both motors share, 0.003-0.015")
    gas_heat_loss: float = _size("s", "time constant of the heat exchange of the gas, 1-10; 0 = none")
    line_loss: float = _size("Pa s2/rad2", "pressure lost in the oil line, 8e3-32e3 (0.05-0.2 MPa at 2.5 rad/s)")
    tachometer_lag: float = _size("s", "time constant of the tachometer in the loop, 0.002-0.010")
    tachometer_offset_deg_s: float = _size("deg/s", "constant error of the tachometer, 0.5-3", signed=True)
    tachometer_ripple: float = _size("1", "relative ripple of the tachometer over the motor's turn, 0.01-0.05")
    tachometer_order: float = _detail(1.0, "1", "waves of it in a turn of the motor", "tachometer_ripple")
    controller_delay: float = _size("s", "delay of all that the controller sees, 0.002-0.010")
    controller_period: float = _size("s", "period of a sampled controller that holds its command, 0.004-0.020")
    gyro_bandwidth_hz: float = _size("Hz", "natural frequency of the gyro, 30-60; 0 = none")
    gyro_damping: float = _detail(0.7, "1", "damping ratio of the gyro", "gyro_bandwidth_hz")
    gyro_bias_deg_s: float = _size("deg/s", "constant error of the gyro, 0.3", signed=True)
    gyro_scale: float = _size("1", "relative error of the gyro's sensitivity, 0.005", signed=True)
    rocking_hz: float = _size("Hz", "frequency of the shell in its tray while the arm is held, 5-22; 0 = none")
    rocking_damping: float = _detail(0.05, "1", "damping ratio of the shell in its tray, 0.02-0.08", "rocking_hz")
    rocking_play: float = _detail(0.0, "rad", "stretch to either side that meets no spring", "rocking_hz")
    rocking_stop: float = _detail(0.0, "rad", "stretch at which its spring is twice as stiff; 0 = linear", "rocking_hz")
    cam_bump: float = _size("N m", "friction of a worn place, 30-90")
    cam_angle_deg: float = _detail(-12.0, "deg", "where it is", "cam_bump", signed=True)
    cam_width_deg: float = _detail(6.0, "deg", "half its width", "cam_bump")
    motor_fade: float = _size("1/(A s)", "relative fall of the motor constant with the charge passed, 0.002-0.01")
    piston_stiction: float = _size("N", "friction of the piston that fades in the stroke, 400-1500")
    stiction_fade_deg: float = _detail(10.0, "deg", "stroke in which it fades to 1/e", "piston_stiction")
    cable_spring: float = _size("N m/rad", "stiffness of a cable that is taut beyond an angle, 50-300")
    cable_angle_deg: float = _detail(-15.0, "deg", "where it gets taut", "cable_spring", signed=True)
    pressure_friction: float = _size("1", "friction in proportion to the torque of the gas, 0.03-0.15")
    base_compliance: float = _size("rad/(N m)", "tilt of the base by the arm's reaction, 2e-5-2e-4")
    base_hz: float = _detail(3.0, "Hz", "frequency of the base", "base_compliance")
    base_damping: float = _detail(0.1, "1", "damping ratio of the base", "base_compliance")
    slipping_ripple: float = _size("N m", "torque periodic in the worm's angle, its phase slipping, 20-80")
    slip_hz: float = _detail(1.0, "Hz", "rate at which its phase slips", "slipping_ripple")
    sway: float = _size("N m", "slow torque that comes and goes in time, 15-60")
    sway_hz: float = _detail(1.2, "Hz", "its frequency", "sway")
    sway_phase_deg: float = _detail(0.0, "deg", "its phase at t = 0", "sway", signed=True)

    def __post_init__(self) -> None:
        """Refuse a size without meaning."""
        for each in fields(self):
            value = getattr(self, each.name)
            if not math.isfinite(value):
                raise RefusalError(f"the effect {each.name} must be a finite number, not {value}")
            if value < 0.0 and not each.metadata["signed"]:
                raise RefusalError(f"the effect {each.name} cannot be negative, but is {value}")
            if value >= each.metadata["limit"]:
                raise RefusalError(f"the effect {each.name} must be below {each.metadata['limit']}, but is {value}")
            if each.name.endswith(POSITIVE) and each.metadata.get("of") and value == 0.0:
                raise RefusalError(f"the effect {each.name} must be above 0")
            self._refuse_lonely(each)
        if self.controller_delay and self.controller_period:
            raise RefusalError("the effects controller_delay and controller_period exclude each other")

    def _refuse_lonely(self, each: "Field[Any]") -> None:
        owner = each.metadata.get("of")
        if owner and getattr(self, each.name) != each.default and not getattr(self, owner):
            raise RefusalError(f"the effect {each.name} does nothing without {owner}")

    def switched_on(self) -> dict[str, float]:
        """Give the effects that are on, with the details of each."""
        on = {each.name for each in fields(self) if "of" not in each.metadata and getattr(self, each.name)}
        names = [each.name for each in fields(self) if each.metadata.get("of", each.name) in on]
        return {name: getattr(self, name) for name in names}


def read_effects(words: Iterable[str]) -> Effects:
    """Read effects written as NAME=SIZE; a name may come once. Raises RefusalError when a word is no effect."""
    known = {each.name for each in fields(Effects)}
    sizes: dict[str, float] = {}
    for word in words:
        name, _, size = word.partition("=")
        if name not in known:
            raise RefusalError(f"there is no effect {name!r}; the effects are {', '.join(sorted(known))}")
        if name in sizes:
            raise RefusalError(f"the effect {name} is given twice")
        try:
            sizes[name] = float(size)
        except ValueError:
            raise RefusalError(f"the effect {word!r} must read NAME=SIZE with a number, as coulomb=40") from None
    return Effects(**sizes)


def describe_effects() -> str:
    """List each effect with its unit and meaning, one line each."""
    return "\n".join(f"  {each.name} [{each.metadata['unit']}]: {each.metadata['note']}" for each in fields(Effects))
