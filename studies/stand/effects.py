"""What the simulated arm has and the declared equations lack."""

import math
from collections.abc import Iterable
from dataclasses import Field, dataclass, field, fields
from typing import Any

from stand.refusal import RefusalError


def _size(unit: str, note: str, signed: bool = False, limit: float = math.inf) -> Any:
    """Declare the size of an effect; 0 switches the effect off."""
    return field(default=0.0, metadata={"unit": unit, "note": note, "signed": signed, "limit": limit})


def _detail(default: float, unit: str, note: str, of: str) -> Any:
    """Declare a number that shapes an effect and means nothing without it; the default is an estimate."""
    return field(default=default, metadata={"unit": unit, "note": note, "of": of, "signed": False, "limit": math.inf})


@dataclass(frozen=True)
class Effects:
    """Hold the size of each undeclared effect; all 0 is the declared arm exactly.

    Units are SI unless the name ends in one. The sizes that a real arm might show are given in the notes: they are
    estimates. Oil-line loss is `drag` with c l S and seal friction is `coulomb` with F l, so neither has its own name.
    """

    coulomb: float = _size("N m", "friction of constant size against the motion, 20-80")
    coulomb_width: float = _detail(0.005, "rad/s", "speed over which its sign is smoothed", "coulomb")
    stribeck: float = _size("N m", "friction that fades as the arm gets moving, 20-80")
    stribeck_speed: float = _detail(0.15, "rad/s", "speed at which it has faded to 1/e, 0.1-0.2", "stribeck")
    stribeck_width: float = _detail(0.005, "rad/s", "speed over which its sign is smoothed", "stribeck")
    viscous: float = _size("N m s/rad", "friction in proportion to the speed, 5-30")
    drag: float = _size("N m s2/rad2", "friction in proportion to the squared speed, 5-30")
    tilt_deg: float = _size("deg", "slope of the vehicle, added to the angle in gravity, 1-5", signed=True)
    worm_loss: float = _size("1", "share of eta3 lost in the drive torque when the worm brakes, 0.1-0.8", limit=1.0)
    worm_width: float = _detail(0.005, "rad/s", "speed over which that switch is smoothed", "worm_loss")
    flux_saturation: float = _size("A", "current that halves the flux per ampere, 80-300; 0 = none")
    brush_drop: float = _size("V", "voltage lost at the brushes, 0.5-2")
    brush_width: float = _detail(0.5, "A", "current over which its sign is smoothed", "brush_drop")
    winding_heating: float = _size("1/(A2 s)", "relative rise of R per squared ampere and second, 5e-6-5e-5")
    supply_sag: float = _size("ohm", "resistance of the supply that both motors share, 0.003-0.015")
    gas_heat_loss: float = _size("s", "time constant of the heat exchange of the gas, 1-10; 0 = none")
    tachometer_lag: float = _size("s", "time constant of the tachometer in the loop, 0.002-0.010")
    tachometer_offset_deg_s: float = _size("deg/s", "constant error of the tachometer, 0.5-3", signed=True)
    gyro_bandwidth_hz: float = _size("Hz", "natural frequency of the gyro, 30-60; 0 = none")
    gyro_damping: float = _detail(0.7, "1", "damping ratio of the gyro", "gyro_bandwidth_hz")
    gyro_bias_deg_s: float = _size("deg/s", "constant error of the gyro, 0.3", signed=True)
    gyro_scale: float = _size("1", "relative error of the gyro's sensitivity, 0.005", signed=True)
    rocking_hz: float = _size("Hz", "frequency of the shell in its tray while the arm is held, 5-22; 0 = none")
    rocking_damping: float = _detail(0.05, "1", "damping ratio of the shell in its tray, 0.02-0.08", "rocking_hz")

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
            if each.name.endswith(("_width", "_speed")) and value == 0.0:
                raise RefusalError(f"the effect {each.name} must be above 0")
            self._refuse_lonely(each)

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
