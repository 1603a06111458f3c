"""What the machine was made to do, on the time grid of its record."""

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.errors import ModelError, nearest
from armid.model.effect import Equation, Guard, State, check_equation
from armid.model.parameter import Parameter, Scales, check_name, check_numbers
from armid.units import SUFFIXES

Array = NDArray[np.float64]
# How much of its record before it a piece keeps of the inputs [s]: more than a usual dead time.
BEFORE_S = 1.0


@dataclass(frozen=True)
class Manoeuvre:
    """Describe one simulation: constants, inputs and an even time grid that starts at `start_time`.

    constants: name -> value, SI; they replace the plant's defaults.
    interval: sample interval [s]; n_samples: number of samples, the first at start_time.
    inputs: name -> values, shape (n_samples,).
    hold: "linear" (inputs run straight between samples) or "zero" (they keep the value of the last sample).
    before: name -> values of the inputs at the samples before the first, (n_before,), which a late input sees; empty
        where the record begins.
    """

    interval: float
    n_samples: int
    constants: Mapping[str, float] = field(default_factory=dict)
    inputs: Mapping[str, Array] = field(default_factory=dict)
    hold: str = "linear"
    start_time: float = 0.0
    before: Mapping[str, Array] = field(default_factory=dict)

    @property
    def n_before(self) -> int:
        """Number of samples before the first at which the inputs are known."""
        return max((len(values) for values in self.before.values()), default=0)

    @property
    def changes(self) -> float:
        """Share of the samples at which an input changes."""
        return float(max((np.mean(np.diff(values) != 0.0) for values in self.inputs.values()), default=0.0))

    def times(self) -> Array:
        """Return the sample times [s], shape (n_samples,)."""
        return self.start_time + self.interval * np.arange(self.n_samples, dtype=np.float64)

    def shortened(self, n_samples: int) -> "Manoeuvre":
        """Return the manoeuvre cut after its first samples."""
        return replace(self, n_samples=n_samples, inputs={k: v[:n_samples] for k, v in self.inputs.items()})

    def part(self, start: int, n_samples: int, state: Mapping[str, float]) -> "Manoeuvre":
        """Return the part from one sample on, with the constants that give the state there.

        It knows the inputs of the second before, for a dead time.
        """
        known = {name: np.concatenate([self.before.get(name, ()), values]) for name, values in self.inputs.items()}
        first = self.n_before + start
        sooner = max(first - round(BEFORE_S / self.interval), 0)
        return replace(
            self, n_samples=n_samples, start_time=self.start_time + start * self.interval,
            constants={**self.constants, **state},
            inputs={name: values[start : start + n_samples] for name, values in self.inputs.items()},
            before={name: values[sooner:first] for name, values in known.items()} if sooner < first else {},
        )  # fmt: skip

    def later(self, samples: float) -> "Manoeuvre":
        """Return the manoeuvre with inputs that come later by so many samples, earlier where negative.

        Of a part of a sample a held input takes its mean over each interval: what it drives has the right speed at the
        samples. Before the record an input is as it was last known, or as it begins; behind it, as it ends.
        """
        whole = int(np.floor(samples))

        def moved(name: str, values: Array) -> Array:
            known = np.concatenate([self.before.get(name, values[:1]), values])
            rows = np.arange(known.size - values.size, known.size) - whole
            now, previous = (known[np.clip(r, 0, known.size - 1)] for r in (rows, rows - 1))
            return np.asarray(now - (samples - whole) * (now - previous))

        return replace(self, inputs={name: moved(name, values) for name, values in self.inputs.items()})

    def likeness(self) -> tuple[object, ...]:
        """Return what two manoeuvres have in common when a machine answers both alike, hashable; not the start time."""
        signals = [*sorted(self.inputs.items()), *sorted(self.before.items())]
        inputs = tuple((name, values.tobytes()) for name, values in signals)
        return self.interval, self.n_samples, self.hold, tuple(sorted(self.constants.items())), inputs


def check_tuple(several: Any, where: str) -> None:
    """Refuse one thing where several are expected: a comma in brackets is easily forgotten."""
    if isinstance(several, str) or not isinstance(several, Iterable):
        alone = repr(several) if isinstance(several, str) else f"one {type(several).__name__}"
        raise ModelError(f"{where}: {alone} stands alone, a tuple is expected, with a comma behind it")


