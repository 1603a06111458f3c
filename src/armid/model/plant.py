"""The declared equations of a machine."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from armid.model.effect import Equation, Guard, State
from armid.model.errors import ArmidError, nearest
from armid.model.parameter import Parameter, check_name
from armid.model.scales import Scales


@dataclass(frozen=True)
class Constant:
    """Declare a known quantity with its default value, SI."""

    name: str
    value: float
    unit: str
    note: str = ""

    def __post_init__(self) -> None:
        check_name(self.name, "constant")


@dataclass(frozen=True)
class Input:
    """Declare a measured column that drives the machine.

    columns: headers that are taken without being named in the campaign, with the factor to SI (or to `unit`).
    required: whether a record without it is refused.
    """

    name: str
    unit: str
    columns: tuple[str, ...] = ()
    required: bool = True

    def __post_init__(self) -> None:
        check_name(self.name, "input")


@dataclass(frozen=True)
class ManoeuvreKey:
    """Declare a key of a campaign's record that sets a constant: constant = factor x value.

    low, high: allowed range in the key's own unit; boolean: true and false stand for 1 and 0.
    """

    key: str
    constant: str
    factor: float = 1.0
    low: float | None = None
    high: float | None = None
    boolean: bool = False
    required: bool = False


@dataclass(frozen=True)
class Plant:
    """Declare a machine: equations are plain scalar functions bound by argument name.

    quantities: name -> function of states, parameters, constants, inputs, latches, ports and other quantities; the
        order does not matter, a loop among them is refused.
    ports: name -> unit; a port is a sum of what effects add there, 0 when nothing does, and stands in the equations
        under its name.
    output: the state or quantity that is recorded; output_unit: "rad/s" or "m/s".
    aliases: further names for states and quantities, so that effects can be written once for many plants.
    from_rest: True when a record starts at t = 0 from the declared initial state; False when it starts at its first
        sample from the measured state, given as the constants `start_position` and `start_speed`.
    variants: sibling plants for another unit of the recorded signal.
    """

    name: str
    parameters: tuple[Parameter, ...]
    states: tuple[State, ...]
    output: str
    output_unit: str
    scales: Scales
    quantities: Mapping[str, Equation] = field(default_factory=dict)
    constants: tuple[Constant, ...] = ()
    inputs: tuple[Input, ...] = ()
    ports: Mapping[str, str] = field(default_factory=dict)
    guards: tuple[Guard, ...] = ()
    keys: tuple[ManoeuvreKey, ...] = ()
    aliases: Mapping[str, str] = field(default_factory=dict)
    from_rest: bool = True
    variants: tuple["Plant", ...] = ()
    note: str = ""

    def __post_init__(self) -> None:
        check_name(self.name, "plant")
        for name in (*self.quantities, *self.ports, *self.aliases):
            check_name(name, "quantity, port or alias")
        twice = sorted({n for n in self.declared if self.declared.count(n) > 1})
        if twice:
            raise ArmidError(f"plant '{self.name}' declares '{twice[0]}' twice: each name once is expected")
        uses = [("records", self.output), *((f"has the alias '{a}' for", n) for a, n in self.aliases.items())]
        for use, name in uses:
            if name not in self.declared:
                raise ArmidError(f"plant '{self.name}' {use} '{name}': {nearest(name, self.declared)}")

    @property
    def declared(self) -> list[str]:
        """Every name that the equations may use."""
        return [
            *(p.name for p in self.parameters), *(s.name for s in self.states), *(c.name for c in self.constants),
            *(i.name for i in self.inputs), *self.quantities, *self.ports, *(g.name for g in self.guards if g.latch),
            *self.aliases,
        ]  # fmt: skip

    def for_unit(self, unit: str) -> "Plant":
        """Return the sibling whose recorded signal has the unit.

        Raises ArmidError when no sibling has it.
        """
        siblings = {p.output_unit: p for p in (self, *self.variants)}
        if unit not in siblings:
            raise ArmidError(f"plant '{self.name}' records {' or '.join(siblings)}, not {unit}")
        return siblings[unit]
