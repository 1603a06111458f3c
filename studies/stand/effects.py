"""What the simulated arm has and the declared equations lack: sizes, then controller, drive, friction, the unlisted."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any

from stand import RefusalError
from stand.arm import Arm, Manoeuvre, State

POSITIVE = ("_width", "_speed", "_exponent", "_radius", "_width_deg", "_fade_deg", "base_hz", "_stiffness")
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
    dahl: float = _size("N m", "friction that builds up after a reversal, Dahl's F' = s (1 - F/T sgn)^i omega, 20-80")
    dahl_stiffness: float = _detail(2e4, "N m/rad", "slope at the reversal", "dahl")
    dahl_exponent: float = _detail(1.0, "1", "i: 1 as for ductile, below 1 for brittle material", "dahl")
    lugre: float = _size("N m", "friction of bristles at speed (LuGre), 20-80")
    lugre_stiffness: float = _detail(2e4, "N m/rad", "of the bristles", "lugre")
    lugre_damping: float = _detail(50.0, "N m s/rad", "of the bristles", "lugre")
    lugre_breakaway: float = _detail(1.5, "1", "friction at rest over that at speed", "lugre")
    lugre_speed: float = _detail(0.15, "rad/s", "speed at which the excess has faded to 1/e", "lugre")
    bouc_wen: float = _size("N m", "friction with a loop of Bouc and Wen, 20-80")
    bouc_wen_stiffness: float = _detail(2e4, "N m/rad", "slope of the first motion", "bouc_wen")
    bouc_wen_exponent: float = _detail(2.0, "1", "sharpness of the knee", "bouc_wen")
    bouc_wen_beta: float = _detail(0.5, "1", "share of the loop's width that unloading bends", "bouc_wen")
    viscous: float = _size("N m s/rad", "friction in proportion to the speed, 5-30")
    drag: float = _size("N m s2/rad2", "friction in proportion to the squared speed, 5-30")
    seal_friction: float = _size("N", "friction of the piston's seals, at the lever l, 100-400")
    seal_width: float = _detail(0.002, "rad/s", "speed over which its sign is smoothed by tanh", "seal_friction")
    asymmetric_friction: float = _size("N m", "friction of another size in either direction, 20-80")
    asymmetric_share: float = _detail(0.5, "1", "share more when lowering", "asymmetric_friction", signed=True)
    torque_offset: float = _size("N m", "constant torque on the shaft, 5-30", signed=True)
    cogging: float = _size("N m", "torque of magnets and teeth over the motor's angle at the arm, 10-40")
    cogging_waves: float = _detail(24.0, "1", "waves in a radian of the arm", "cogging")
    cogging_second: float = _detail(0.0, "1", "second harmonic as a share of the first", "cogging", signed=True)
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
    torque_droop: float = _size("A", "current that halves the torque per flux and current, 100-300; 0 = none")
    droop_exponent: float = _detail(2.0, "1", "power of the current in its 1/(1 + (I/I_d)^m)", "torque_droop")
    drive_dead_zone: float = _size("N m", "torque of the drive that the gear does not pass on, 20-80")
    actuator_lag: float = _size("s", "time constant with which the torque of the drive follows, 0.005-0.05")
    drive_compliance: float = _size("rad/(N m)", "twist of the drive per torque, 2e-7-5e-6; 0 = rigid")
    drive_damping: float = _detail(500.0, "N m s/rad", "of that twist", "drive_compliance")
    drive_play: float = _detail(0.0, "rad", "half the play of the drive", "drive_compliance")
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
            owner = each.metadata.get("of")
            if owner and value != each.default and not getattr(self, owner):
                raise RefusalError(f"the effect {each.name} does nothing without {owner}")
        if self.controller_delay and self.controller_period:
            raise RefusalError("the effects controller_delay and controller_period exclude each other")

    def switched_on(self) -> dict[str, float]:
        """Give the effects that are on, with the details of each."""
        on = {each.name for each in fields(self) if "of" not in each.metadata and getattr(self, each.name)}
        names = [each.name for each in fields(self) if each.metadata.get("of", each.name) in on]
        return {name: getattr(self, name) for name in names}


def read_effects(words: Iterable[str]) -> Effects:
    """Read effects written as NAME=SIZE; a name may come once. Raises RefusalError when a word is not an effect."""
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


def command(arm: Arm, effects: Effects, manoeuvre: Manoeuvre, seen: State, closed_loop: bool) -> float:
    """Give the voltage demanded of the drive [V]: full supply before E; after it K_p (theta_D - theta) - K_d k omega.

    The threshold circuit shrinks the closed-loop demand toward 0 by u_th; the supply clips it. `seen` is the state
    that the controller knows of, which may be an earlier one.
    """
    supply = manoeuvre.supply_volt
    if not closed_loop:
        return math.copysign(supply, manoeuvre.target - manoeuvre.start)
    speed = seen.get("tachometer", seen.get("drive_speed", seen["speed"]))
    speed += math.radians(effects.tachometer_offset_deg_s)
    if effects.tachometer_ripple:
        turn = effects.tachometer_order * arm.ratio_motor * seen["angle"]
        speed *= 1.0 + effects.tachometer_ripple * math.sin(turn)
    demand = arm.position_gain * (manoeuvre.target - seen["angle"]) - arm.speed_gain * arm.k * speed
    return math.copysign(min(max(abs(demand) - arm.threshold, 0.0), supply), demand)


FEET_PER_MINUTE = 0.3048 / 60.0
"""A foot per minute [m/s], the unit of AGMA's formula."""


