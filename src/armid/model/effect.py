"""A physical addition to a plant at named ports, and what several effects share."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from armid.errors import ModelError, nearest
from armid.model.parameter import Parameter, check_name

Equation = Callable[..., Any]
# How the nodes of a composed model begin: an effect of this name would look like them.
RESERVED_WORDS = ("rate", "initial", "guard")
SIGN_WIDTH = Parameter("width", "speed", 0.00005, 0.05, fixed=0.005, note="speed over which the sign is smoothed")
SIZE_WIDTH = replace(SIGN_WIDTH, note="speed over which the size of speed is smoothed")


def check_equation(equation: Any, where: str) -> None:
    """Refuse what cannot be called; where: what declares it."""
    if not callable(equation):
        raise ModelError(f"{where} is {equation!r}: a function of numbers is expected, for a number `def at_rest(): "
                         "return 0.0`")  # fmt: skip


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
        check_equation(self.rate, f"state '{self.name}', rate")
        check_equation(self.initial, f"state '{self.name}', initial value")


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
        check_equation(self.function, f"guard '{self.name}'")


@dataclass(frozen=True)
class Delay:
    """Declare a signal as it was a dead time ago, s(t - T); the delay is exact, no filter.

    name: as the equations of the effect spell the late signal.
    of: the signal s, a function of what the effect may ask for (no latch: a late switch is a guard of its own).
    by: own parameter that is T [s]; a negative T is 0, and at 0 the late signal is the signal.

    A recorded input is shifted with its hold: a held one jumps at its late time, inside a sample interval. States are
    interpolated between the steps of the integrator (cubic, fourth order); T may be shorter than a step. Before the
    first sample the signal has its first value: that of the inputs that a longer record holds before a piece of it,
    else of the first sample. A T longer than the record leaves this first value throughout.
    """

    name: str
    of: Equation
    by: str

    def __post_init__(self) -> None:
        check_name(self.name, "delay")


@dataclass(frozen=True)
class Effect:
    """Declare an addition: plain scalar functions whose argument names are the binding.

    Own parameters and states are looked up first, then the plant's names. `adds` maps a port to the function whose
    value is added there. `binds` maps an argument to the name that it means, for an effect that is written once
    for several variables. At the null values the model equals the model without the effect.

    form, forms: where one effect has several published forms, `form` says in a word which one this is and `forms` holds
    the others, whole effects of the same name. A model takes one of them; who looks for an effect tries `every_form`.
    unless: a port; a plant that offers it refuses this form, as another acts there.
    delays: late signals, names that the equations of the effect may use.
    exact: the effect that this one approximates, None where it is exact. Both have the same parameters. The difference
    of their signals is the error of the approximation, see `Model.exact`. A search tries a form that approximates only
    where it was chosen by its word.

    Raises ModelError when it adds nothing, names something twice, or has a form of another name or without a word.
    """

    name: str
    parameters: tuple[Parameter, ...]
    adds: Mapping[str, Equation]
    states: tuple[State, ...] = ()
    guards: tuple[Guard, ...] = ()
    note: str = ""
    source: str = field(default="", compare=False)
    binds: Mapping[str, str] = field(default_factory=dict)
    form: str = ""
    forms: tuple["Effect", ...] = ()
    unless: str = ""
    delays: tuple[Delay, ...] = ()
    exact: "Effect | None" = None

    def __repr__(self) -> str:
        names = ", ".join(p.name for p in self.parameters) or "none"
        return f"<Effect {self.name}: {self.note or 'no note'}; at {', '.join(self.adds)}, parameters {names}>"

    def __post_init__(self) -> None:
        check_name(self.name, "effect")
        if self.name in RESERVED_WORDS:
            raise ModelError(f"effect '{self.name}' cannot have this name: {', '.join(RESERVED_WORDS)} are taken")
        if not self.adds:
            raise ModelError(f"effect '{self.name}' adds to no port: at least one is expected in `adds`")
        for port, equation in self.adds.items():
            check_equation(equation, f"effect '{self.name}', what it adds to '{port}',")
        own = (self.parameters, self.states, self.guards, self.delays)
        names = [one.name for group in own for one in group]
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ModelError(f"effect '{self.name}' declares '{twice[0]}' twice: each name once is expected")
        ports = [n for n in names if n in self.adds]
        if ports:
            raise ModelError(f"effect '{self.name}' calls something else '{ports[0]}', as a port to which it adds: "
                             "another name is expected")  # fmt: skip
        for delay in self.delays:
            known = [p.name for p in self.parameters]
            if delay.by not in known:
                raise ModelError(f"effect '{self.name}' delays '{delay.name}' by '{delay.by}', which is not a "
                                 f"parameter of it: {nearest(delay.by, known)}")  # fmt: skip
        if self.exact is not None and self.exact.parameters != self.parameters:
            raise ModelError(f"effect '{self.name}' approximates one with other parameters: the same are expected")
        words = [e.form for e in self.every_form]
        if any(e.name != self.name for e in self.forms):
            raise ModelError(f"effect '{self.name}' has a form of another name: forms are found under one name")
        if self.forms and (not all(words) or len(set(words)) < len(words)):
            raise ModelError(f"effect '{self.name}' has the forms {words}: a word of its own is expected for each")

    @property
    def searched_forms(self) -> tuple["Effect", ...]:
        """The effect and those of its other forms that are exact."""
        return (self, *(form for form in self.forms if form.exact is None))

    @property
    def every_form(self) -> tuple["Effect", ...]:
        """The effect and its other published forms."""
        return (self, *self.forms)

    def in_form(self, word: str) -> "Effect":
        """Return the form of that word.

        Raises ModelError for a word that no form has.
        """
        known = {e.form: e for e in self.every_form}
        if word not in known:
            raise ModelError(f"effect '{self.name}' has no form '{word}': {nearest(word, filter(None, known))}")
        return known[word]


def zero() -> float:
    """Return 0: nothing has happened before the start."""
    return 0.0


def start_speed(omega: float) -> float:
    """Return the speed: what follows it has settled before the start."""
    return omega


def slope_itself(slope: float) -> float:
    """Rate of a signal whose slope is a state."""
    return slope


def drive_now(drive_effort: float) -> float:
    """Return the effort of the drive: what follows it has settled before the start."""
    return drive_effort