@dataclass(frozen=True)
class Constant:
    """Declare a known quantity with its default value, SI.

    tolerance: relative standard deviation with which the value is known: 0 for an exact one, None where it is not
    declared, which counts as exact until a campaign says otherwise. low, high: what is physically possible, ends
    included.
    """

    name: str
    value: float
    unit: str
    note: str = ""
    tolerance: float | None = None
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        check_name(self.name, "constant")
        check_numbers(
            f"constant '{self.name}'", value=self.value, tolerance=self.tolerance, low=self.low, high=self.high
        )
        if self.tolerance is not None and not 0.0 <= self.tolerance < 1.0:
            raise ModelError(f"constant '{self.name}' has the tolerance {self.tolerance:g}: a share from 0 to below 1 "
                             "is expected, 0.02 for 2 %")  # fmt: skip


@dataclass(frozen=True)
class Input:
    """Declare a measured column that drives the machine: a force, a commanded position, a supply voltage, a switch.

    name: as the equations spell it. unit: for people; a column is taken as it is, but `_deg` and `_deg_s` become rad.
    columns: headers that are taken without being named in the campaign (there: [inputs] or [records.inputs]).
    required: whether a record without it is refused; else it has the value `default` throughout.
    hold: "linear" (straight between samples), "zero" (it keeps the value of the last sample, as a switch does), or "":
        as the campaign says.
    typical: smallest and largest usual value, between which `armid check` moves it; None: half the effort scale.

    Raises ModelError for another hold, and for an empty typical range.
    """

    name: str
    unit: str
    columns: tuple[str, ...] = ()
    required: bool = True
    default: float = 0.0
    hold: str = ""
    typical: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check_name(self.name, "input")
        check_tuple(self.columns, f"input '{self.name}', columns")
        if self.hold not in ("", "linear", "zero"):
            raise ModelError(f"input '{self.name}' has the hold '{self.hold}': 'linear', 'zero' or '' is expected")
        if self.typical is not None and not self.typical[0] < self.typical[1]:
            raise ModelError(f"input '{self.name}' is typically {self.typical}: a smaller and a larger value are "
                             "expected")  # fmt: skip


@dataclass(frozen=True)
class ManoeuvreKey:
    """Declare a key of a campaign's record that sets a constant: constant = factor x value.

    low, high: allowed range in the key's own unit; boolean: true and false stand for 1 and 0.
    unlike: a constant whose value this one must not have, "" for none: a target must differ from the start.
    """

    key: str
    constant: str
    factor: float = 1.0
    low: float | None = None
    high: float | None = None
    boolean: bool = False
    required: bool = False
    unlike: str = ""


@dataclass(frozen=True)
class Output:
    """Declare a signal that is recorded.

    name: as campaigns, reports and fitnesses name it. signal: the state or quantity that is recorded. unit: SI, one of
    rad, rad/s, m, m/s, A, N, N m, V.
    columns: headers of a record that bring it, each with the end of a unit (`hub_angle_deg`); none: the name with each.
    port: where effects of its sensor (bias, scale, lag) are added, a port that stands in the equation of the signal
        (recorded = angle + port); "" for none.
    size: the largest effort, current or voltage that records hold, SI; a campaign sets it.

    Raises ModelError for another unit, and for a column without the end of the unit.
    """

    name: str
    signal: str
    unit: str
    columns: tuple[str, ...] = ()
    port: str = ""
    size: float = 0.0

    def __post_init__(self) -> None:
        check_name(self.name, "output")
        if self.unit not in SUFFIXES:
            raise ModelError(f"output '{self.name}' has the unit '{self.unit}': {nearest(self.unit, SUFFIXES)}")
        for column in self.columns:
            if not any(column.endswith(f"_{end}") for end in SUFFIXES[self.unit]):
                ends = " or ".join(f"_{end}" for end in SUFFIXES[self.unit])
                raise ModelError(f"output '{self.name}' has the column '{column}': a name that ends in {ends} is "
                                 "expected")  # fmt: skip

    @property
    def factors(self) -> dict[str, float]:
        """Header of a column that brings the output -> factor that turns it into SI, NaN for counts of an encoder."""
        ends = SUFFIXES[self.unit]
        columns = self.columns or tuple(f"{self.name}_{end}" for end in ends)
        return {c: next(factor for end, factor in ends.items() if c.endswith(f"_{end}")) for c in columns}


# Unit of the one speed that a plant records which declares no outputs -> its name and the columns that bring it.
SPEEDS = {
    "rad/s": ("angular_velocity", tuple(f"angular_velocity_{end}" for end in SUFFIXES["rad/s"])),
    "m/s": ("velocity", tuple(f"velocity_{end}" for end in SUFFIXES["m/s"])),
}


def sole_output(signal: str, unit: str) -> Output:
    """Return the output that `output` and `output_unit` of a plant declare."""
    name, columns = SPEEDS.get(unit, (signal, ()))
    return Output(name, signal, unit, columns)