def flux(arm: Arm, effects: Effects, now: State) -> float:
    """Give Phi = K abs(I) [Wb] (Eq 7), less when the iron saturates.

    Then K abs(I)/(1 + abs(I)/I_s), K I_s atan(abs(I)/I_s) or K abs(I)/sqrt(1 + (I/I_s)^2). A fading motor
    has Phi / (1 + c * integral of abs(I)).
    """
    ampere = abs(now["current"])
    if effects.flux_atan:
        ampere = effects.flux_atan * math.atan(ampere / effects.flux_atan)
    if effects.flux_root:
        ampere /= math.hypot(1.0, ampere / effects.flux_root)
    if effects.flux_saturation:
        ampere /= 1.0 + ampere / effects.flux_saturation
    return arm.excitation * ampere / (1.0 + effects.motor_fade * now.get("charge", 0.0))


def current_rate(arm: Arm, effects: Effects, now: State, demand: float) -> float:
    """L dI/dt = u - 2 R_s I - R I - E - V_b sgn(I), E = C_e Phi i1 omega, signed current (Eq 7) [A/s]."""
    current = now["current"]
    voltage = demand - 2.0 * effects.supply_sag * current
    emf = arm.emf_constant * flux(arm, effects, now) * arm.ratio_motor * now.get("drive_speed", now["speed"])
    resistance = arm.resistance * (1.0 + effects.winding_heating * now.get("heat", 0.0))
    brushes = effects.brush_drop * smooth_sign(current, effects.brush_width, effects.brush_tanh)
    return (voltage - resistance * current - emf - brushes) / arm.inductance


def drive(arm: Arm, effects: Effects, now: State) -> float:
    """Give 2 T_d i1 eta1 eta2 eta3 [N m], T_d = C_T Phi I (Eqs 3, 7), times 1 + g for an error of its gain."""
    torque = arm.torque_constant * flux(arm, effects, now) * now["current"] * (1.0 + effects.drive_gain)
    if effects.torque_droop:
        torque /= 1.0 + (abs(now["current"]) / effects.torque_droop) ** effects.droop_exponent
    at_arm = 2.0 * torque * arm.ratio_motor * arm.eta1 * arm.eta2 * worm_efficiency(arm, effects, now)
    return math.copysign(max(abs(at_arm) - effects.drive_dead_zone, 0.0), at_arm)


def coupling(effects: Effects, now: State) -> float:
    """Give what the twisted drive passes on to the arm [N m]: s/c + d s' where s = twist beyond the play is not 0."""
    twist = now["drive_angle"] - now["angle"]
    stretch = twist - min(max(twist, -effects.drive_play), effects.drive_play)
    damped = effects.drive_damping * (now["drive_speed"] - now["speed"]) if stretch or not effects.drive_play else 0.0
    return stretch / effects.drive_compliance + damped


def worm_efficiency(arm: Arm, effects: Effects, now: State) -> float:
    """Give eta3 as the torque meets it: less where the worm brakes, and less where it slides slowly.

    Braking, eta3 loses the share `worm_loss` and goes toward 2 - 1/eta3, but not below 0: the efficiency of the same
    friction with the wheel driving the worm. Of the loss at standstill exp(-abs(omega)/omega_f) is left at speed, or
    where no omega_f is given the ratio of frictions after AGMA at i3 omega r.
    """
    eta3, forward = arm.eta3, now["speed"] * math.copysign(1.0, now["current"])
    if effects.worm_loss:
        eta3 *= 1.0 - effects.worm_loss * 0.5 * (1.0 - smooth_sign(forward, effects.worm_width, effects.worm_tanh))
    if effects.worm_braking:
        braking = 0.5 * (1.0 - math.tanh(forward / effects.braking_width))
        eta3 += effects.worm_braking * braking * (max(0.0, 2.0 - 1.0 / arm.eta3) - arm.eta3)
    if effects.worm_speed:
        speed, fade = now["speed"], effects.worm_fade
        left = math.exp(-abs(speed) / fade) if fade else relative_friction(arm.ratio_worm * speed * effects.worm_radius)
        eta3 *= 1.0 - effects.worm_speed * left
    return eta3


def relative_friction(sliding: float) -> float:
    """Give the friction of a worm at a sliding speed [m/s] over that at standstill.

    mu(v) = 0.103 exp(-0.110 v^0.450) + 0.012, v in ft/min (ANSI/AGMA 6034-B92), v smoothed over 1 ft/min.
    """
    speed = math.hypot(sliding / FEET_PER_MINUTE, 1.0) - 1.0
    return (0.103 * math.exp(-0.110 * speed**0.450) + 0.012) / 0.115


