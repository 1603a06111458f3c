"""A plant and the effects added to it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

from armid.errors import ArmidError, ModelError, caused_by, nearest
from armid.model.effect import Effect, State
from armid.model.graph import Graph, build_graph, equations_text
from armid.model.parameter import Parameter, resolve
from armid.model.plant import Plant

K = TypeVar("K")


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """Compose a plant with effects: `model + effect`, `model - "effect"`; `print(model)` shows the equations.

    Raises ModelError when an effect asks for an unknown name or port, or is added twice.
    """

    plant: Plant
    effects: tuple[Effect, ...] = ()

    @caused_by(ModelError)
    def __post_init__(self) -> None:
        names = [e.name for e in self.effects]
        for name in names:
            if names.count(name) > 1:
                raise ArmidError(f"effect '{name}' is in the model already: each effect at most once is expected")
        _ = self.graph

    def __add__(self, effect: Effect) -> "Model":
        if not isinstance(effect, Effect):
            raise ModelError(f"{effect!r} is added to a model: an Effect is expected, as armid.EFFECTS['coulomb']")
        return replace(self, effects=(*self.effects, effect))

    @caused_by(ModelError)
    def __sub__(self, effect: Effect | str) -> "Model":
        name = effect if isinstance(effect, str) else effect.name
        names = [e.name for e in self.effects]
        if name not in names:
            raise ArmidError(f"effect '{name}' is not in the model: {nearest(name, names)}")
        return replace(self, effects=tuple(e for e in self.effects if e.name != name))

    def __repr__(self) -> str:
        named = " + ".join([self.plant.name, *(e.name for e in self.effects)])
        return f"<Model {named}: parameters {', '.join(self.parameters)}>"

    def __str__(self) -> str:
        return equations_text(self.plant, self.effects, self.graph)

    @cached_property
    def graph(self) -> Graph:
        """Every equation bound to what it needs."""
        return build_graph(self.plant, self.effects)

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Qualified name (`p0`, `coulomb.level`) -> Parameter in SI, in the order of the candidate vector."""
        own = {p.name: resolve(p, self.plant.scales) for p in self.plant.parameters}
        added = {f"{e.name}.{p.name}": resolve(p, self.plant.scales) for e in self.effects for p in e.parameters}
        return own | added

    @cached_property
    def states(self) -> dict[str, State]:
        """Qualified name -> State, in the order of integration."""
        own = {s.name: s for s in self.plant.states}
        return own | {f"{e.name}.{s.name}": s for e in self.effects for s in e.states}

    @cached_property
    def delays(self) -> list[str]:
        """Qualified names of the parameters by which a signal is late, each once."""
        return list(dict.fromkeys(f"{e.name}.{d.by}" for e in self.effects for d in e.delays))

    @cached_property
    def exact(self) -> "Model":
        """The model with each effect that approximates another (`Effect.exact`) replaced by that one.

        Both have the same parameters: the difference of their signals at one candidate is the error of the
        approximation [unit of the output], and what explains no more than that explains nothing.
        """
        exact = (e if e.exact is None else replace(e.exact, name=e.name) for e in self.effects)
        return replace(self, effects=tuple(exact))

    @cached_property
    def latches(self) -> list[str]:
        """Qualified names of the one-way switches."""
        own = [g.name for g in self.plant.guards if g.latch]
        return own + [f"{e.name}.{g.name}" for e in self.effects for g in e.guards if g.latch]

    @cached_property
    def constants(self) -> dict[str, float]:
        """Name -> default value, SI."""
        return {c.name: c.value for c in self.plant.constants}

    @caused_by(ModelError)
    def constant_values(self, given: Mapping[str, float]) -> list[float]:
        """Return all constants in order, the given ones replacing defaults.

        Raises ModelError for a constant that the plant does not have.
        """
        for name in given:
            if name not in self.constants:
                raise ArmidError(f"constant '{name}' is not one of plant '{self.plant.name}': "
                                 f"{nearest(name, self.constants)}")  # fmt: skip
        return [float(given.get(name, value)) for name, value in self.constants.items()]


def refusal_of(effect: Effect, plant: Plant) -> str:
    """Return the sentence with which a plant refuses an effect, "" where it takes it."""
    try:
        Model(plant) + effect
    except ArmidError as error:
        return str(error)
    return ""


def effect_named(text: str, known: Mapping[str, Effect], plant: Plant) -> Effect:
    """Return the effect of a text, NAME or NAME:FORM; without a word, the first form that fits."""
    effect, form = known[effect_name(text)], text.partition(":")[2]
    if form:
        return effect.in_form(form)
    return next((form for form in effect.searched_forms if not refusal_of(form, plant)), effect)


def effect_name(text: str) -> str:
    """Return the name of the effect of a text, NAME or NAME:FORM."""
    return text.partition(":")[0]


def distinct(effects: Mapping[K, Effect], plant: Plant) -> dict[K, Effect]:
    """Return effects without those whose equations on a plant are those of one before: one effect under two names.

    A late command of a recorded drive (`controller_delay`) is a late drive (`drive_delay`). Each must fit the plant.
    """
    first: dict[object, K] = {}
    for key, effect in effects.items():
        first.setdefault(own_equations(effect, plant), key)
    return {key: effects[key] for key in first.values()}


def own_equations(effect: Effect, plant: Plant) -> object:
    """Return what an effect adds to a plant, without its name; equal for equal equations and ranges."""
    graph, prefix = (Model(plant) + replace(effect, name="own", forms=(), exact=None)).graph, ("own__", "late__own__")
    nodes = [n for n in graph.nodes.values() if n.owner == "own" or n.key.startswith(prefix)]
    return effect.parameters, frozenset((n.key, n.kind, n.function, n.arguments, n.terms, n.by) for n in nodes)


def applicable(effects: Mapping[str, Effect], plant: Plant) -> dict[str, Effect]:
    """Return the effects whose ports and names a plant offers; nothing is compiled.

    effects: name -> effect. An effect comes in another form where only that fits.
    """
    fitting = {name: [e for e in effect.every_form if not refusal_of(e, plant)] for name, effect in effects.items()}
    return {name: forms[0] for name, forms in fitting.items() if forms}


def is_late_as_a_whole(plant: Plant) -> bool:
    """Tell whether an effect can only delay the drive with the part of it that follows the motion, as a back-EMF does.

    A late voltage then moves the machine as a late torque and another inertia do, and no record separates them. Where
    the plant offers the quantity or input `voltage` and the port `winding`, the voltage can be late alone.
    """
    drive, voltage, *motion = (plant.aliases.get(a, a) for a in ("drive_effort", "voltage", "omega", "theta"))
    graph = Model(plant).graph
    offers_voltage = "winding" in plant.ports and voltage in graph.nodes
    return drive in graph.nodes and graph.depends_on(drive, motion) and not offers_voltage
