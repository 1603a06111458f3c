"""A physical addition to a plant at named ports."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from armid.model.errors import ArmidError
from armid.model.parameter import Parameter, check_name

Equation = Callable[..., Any]
# How the nodes of a composed model begin: an effect of this name could not be told from them.
RESERVED = ("rate", "initial", "guard")


@dataclass(frozen=True)
class State:
    """Declare one quantity that is integrated in time.

    name, unit: as the equations spell it; SI.
    rate: its time derivative; initial: its value at the start (parameters, constants, static quantities).
    column: header of the column that shows it in files, "" for an inner state.
    """

    name: str
    unit: str
    rate: Equation
    initial: Equation
    column: str = ""

    def __post_init__(self) -> None:
        check_name(self.name, "state")


@dataclass(frozen=True)
class Guard:
    """Declare a function whose change of sign is a kink or a switch of the equations; the integrator lands on it.

    latch: False for a kink (either direction, any number of times). True for a one-way switch: a variable of this
    name is 0 until the function first falls to 0 or below, then 1.
    """

    name: str
    function: Equation
    latch: bool = False

    def __post_init__(self) -> None:
        check_name(self.name, "guard")


@dataclass(frozen=True)
class Effect:
    """Declare an addition: plain scalar functions whose argument names are the binding.

    Own parameters and states are looked up first, then the plant's names. `adds` maps a port to the function whose
    value is added there. At the null values the model equals the model without the effect.

    Raises ArmidError when it adds nothing or names something twice.
    """

    name: str
    parameters: tuple[Parameter, ...]
    adds: Mapping[str, Equation]
    states: tuple[State, ...] = ()
    guards: tuple[Guard, ...] = ()
    note: str = ""
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        check_name(self.name, "effect")
        if self.name in RESERVED:
            raise ArmidError(f"effect '{self.name}' cannot have this name: {', '.join(RESERVED)} are taken")
        if not self.adds:
            raise ArmidError(f"effect '{self.name}' adds to no port: at least one is expected in `adds`")
        names = [p.name for p in self.parameters] + [s.name for s in self.states]
        names += [g.name for g in self.guards]
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ArmidError(f"effect '{self.name}' declares '{twice[0]}' twice: each name once is expected")
