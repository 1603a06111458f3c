"""Units as people read them, and as headers of columns write them."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np

DEGREE = np.pi / 180.0
# SI unit -> (unit on screen, factor).
SHOWN = {"Pa": ("MPa", 1e-6), "m/s": ("mm/s", 1e3), "m": ("mm", 1e3)}
TURN = 2.0 * np.pi
# The same of angles and turning speeds, in each of the units in which they may be shown.
ANGLES = {
    "deg": {"rad": ("deg", 1.0 / DEGREE), "rad/s": ("deg/s", 1.0 / DEGREE)}, "rad": {},
    "rpm": {"rad": ("deg", 1.0 / DEGREE), "rad/s": ("rpm", 60.0 / TURN)},
}  # fmt: skip
DEG = "deg"
_angle: ContextVar[str] = ContextVar("angle", default=DEG)
# SI units that take a prefix, and from which sizes on: below a hundredth, and from ten thousand.
PREFIXED = re.compile(r"(N|V|A|W|J|H|F|ohm)(?![a-z])|s$")
PREFIXES = {1e-9: "n", 1e-6: "u", 1e-3: "m", 1e3: "k", 1e6: "M", 1e9: "G"}
LEAST_PLAIN, LARGEST_PLAIN = 1e-2, 1e4
# End of the header of a column -> SI unit, factor into it, and how a row of units or brackets in a header write it. The
# factor of counts is that of the shaft's encoder: a turn over `counts_per_turn` of the campaign.
ENDS = {
    "deg": ("rad", DEGREE, ("deg", "\u00b0")), "rad": ("rad", 1.0, ("rad",)), "turns": ("rad", TURN, ("turns",)),
    "counts": ("rad", np.nan, ("counts",)),
    "deg_s": ("rad/s", DEGREE, ("deg/s", "\u00b0/s", "dps", "degps")),
    "rad_s": ("rad/s", 1.0, ("rad/s", "rad s-1", "radps")),
    "rpm": ("rad/s", TURN / 60.0, ("rpm", "1/min", "min-1")), "turns_s": ("rad/s", TURN, ("turns/s", "rev/s")),
    "counts_s": ("rad/s", np.nan, ("counts/s",)),
    "m": ("m", 1.0, ("m",)), "mm": ("m", 1e-3, ("mm",)), "cm": ("m", 1e-2, ("cm",)),
    "m_s": ("m/s", 1.0, ("m/s", "mps")), "mm_s": ("m/s", 1e-3, ("mm/s", "mmps")),
    "m_min": ("m/s", 1.0 / 60.0, ("m/min",)),
    "cm_s": ("m/s", 1e-2, ("cm/s",)), "km_h": ("m/s", 1.0 / 3.6, ("km/h",)),
    "A": ("A", 1.0, ("A",)), "mA": ("A", 1e-3, ("mA",)), "N": ("N", 1.0, ("N",)), "kN": ("N", 1e3, ("kN",)),
    "N_m": ("N m", 1.0, ("N m", "Nm", "N*m")), "mN_m": ("N m", 1e-3, ("mN m", "mNm")),
    "kN_m": ("N m", 1e3, ("kN m", "kNm")), "V": ("V", 1.0, ("V",)), "mV": ("V", 1e-3, ("mV",)),
    "kV": ("V", 1e3, ("kV",)),
}  # fmt: skip
# SI unit of an output -> {end of the header of a column: factor that turns the column into SI, NaN for counts}.
SUFFIXES = {unit: {end: factor for end, (own, factor, _) in ENDS.items() if own == unit}
            for unit in dict.fromkeys(unit for unit, _, _ in ENDS.values())}  # fmt: skip
# Unit as it is written -> end of the header of a column; times have ends too.
UNIT_ENDS = {"s": "s", "sec": "s", "ms": "ms", "us": "us"} | {
    w: end for end, (_, _, words) in ENDS.items() for w in words
}


@contextmanager
def angles_in(unit: str) -> Iterator[None]:
    """Show angles and turning speeds in deg, rad or rpm."""
    before = _angle.set(unit)
    try:
        yield
    finally:
        _angle.reset(before)


def angle_of(header: str) -> str:
    """Return in which unit an angle or turning speed is recorded: deg, rad or rpm, by the header of its column."""
    ends = {"rad": "rad", "rad_s": "rad", "rpm": "rpm"}
    return next((unit for end, unit in ends.items() if header.endswith(f"_{end}")), DEG)


def scale_of(unit: str, size: float = 1.0) -> tuple[str, float]:
    """Return the unit in which people read values of a size [SI], and the factor from SI.

    >>> scale_of("N m", 2e-5)
    ('uN m', 1000000.0)
    """
    scale = (SHOWN | ANGLES[_angle.get()]).get(unit, (unit, 1.0))
    is_readable = not np.isfinite(size) or size == 0.0 or LEAST_PLAIN <= abs(size) < LARGEST_PLAIN
    if scale[0] != unit or is_readable or not PREFIXED.match(unit):
        return scale
    sizes = [prefix for prefix in PREFIXES if prefix <= abs(size)]
    prefix = max(sizes, default=min(PREFIXES))
    return f"{PREFIXES[prefix]}{unit}", 1.0 / prefix


def behind(unit: str) -> str:
    """Return a unit as it stands behind a number; nothing for 1, and for one that is not known."""
    return "" if unit in ("", "1") else f" {unit}"


def counted(n: int, what: str) -> str:
    """Return a number of things in words.

    >>> counted(1, "run"), counted(2000, "run")
    ('1 run', '2,000 runs')
    """
    return f"{n:,} {what}{'' if n == 1 else 's'}"


def labelled(name: str, unit: str) -> str:
    """Return the label of an axis.

    >>> labelled("voltage", "V"), labelled("duty", "1")
    ('voltage [V]', 'duty')
    """
    return f"{name} [{unit}]" if behind(unit) else name


def shown(value: float, unit: str) -> tuple[float, str]:
    """Return a value in the unit that people read.

    >>> shown(2.5e6, "Pa")
    (2.5, 'MPa')
    >>> shown(40.0, "N m")
    (40.0, 'N m')
    """
    name, factor = scale_of(unit)
    return value * factor, name