def smooth_sign(value: float, width: float, tanh: float = 0.0) -> float:
    """Give the sign of a value, smoothed over a width of the same unit: x / sqrt(x^2 + w^2), or tanh(x / w)."""
    return math.tanh(value / width) if tanh else value / math.hypot(value, width)


def friction(arm: Arm, effects: Effects, now: State) -> float:
    """Give all friction [N m], positive against a positive speed.

    T_c sgn + T_s f sgn + b omega + c omega abs(omega) + F l sgn + T_a (1 + a sgn) sgn; Dahl, LuGre, Bouc and Wen, each
    with its force or deflection as a state. f = exp(-(abs(omega)/omega_s)^d), or 1/(1 + (omega/omega_s)^2) (Hess and
    Soom 1990).
    """
    speed = now["speed"]
    coulomb = effects.coulomb * smooth_sign(speed, effects.coulomb_width, effects.coulomb_tanh)
    ratio = abs(speed) / effects.stribeck_speed
    left = 1.0 / (1.0 + ratio**2) if effects.stribeck_rational else math.exp(-(ratio**effects.stribeck_exponent))
    sign = smooth_sign(speed, effects.stribeck_width, effects.stribeck_tanh)
    total = coulomb + effects.stribeck * left * sign + effects.viscous * speed + effects.drag * speed * abs(speed)
    if effects.seal_friction:
        total += effects.seal_friction * arm.piston_lever * math.tanh(speed / effects.seal_width)
    if effects.asymmetric_friction:
        sign = math.tanh(speed / effects.seal_width)
        total += effects.asymmetric_friction * (1.0 + effects.asymmetric_share * sign) * sign
    of_states = now.get("dahl", 0.0) + effects.bouc_wen * now.get("bouc_wen", 0.0)
    if "bristle" in now:
        of_states += effects.lugre_stiffness * now["bristle"]
        of_states += effects.lugre_damping * hysteresis_rates(effects, now)["bristle"]
    return total + of_states


def hysteresis_rates(effects: Effects, now: State) -> State:
    """Give the rates of their states: Dahl's force [N m/s], the bristles' deflection [rad/s], z of Bouc and Wen [1/s].

    F' = s abs(1 - F/T sgn)^i sgn(1 - F/T sgn) omega; b' = omega - s abs(omega) b/g, g = T (1 + (r - 1)
    exp(-(omega/v)^2)); z' = s/T (omega - abs(z)^n (beta abs(omega) sgn(z) + (1 - beta) omega)).
    """
    speed, rates = now["speed"], {}
    if "dahl" in now:
        left = 1.0 - now["dahl"] / effects.dahl * math.copysign(1.0, speed)
        rates["dahl"] = effects.dahl_stiffness * math.copysign(abs(left) ** effects.dahl_exponent, left) * speed
    if "bristle" in now:
        excess = (effects.lugre_breakaway - 1.0) * math.exp(-((speed / effects.lugre_speed) ** 2))
        full = effects.lugre * (1.0 + excess)
        rates["bristle"] = speed - effects.lugre_stiffness * abs(speed) * now["bristle"] / full
    if "bouc_wen" in now:
        z, beta = now["bouc_wen"], effects.bouc_wen_beta
        bent = beta * abs(speed) * math.copysign(1.0, z) + (1.0 - beta) * speed
        slope = effects.bouc_wen_stiffness / effects.bouc_wen
        rates["bouc_wen"] = slope * (speed - abs(z) ** effects.bouc_wen_exponent * bent)
    return rates


STICTION_WIDTH = 0.002
"""Speed over which the signs of these frictions are smoothed [rad/s]."""


def unlisted_torque(arm: Arm, effects: Effects, now: State, start: float, balance: float) -> float:
    """Give the torque of the effects without a name [N m]; `start` is theta_C [rad], `balance` T_R [N m].

    -T_b exp(-((theta - theta_b)/w)^2) sgn - F l exp(-abs(theta - theta_C)/s) sgn - mu T_R sgn
    - c max(0, theta - theta_s) + A sin(i3 theta + 2 pi f t) + B sin(2 pi f t + phase)
    """
    angle, sign = now["angle"], math.tanh(now["speed"] / STICTION_WIDTH)
    total = -effects.pressure_friction * balance * sign
    if effects.cam_bump:
        away = (angle - math.radians(effects.cam_angle_deg)) / math.radians(effects.cam_width_deg)
        total -= effects.cam_bump * math.exp(-(away**2)) * sign
    if effects.piston_stiction:
        gone = abs(angle - start) / math.radians(effects.stiction_fade_deg)
        total -= effects.piston_stiction * arm.piston_lever * math.exp(-gone) * sign
    if effects.cable_spring:
        total -= effects.cable_spring * max(0.0, angle - math.radians(effects.cable_angle_deg))
    if "clock" in now:
        turn = 2.0 * math.pi * now["clock"]
        ripple = effects.slipping_ripple * math.sin(arm.ratio_worm * angle + effects.slip_hz * turn)
        total += ripple + effects.sway * math.sin(effects.sway_hz * turn + math.radians(effects.sway_phase_deg))
    return total
