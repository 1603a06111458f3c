"""Units as people read them, and as headers of columns write them."""

import numpy as np

DEGREE = np.pi / 180.0
# SI unit -> (unit on screen, factor).
SHOWN = {"Pa": ("MPa", 1e-6), "rad/s": ("deg/s", 180.0 / np.pi), "m/s": ("mm/s", 1e3)}
SHOWN |= {"rad": ("deg", 180.0 / np.pi), "m": ("mm", 1e3)}
TURN = 2.0 * np.pi
# SI unit of an output -> {end of the header of a column: factor that turns the column into SI}.
SUFFIXES = {
    "rad": {"deg": DEGREE, "rad": 1.0, "turns": TURN},
    "rad/s": {"deg_s": DEGREE, "rad_s": 1.0, "rpm": TURN / 60.0, "turns_s": TURN},
    "m": {"m": 1.0, "mm": 1e-3}, "m/s": {"m_s": 1.0, "mm_s": 1e-3},
    "A": {"A": 1.0}, "N": {"N": 1.0}, "N m": {"N_m": 1.0}, "V": {"V": 1.0},
}  # fmt: skip
# Ends of headers whose factor is that of the shaft's encoder: a turn over `counts_per_turn` of the campaign.
COUNTS = {"rad": "counts", "rad/s": "counts_s"}
# Unit as a row of units or a header in brackets writes it -> end of the header of a column.
UNIT_ENDS = {
    "s": "s", "sec": "s", "ms": "ms", "us": "us", "rad": "rad", "rad/s": "rad_s", "rad s-1": "rad_s", "deg": "deg",
    "\u00b0": "deg", "deg/s": "deg_s", "\u00b0/s": "deg_s", "rpm": "rpm", "1/min": "rpm", "min-1": "rpm",
    "turns": "turns", "turns/s": "turns_s", "rev/s": "turns_s", "counts": "counts", "counts/s": "counts_s", "m": "m",
    "mm": "mm", "m/s": "m_s", "mm/s": "mm_s", "A": "A", "N": "N", "N m": "N_m", "Nm": "N_m", "N*m": "N_m", "V": "V",
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