@dataclass(frozen=True, repr=False)
class Plant:
    """Declare a machine: equations are plain scalar functions bound by argument name.

    An argument is a state, parameter, constant, input, latch, port or quantity of that name, or `time` [s]. What an
    initial value takes must not vary in time. Functions use numpy, math, numbers and functions of their own kind;
    np.where, np.minimum and np.maximum choose. studies/your_own_machine/ explains a whole plant part by part.

    name: as campaign.toml spells it. parameters: what is searched. states: what is integrated.
    quantities: name -> function of states, parameters, constants, inputs, latches, ports and other quantities; the
        order does not matter, a loop among them is refused.
    constants: what is known, with default values; a campaign sets others under [constants], a record its own under
        [records.constants] (another gain of its controller).
    inputs: measured columns that drive it, as many as there are.
    ports: name -> unit; a port is a sum of what effects add there, 0 when nothing does, and stands in the equations
        under its name. Ours are found by their names: most effects add to `torque`, some to `drive` or `output`.
    guards: where the equations have a kink or switch; without one at a limit or a step of theirs the engine is slower
        and less accurate there.
    keys: further keys of a record in campaign.toml that set constants.
    outputs: the signals that are recorded; a record brings any of them. Where it is one, `output` (the state or
        quantity) and `output_unit` say it as well; else these are those of the first output.
    aliases: further names for states and quantities, so that effects can be written once for many plants: ours ask for
        `omega` (speed), `theta` (position), `drive_effort` and `load_effort` (what drives, what it works against), and
        `voltage` (what a motor with a back-EMF is fed with; effects add to it at the port `winding`). An only input in
        V of a plant with this port is its `voltage`.
    from_rest: True when a record starts at t = 0 from the declared initial state; False when it starts at its first
        sample from the measured state: then declare the constants `start_position` and `start_speed` (either or both),
        which the reader sets from the columns of position and speed, and use them as initial values.
    scales: typical largest effort and speed; the engine's accuracy is a share of the speed, and effects give their
        bounds as multiples of both. scales_from_records: a campaign sets them instead, from its train records:
        effort = max |`gain` x first input|, speed = max |measured|.
    variants: of a plant with one speed for its output, sibling plants for another unit of it.
    rough: parameters and constants that are known roughly: the equations take NAME (1 + NAME_error), that one a port.

    Raises ModelError for a name that is declared twice or that nobody declares.
    """

    name: str
    parameters: tuple[Parameter, ...]
    states: tuple[State, ...]
    scales: Scales
    output: str = ""
    output_unit: str = ""
    quantities: Mapping[str, Equation] = field(default_factory=dict)
    constants: tuple[Constant, ...] = ()
    inputs: tuple[Input, ...] = ()
    ports: Mapping[str, str] = field(default_factory=dict)
    guards: tuple[Guard, ...] = ()
    keys: tuple[ManoeuvreKey, ...] = ()
    outputs: tuple[Output, ...] = ()
    aliases: Mapping[str, str] = field(default_factory=dict)
    from_rest: bool = True
    scales_from_records: bool = False
    variants: tuple["Plant", ...] = ()
    note: str = ""
    rough: tuple[str, ...] = ()

    def __repr__(self) -> str:
        names = ", ".join(p.name for p in self.parameters)
        return f"<Plant {self.name} [{self.output_unit}]: parameters {names}; ports {', '.join(self.ports) or 'none'}>"

    def __post_init__(self) -> None:
        check_name(self.name, "plant")
        for word in ("parameters", "states", "constants", "inputs", "outputs"):
            check_tuple(getattr(self, word), f"plant '{self.name}', {word}")
        self._fill_outputs()
        speeds = [s.unit for s in self.states if s.name == self.aliases.get("omega", "omega")]
        if speeds == ["m/s"] and self.scales.length_unit != "m":  # its author left the units of the scales as they are
            object.__setattr__(self, "scales", replace(self.scales, effort_unit="N", length_unit="m"))
        volts = [i.name for i in self.inputs if i.unit == "V"]
        if "winding" in self.ports and "voltage" not in self.declared and len(volts) == 1:
            object.__setattr__(self, "aliases", {**self.aliases, "voltage": volts[0]})
        for name in (*self.quantities, *self.ports, *self.aliases):
            check_name(name, "quantity, port or alias")
        for name, equation in self.quantities.items():
            check_equation(equation, f"plant '{self.name}', quantity '{name}'")
        twice = sorted({n for n in self.declared if self.declared.count(n) > 1})
        if twice:
            raise ModelError(f"plant '{self.name}' declares '{twice[0]}' twice: each name once is expected")
        for signal in (o.signal for o in self.outputs if o.signal in self.aliases):
            name = self.aliases[signal]
            raise ModelError(f"plant '{self.name}' records '{signal}', another name for '{name}': '{name}' is expected")
        uses = [("records", o.signal, self.declared) for o in self.outputs]
        uses += [(f"records '{o.name}' through the port", o.port, [*self.ports]) for o in self.outputs if o.port]
        uses += [(f"has the alias '{a}' for", n, self.declared) for a, n in self.aliases.items()]
        for use, name, known in uses:
            if name not in known:
                raise ModelError(f"plant '{self.name}' {use} '{name}': {nearest(name, known)}")

    def _fill_outputs(self) -> None:
        """Bring `outputs`, `output` and `output_unit` together, whichever of them was given."""
        first = self.outputs[0] if self.outputs else None
        if self.output and (first is None or self.records_one_speed):
            # a copy with another unit brings the outputs of the plant that it was made from
            first = sole_output(self.output, self.output_unit)
            object.__setattr__(self, "outputs", (first,))
        names = [o.name for o in self.outputs]
        if first is None or len(set(names)) < len(names):
            raise ModelError(f"plant '{self.name}' records {', '.join(names) or 'nothing'}: at least one output, each "
                             "name once, is expected")  # fmt: skip
        given = (self.output or first.signal, self.output_unit or first.unit)
        if given != (first.signal, first.unit):
            raise ModelError(f"plant '{self.name}' declares outputs and the output '{given[0]}' in {given[1]}: one of "
                             f"them, or the first output '{first.signal}' in {first.unit}, is expected")  # fmt: skip
        object.__setattr__(self, "output", first.signal)
        object.__setattr__(self, "output_unit", first.unit)

    @property
    def records_one_speed(self) -> bool:
        """Tell whether it is one speed that `output` and `output_unit` alone would declare."""
        first = self.outputs[0]
        return len(self.outputs) == 1 and first.unit in SPEEDS and first == sole_output(first.signal, first.unit)

    @property
    def start_constants(self) -> dict[str, str]:
        """State -> the constant that is its initial value, none where the plant starts from rest."""
        names = {c.name for c in self.constants}
        asked = {s: list(signature(s.initial).parameters) for s in self.states if not self.from_rest}
        return {s.name: a[0] for s, a in asked.items() if len(a) == 1 and a[0] in names and s.initial(1.25) == 1.25}

    @property
    def sizes(self) -> tuple[float, ...]:
        """What is large for each output, SI: a speed as the scale says, the way of a second, an effort, else 1.

        A force behind a gear may be far above the scale of effort: what records hold counts where it is larger.
        """
        size = dict.fromkeys(("rad/s", "m/s", "rad", "m"), self.scales.speed)
        size |= dict.fromkeys(("N", "N m"), self.scales.effort)
        return tuple(max(size.get(o.unit, 1.0), o.size) for o in self.outputs)

    @property
    def records_omega(self) -> bool:
        """Whether the port `output` is in the unit of `omega`, so that the library's sensors of a speed fit there."""
        omega = next((s.unit for s in self.states if s.name == self.aliases.get("omega", "omega")), "")
        return self.ports.get("output", omega) == omega

    @property
    def declared(self) -> list[str]:
        """Every name that the equations may use."""
        return [
            *(p.name for p in self.parameters), *(s.name for s in self.states), *(c.name for c in self.constants),
            *(i.name for i in self.inputs), *self.quantities, *self.ports, *(g.name for g in self.guards if g.latch),
            *self.aliases,
        ]  # fmt: skip

    def recording(self, names: Collection[str]) -> "Plant":
        """Return the plant with some of its outputs alone."""
        kept = tuple(o for o in self.outputs if o.name in names)
        return self if kept == self.outputs else replace(self, output="", output_unit="", outputs=kept)

    def known_roughly(self, names: Iterable[str]) -> "Plant":
        """Return the plant with a port `NAME_error` for the relative error of some parameters and constants."""
        rough = tuple(names)
        return replace(self, rough=rough, ports={**self.ports, **{f"{name}_error": "1" for name in rough}})

    def unit_of(self, variable: str) -> str:
        """Return the unit of a state, an input, the drive's effort or the voltage; "" for one that is not known."""
        # of several columns each may bring another unit
        inputs = {i.name: i.unit for i in self.inputs if len(i.columns) < 2}
        units = {s.name: s.unit for s in self.states} | inputs | {"time": "s"}
        named = {"drive_effort": self.scales.effort_unit, "voltage": self.ports.get("winding", "")}
        return {**named, **units}.get(variable, "")

    def for_unit(self, unit: str) -> "Plant":
        """Return the sibling whose recorded signal has the unit.

        Raises ModelError when no sibling has it.
        """
        siblings = {p.output_unit: p for p in (self, *self.variants)}
        if unit not in siblings:
            raise ModelError(f"plant '{self.name}' records {' or '.join(siblings)}, not {unit}")
        return siblings[unit]
