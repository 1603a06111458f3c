"""Binding by argument name: the equations of a plant and its effects as one acyclic graph."""

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from armid.errors import ArmidError, nearest
from armid.model.effect import Effect, Equation
from armid.model.plant import Plant

LEAVES = ("parameter", "constant", "state", "input", "latch", "time")
STATIC_LEAVES = ("parameter", "constant")


@dataclass(frozen=True)
class Node:
    """One name of the composed equations.

    key: flat, unique identifier (`omega`, `coulomb__level`); kind: a leaf, or "quantity", "term", "port", "rate",
    "initial", "guard"; arguments: (argument of the function, key it is bound to); terms: what a port sums.
    """

    key: str
    kind: str
    owner: str = ""
    function: Equation | None = None
    arguments: tuple[tuple[str, str], ...] = ()
    terms: tuple[str, ...] = ()

    @property
    def needs(self) -> tuple[str, ...]:
        """Keys that must be known before."""
        return self.terms or tuple(key for _, key in self.arguments)


@dataclass
class Graph:
    """Hold every node by key, in the order of declaration."""

    nodes: dict[str, Node] = field(default_factory=dict)

    def add(self, node: Node) -> None:
        """Add a node; refuse a second one of its key with ArmidError."""
        if node.key in self.nodes:
            raise ArmidError(f"'{node.key.replace('__', '.')}' is there twice: each effect at most once is expected")
        self.nodes[node.key] = node

    def of_kind(self, *kinds: str) -> list[Node]:
        """Return the nodes of some kinds."""
        return [n for n in self.nodes.values() if n.kind in kinds]

    def order(self, wanted: Iterable[str]) -> list[Node]:
        """Return the nodes that are no leaves and lead to the wanted ones, each after what it needs.

        Raises ArmidError when the equations run in a circle.
        """
        done: dict[str, Node] = {}

        def visit(key: str, path: tuple[str, ...]) -> None:
            if key in done:
                return
            if key in path:
                circle = " -> ".join((*path[path.index(key) :], key)).replace("__", ".")
                raise ArmidError(f"the equations run in a circle: {circle}; use a state or an earlier quantity instead")
            for needed in self.nodes[key].needs:
                visit(needed, (*path, key))
            done[key] = self.nodes[key]

        for key in wanted:
            visit(key, ())
        return [n for n in done.values() if n.kind not in LEAVES]

    def is_static(self, key: str) -> bool:
        """Tell whether a node depends on parameters and constants alone."""
        node = self.nodes[key]
        if node.kind in LEAVES:
            return node.kind in STATIC_LEAVES
        return all(self.is_static(k) for k in node.needs)


def build_graph(plant: Plant, effects: tuple[Effect, ...]) -> Graph:
    """Bind every equation of the plant and its effects.

    Raises ArmidError for an unknown name or port, for two effects of one name, and for a circle.
    """
    graph = Graph()
    for key, kind in leaves(plant, effects):
        graph.add(Node(key, kind))
    for owner in (None, *effects):
        add_equations(graph, plant, owner)
    for port in plant.ports:
        terms = tuple(f"{e.name}__{port}" for e in effects if port in e.adds)
        graph.add(Node(port, "port", terms=terms))
    graph.order(graph.nodes)
    for node in graph.of_kind("initial"):
        if not all(graph.is_static(k) or graph.nodes[k].kind == "initial" for k in node.needs):
            state = node.key.removeprefix("initial__").replace("__", ".")
            raise ArmidError(f"the initial value of '{state}' depends on what moves: parameters, constants and initial "
                             "states are expected")  # fmt: skip
    return graph


