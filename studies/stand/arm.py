"""The simulated arm: its constants, and what it is told to do."""

import math
import re
from dataclasses import dataclass

from stand import RefusalError

PARAMETERS = ("p0", "k", "eta3", "n")
"""What an identifier must find."""
GRAVITY = 9.81
State = dict[str, float]
"""What the equations know of an instant, by name."""
SHELL_INERTIA = 45.5 * 0.85**2
"""Inertia of the shell about the trunnion [kg m2]: 45.5 kg at 0.85 m, both estimates."""


@dataclass(frozen=True)
class Load:
    """Hold what the shell changes: mass [kg], lever of the centre of mass [m], inertia I6 [kg m2]."""

    mass: float
    lever: float
    inertia: float


@dataclass(frozen=True)
class Arm:
    """Hold the constants of paper Eqs 1-7 in SI units.

    The first four are what an identifier must find. The paper prints no value of the others: all of them are
    engineering estimates of a sensible machine.
    """

    p0: float = 3.05e6
    k: float = 1.0
    eta3: float = 0.55
    n: float = 1.4
    motor_inertia: float = 2.0e-3
    gear_inertia: float = 4.0e-3
    worm_inertia: float = 1.2e-2
    ratio_motor: float = 120.0
    ratio_gear: float = 60.0
    ratio_worm: float = 24.0
    eta1: float = 0.97
    eta2: float = 0.97
    loaded: Load = Load(mass=118.0, lever=0.58, inertia=64.0)
    empty: Load = Load(mass=72.5, lever=0.4106, inertia=31.1)
    gravity_angle: float = math.radians(5.0)
    piston_lever: float = 0.060
    piston_area: float = 1.9635e-3
    gas_volume: float = 0.40e-3
    travel: tuple[float, float] = (math.radians(-55.0), math.radians(45.0))
    resistance: float = 0.40
    inductance: float = 2.0e-3
    excitation: float = 4.5e-5
    emf_constant: float = 20.0
    torque_constant: float = 20.0
    position_gain: float = 280.0
    speed_gain: float = 70.0
    threshold: float = 0.5
    switch_distance: float = math.radians(25.0)

    def __post_init__(self) -> None:
        for name in PARAMETERS:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise RefusalError(f"{name} must be a positive number, not {value}")
        if self.eta3 > 1.0:
            raise RefusalError(f"eta3 is an efficiency and cannot exceed 1, but is {self.eta3}")

    def load(self, shell: bool) -> Load:
        return self.loaded if shell else self.empty

    def inertia(self, shell: bool) -> float:
        """Give the inertia about the trunnion J [kg m2].

        J = 2 I01 i1^2 eta1 eta2 eta3 + I23 i2^2 eta2 eta3 + I45 i3^2 eta3 + I6 (paper Eq 2).
        """
        motors = 2.0 * self.motor_inertia * self.ratio_motor**2 * self.eta1 * self.eta2 * self.eta3
        gears = self.gear_inertia * self.ratio_gear**2 * self.eta2 * self.eta3
        worm = self.worm_inertia * self.ratio_worm**2 * self.eta3
        return motors + gears + worm + self.load(shell).inertia

    def volume(self, angle: float) -> float:
        """Give the gas volume V = V0 - S l (theta - theta_A) [m3] at an angle [rad] (paper Eq 5).

        It stays above 0 for angles that only a trial step of the integrator takes, far beyond the travel.
        """
        volume = self.gas_volume - self.piston_area * self.piston_lever * (angle - self.travel[0])
        return max(volume, 1e-3 * self.gas_volume)

    def pressure(self, angle: float) -> float:
        """Give the pressure of a polytropic gas p = p0 (V0/V)^n [Pa] at an angle [rad] (paper Eq 5)."""
        return float(self.p0 * (self.gas_volume / self.volume(angle)) ** self.n)


NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
TRAVEL_DEG = (-55.0, 45.0)


@dataclass(frozen=True)
class Manoeuvre:
    """Hold one stroke: from start to target [deg, positive = lowering], shell on or off, supply [V]."""

    name: str
    start_deg: float
    target_deg: float
    shell: bool = True
    supply_volt: float = 28.0

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise RefusalError(f"the manoeuvre name {self.name!r} must be letters, digits, '_', '-' or '.'")
        for word, angle in (("start", self.start_deg), ("target", self.target_deg)):
            if not TRAVEL_DEG[0] <= angle <= TRAVEL_DEG[1]:
                raise RefusalError(f"the {word} of {self.name} is {angle} deg, outside the travel of -55 to 45 deg")
        if self.start_deg == self.target_deg:
            raise RefusalError(f"{self.name} starts at its target of {self.target_deg} deg, so nothing would move")
        if not (math.isfinite(self.supply_volt) and self.supply_volt > 0.0):
            raise RefusalError(f"the supply of {self.name} must be a positive voltage, not {self.supply_volt}")

    @property
    def start(self) -> float:
        """Give theta_C [rad]."""
        return math.radians(self.start_deg)

    @property
    def target(self) -> float:
        """Give theta_D [rad]."""
        return math.radians(self.target_deg)

    def told(self) -> dict[str, float | bool]:
        """Tell what it is by the keys of campaign.toml."""
        angles = {"start_angle_deg": self.start_deg, "target_angle_deg": self.target_deg}
        return {**angles, "shell": self.shell, "supply_V": self.supply_volt}


KNOWN = {
    manoeuvre.name: manoeuvre
    for manoeuvre in (
        Manoeuvre("lower", -48.0, 22.0),
        Manoeuvre("raise", 22.0, -48.0),
        Manoeuvre("short", -48.0, -8.0),
        Manoeuvre("empty", -48.0, 22.0, shell=False),
        Manoeuvre("lower_low_voltage", -40.0, 18.0, supply_volt=25.0),
        Manoeuvre("raise_empty", 15.0, -42.0, shell=False),
        Manoeuvre("inside_E", -10.0, 15.0),
    )
}


def read_manoeuvre(text: str) -> Manoeuvre:
    """Look a manoeuvre up by its name, or read it as NAME=START:TARGET:shell|empty:SUPPLY (deg, deg, load, V).

    Raises RefusalError when the text is no such manoeuvre.
    """
    name, written, stroke = text.partition("=")
    if not written and name in KNOWN:
        return KNOWN[name]
    if not written:
        raise RefusalError(f"there is no manoeuvre {name!r}; the known ones are {', '.join(KNOWN)}")
    parts = stroke.split(":")
    if len(parts) != 4 or parts[2] not in ("shell", "empty"):
        raise RefusalError(
            f"the manoeuvre {text!r} must read NAME=START:TARGET:shell|empty:SUPPLY, as up=20:-30:shell:28"
        )
    try:
        start, target, supply = float(parts[0]), float(parts[1]), float(parts[3])
    except ValueError:
        raise RefusalError(f"the manoeuvre {text!r} holds an angle or voltage that is not a number") from None
    return Manoeuvre(name, start, target, parts[2] == "shell", supply)


def write_manoeuvre(manoeuvre: Manoeuvre) -> str:
    """Write a manoeuvre as `read_manoeuvre` reads it."""
    load = "shell" if manoeuvre.shell else "empty"
    return f"{manoeuvre.name}={manoeuvre.start_deg}:{manoeuvre.target_deg}:{load}:{manoeuvre.supply_volt}"
