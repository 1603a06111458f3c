"""Units as people read them, and as headers of columns write them."""

import numpy as np

DEGREE = np.pi / 180.0
# SI unit -> (unit on screen, factor).
SHOWN = {"Pa": ("MPa", 1e-6), "rad/s": ("deg/s", 180.0 / np.pi), "m/s": ("mm/s", 1e3)}
SHOWN |= {"rad": ("deg", 180.0 / np.pi), "m": ("mm", 1e3)}
# SI unit of an output -> {end of the header of a column: factor that turns the column into SI}.
SUFFIXES = {
    "rad": {"deg": DEGREE, "rad": 1.0}, "rad/s": {"deg_s": DEGREE, "rad_s": 1.0}, "m": {"m": 1.0, "mm": 1e-3},
    "m/s": {"m_s": 1.0, "mm_s": 1e-3}, "A": {"A": 1.0}, "N": {"N": 1.0}, "N m": {"N_m": 1.0}, "V": {"V": 1.0},
}  # fmt: skip


def shown(value: float, unit: str) -> tuple[float, str]:
    """Return a value in the unit that people read.

    >>> shown(2.5e6, "Pa")
    (2.5, 'MPa')
    >>> shown(40.0, "N m")
    (40.0, 'N m')
    """
    name, factor = SHOWN.get(unit, (unit, 1.0))
    return value * factor, name
