"""Units as people read them."""

import numpy as np

# SI unit -> (unit on screen, factor).
SHOWN = {"Pa": ("MPa", 1e-6), "rad/s": ("deg/s", 180.0 / np.pi), "m/s": ("mm/s", 1e3)}


def shown(value: float, unit: str) -> tuple[float, str]:
    """Return a value in the unit that people read.

    >>> shown(2.5e6, "Pa")
    (2.5, 'MPa')
    >>> shown(40.0, "N m")
    (40.0, 'N m')
    """
    name, factor = SHOWN.get(unit, (unit, 1.0))
    return value * factor, name
