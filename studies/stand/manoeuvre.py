"""What the arm is told to do."""

import math
import re
from dataclasses import dataclass

from stand.refusal import RefusalError

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
        """Refuse a stroke that the arm cannot make."""
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
    """Read a manoeuvre written as NAME=START:TARGET:shell|empty:SUPPLY (deg, deg, load, V).

    Raises RefusalError when the text is no such manoeuvre.
    """
    name, _, stroke = text.partition("=")
    parts = stroke.split(":")
    if len(parts) != 4 or parts[2] not in ("shell", "empty"):
        raise RefusalError(
            f"the manoeuvre {text!r} must read NAME=START:TARGET:shell|empty:SUPPLY, as up=20:-30:shell:28"
        )
    try:
        start, target, supply = float(parts[0]), float(parts[1]), float(parts[3])
    except ValueError:
        raise RefusalError(f"the manoeuvre {text!r} holds an angle or voltage that is no number") from None
    return Manoeuvre(name, start, target, parts[2] == "shell", supply)


def write_manoeuvre(manoeuvre: Manoeuvre) -> str:
    """Write a manoeuvre as `read_manoeuvre` reads it."""
    load = "shell" if manoeuvre.shell else "empty"
    return f"{manoeuvre.name}={manoeuvre.start_deg}:{manoeuvre.target_deg}:{load}:{manoeuvre.supply_volt}"
