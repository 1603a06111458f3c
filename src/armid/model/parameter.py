"""An unknown of a machine: name, unit, bounds, null value."""

import keyword
from dataclasses import dataclass

from armid.model.errors import ArmidError


def check_name(name: str, what: str) -> None:
    """Refuse a name that equations could not use.

    Raises ArmidError for a name that is not a plain Python identifier, and for `time`, which is the time.
    """
    if name == "time":
        raise ArmidError(f"{what} 'time' cannot have this name: in the equations, time is the time [s]")
    if not name.isidentifier() or keyword.iskeyword(name) or "__" in name or name != name.strip("_"):
        raise ArmidError(f"{what} '{name}' is no usable name: letters, digits and single underscores are expected")


@dataclass(frozen=True)
class Parameter:
    """Declare one unknown.

    name: as the equations spell it.
    unit: a physical unit, or a product of the plant's scales `effort`, `speed`, `inertia` (effort over speed, times
        1 s) such as `effort/speed`; then `low`, `high`, `null`, `fixed` and `nominal` are multiples of that scale.
    low, high: bounds of the search, SI (or multiples of the scale).
    null: the value at which an effect vanishes (None for a parameter of a plant or of an effect's shape).
    fixed: the value at which it stays unless someone frees it (None: it is free).
    nominal: the value a simulation takes when nobody says another (None: `null`, then `fixed`, then there is none).
    note: what it is, in words.
    """

    name: str
    unit: str
    low: float
    high: float
    null: float | None = None
    fixed: float | None = None
    nominal: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        check_name(self.name, "parameter")
        if not self.low < self.high:
            raise ArmidError(f"parameter '{self.name}' has low {self.low} and high {self.high}: low < high is expected")