def leaves(plant: Plant, effects: tuple[Effect, ...]) -> list[tuple[str, str]]:
    """Return key and kind of what no equation gives."""
    found = [(p.name, "parameter") for p in plant.parameters] + [(s.name, "state") for s in plant.states]
    for e in effects:
        found += [(f"{e.name}__{p.name}", "parameter") for p in e.parameters]
        found += [(f"{e.name}__{s.name}", "state") for s in e.states]
        found += [(f"{e.name}__{g.name}", "latch") for g in e.guards if g.latch]
    found += [(c.name, "constant") for c in plant.constants] + [(i.name, "input") for i in plant.inputs]
    return [*found, *((g.name, "latch") for g in plant.guards if g.latch), ("time", "time")]


def add_equations(graph: Graph, plant: Plant, effect: Effect | None) -> None:
    """Add the equations of an effect, or of the plant, each bound to what it asks for."""
    owner, prefix = ("", "") if effect is None else (effect.name, f"{effect.name}__")
    who = f"plant '{plant.name}'" if effect is None else f"effect '{owner}'"

    def equation(key: str, kind: str, function: Equation, what: str) -> None:
        bound = bind(function, f"{who}, {what},", names_for(plant, effect, kind == "initial"))
        graph.add(Node(key, kind, owner, function, bound))

    if effect is None:
        for name, function in plant.quantities.items():
            equation(name, "quantity", function, f"quantity '{name}'")
    else:
        for port, function in effect.adds.items():
            if port not in plant.ports:
                raise ArmidError(f"{who} adds to the port '{port}', which plant '{plant.name}' does not offer: "
                                 f"{nearest(port, plant.ports)}")  # fmt: skip
            equation(f"{prefix}{port}", "term", function, f"port '{port}'")
    holder = plant if effect is None else effect
    for state in holder.states:
        equation(f"rate__{prefix}{state.name}", "rate", state.rate, f"rate of '{state.name}'")
        equation(f"initial__{prefix}{state.name}", "initial", state.initial, f"initial value of '{state.name}'")
    for guard in holder.guards:
        equation(f"guard__{prefix}{guard.name}", "guard", guard.function, f"guard '{guard.name}'")


def bind(function: Equation, label: str, names: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return (argument, key) for each argument that has a meaning here; names: name -> key.

    Raises ArmidError for *args and **kwargs, and for a name that nobody offers; an argument with a default may stay
    unbound.
    """
    bound = []
    for a in inspect.signature(function).parameters.values():
        if a.kind not in (a.POSITIONAL_OR_KEYWORD, a.POSITIONAL_ONLY):
            raise ArmidError(f"{label} has the argument '{a}': plain named arguments are expected")
        if a.name in names:
            bound.append((a.name, names[a.name]))
        elif a.default is a.empty:
            raise ArmidError(f"{label} asks for '{a.name}', which nobody offers here: {nearest(a.name, names)}")
    return tuple(bound)


def names_for(plant: Plant, effect: Effect | None, initial: bool) -> dict[str, str]:
    """Return name -> key of what equations of one owner may ask for; initial: in an initial value."""
    shared = [*(p.name for p in plant.parameters), *(c.name for c in plant.constants), *plant.quantities, *plant.ports]
    names = {n: n for n in shared}
    names |= {s.name: f"initial__{s.name}" if initial else s.name for s in plant.states}
    if not initial:
        names |= {n: n for n in [*(i.name for i in plant.inputs), *(g.name for g in plant.guards if g.latch), "time"]}
    names |= {alias: names[name] for alias, name in plant.aliases.items() if name in names}
    if effect is None:
        return names
    for argument, name in effect.binds.items():
        if name not in names and not initial:
            raise ArmidError(f"effect '{effect.name}' binds '{argument}' to '{name}', which nobody offers here: "
                             f"{nearest(name, names)}")  # fmt: skip
        names |= {argument: names[name]} if name in names else {}
    names |= {p.name: f"{effect.name}__{p.name}" for p in effect.parameters}
    names |= {s.name: f"{'initial__' if initial else ''}{effect.name}__{s.name}" for s in effect.states}
    return names | {g.name: f"{effect.name}__{g.name}" for g in effect.guards if g.latch}
