"""Binding by argument name: the equations of a plant and its effects as one acyclic graph."""

import ast
import copy
import inspect
import re
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import FunctionType, LambdaType
from typing import Any

import numpy as np

from armid.errors import ModelError, nearest
from armid.model.effect import Effect, Equation
from armid.model.plant import Plant

LATE_LEAVES = ("late_state", "late_input")
LEAVES = ("parameter", "constant", "state", "input", "latch", "time", *LATE_LEAVES)
STATIC_LEAVES = ("parameter", "constant")


@dataclass(frozen=True)
class Node:
    """One name of the composed equations.

    key: flat, unique identifier (`omega`, `coulomb__level`); kind: a leaf, or "quantity", "term", "port", "rate",
    "initial", "guard", "late" (a quantity of late leaves; "delayed" until these are there); arguments: (argument of the
    function, key it is bound to); terms: what a port sums; by: keys of the parameters whose sum is the delay of a late
    leaf [s].
    """

    key: str
    kind: str
    owner: str = ""
    function: Equation | None = None
    arguments: tuple[tuple[str, str], ...] = ()
    terms: tuple[str, ...] = ()
    by: tuple[str, ...] = ()

    @property
    def needs(self) -> tuple[str, ...]:
        return self.terms or tuple(key for _, key in self.arguments)

    def value(self, known: Mapping[str, Any]) -> Any:
        """Return the value of the node by its plain function; known: key -> value of what it needs."""
        if self.function is None:
            return sum((known[t] for t in self.terms), 0.0)
        return self.function(**{a: known[k] for a, k in self.arguments})


@dataclass
class Graph:
    nodes: dict[str, Node] = field(default_factory=dict)
    # what was asked for -> its order, of a graph that is complete
    orders: dict[tuple[str, ...], list[Node]] = field(default_factory=dict)

    def add(self, node: Node) -> None:
        self.nodes[node.key] = node

    def of_kind(self, *kinds: str) -> list[Node]:
        return [n for n in self.nodes.values() if n.kind in kinds]

    def order(self, wanted: Iterable[str]) -> list[Node]:
        """Return the nodes that are no leaves and lead to the wanted ones, each after what it needs."""
        done: dict[str, Node] = {}

        def visit(key: str, path: tuple[str, ...]) -> None:
            if key in done:
                return
            if key in path:
                circle = " -> ".join((*path[path.index(key) :], key)).replace("__", ".")
                raise ModelError(f"the equations run in a circle: {circle}; use a state or an earlier quantity instead")
            for needed in self.nodes[key].needs:
                visit(needed, (*path, key))
            done[key] = self.nodes[key]

        for key in wanted:
            visit(key, ())
        return [n for n in done.values() if n.kind not in LEAVES]

    def values(self, wanted: Iterable[str], known: Mapping[str, Any]) -> dict[str, Any]:
        """Return key -> value of what is known and of all that leads to the wanted nodes, by their plain functions."""
        values, keys = dict(known), tuple(wanted)
        if keys not in self.orders:
            self.orders[keys] = self.order(keys)
        for node in self.orders[keys]:
            values[node.key] = node.value(values)
        return values

    def is_static(self, key: str) -> bool:
        """Tell whether a node depends on parameters and constants alone."""
        node = self.nodes[key]
        if node.kind in LEAVES:
            return node.kind in STATIC_LEAVES
        return all(self.is_static(k) for k in node.needs)

    def depends_on(self, key: str, others: Iterable[str]) -> bool:
        """Tell whether a node depends on one of some others, directly or through the rates of states."""
        left, seen = [key], set[str]()
        while left:
            near = left.pop()
            if near not in seen:
                seen.add(near)
                left += [f"rate__{near}"] if self.nodes[near].kind == "state" else self.nodes[near].needs
        return not seen.isdisjoint(others)


def build_graph(plant: Plant, effects: tuple[Effect, ...]) -> Graph:
    graph = Graph()
    for key, kind in leaves(plant, effects):
        graph.add(Node(key, kind))
    for name in plant.rough:
        arguments = (("value", name), ("error", f"{name}_error"))
        graph.add(Node(f"{name}__corrected", "quantity", function=corrected, arguments=arguments))
    for owner in (None, *effects):
        add_equations(graph, plant, owner)
    for port in plant.ports:
        terms = tuple(f"{e.name}__{port}" for e in effects if port in e.adds)
        graph.add(Node(port, "port", terms=terms))
    graph.order(graph.nodes)  # a circle is refused here, and again below one that begins at the start
    for node in graph.of_kind("initial"):
        graph.nodes[node.key] = replace(node, arguments=tuple((a, at_start(graph, k)) for a, k in node.arguments))
    graph.order(graph.nodes)
    add_late_nodes(graph)
    return graph


def add_late_nodes(graph: Graph) -> None:
    """Give each delayed signal, so far the signal itself, the equation of the signal on late states and inputs."""
    delayed = graph.of_kind("delayed")
    made = {node.key: graph.nodes[late(graph, node.arguments[0][1], node.by)] for node in delayed}
    for key, node in made.items():
        graph.nodes[key] = replace(node, key=key)
        graph.nodes.pop(node.key, None) if node.kind == "late" else None


def late(graph: Graph, key: str, by: tuple[str, ...]) -> str:
    """Return the key of what a node was before the sum of some parameters; what it needs is made late in turn."""
    node, name = graph.nodes[key], f"late__{'__and__'.join(by)}__of__{key}"
    if name in graph.nodes:
        return name
    if node.kind == "latch":
        raise ModelError(f"effect '{by[0].partition('__')[0]}' delays what depends on the switch '{spelled(key)}': a "
                         "signal without a switch is expected, and a guard for the late switch")  # fmt: skip
    if node.kind == "delayed":
        return late(graph, node.arguments[0][1], tuple(sorted((*by, *node.by))))
    if node.kind in ("state", "input"):
        graph.nodes[name] = Node(name, f"late_{node.kind}", arguments=(("value", key),), by=by)
    elif node.kind == "time":
        sooner = key if len(by) == 1 else late(graph, key, by[:-1])
        graph.nodes[name] = Node(name, "late", function=earlier, arguments=(("time", sooner), ("delay", by[-1])))
    elif graph.is_static(key):
        return key
    else:
        arguments = tuple((a, late(graph, k, by)) for a, k in node.arguments)
        terms = tuple(late(graph, k, by) for k in node.terms)
        # of one delay only its own effect makes use, of a delay within a delay two do
        owner = by[0].partition("__")[0] if len(by) == 1 else ""
        graph.nodes[name] = replace(node, key=name, kind="late", owner=owner, arguments=arguments, terms=terms)
    return name


def itself(value: float) -> float:
    return value


def earlier(time: float, delay: float) -> float:
    return time - delay


def at_start(graph: Graph, key: str) -> str:
    """Return the key of what a node is at the start; quantities that move are evaluated there, at the first inputs."""
    node, started = graph.nodes[key], f"initial__{key}"
    if started in graph.nodes:
        return started
    if node.kind in ("input", "time", "initial") or graph.is_static(key):
        return key
    graph.nodes[started] = replace(node, key=started, kind="initial")  # before its needs: a circle ends
    if node.kind == "latch":
        node = replace(node, function=switched_at_start, arguments=(("guard", f"guard__{key}"),))
    arguments = tuple((a, at_start(graph, k)) for a, k in node.arguments)
    terms = tuple(at_start(graph, k) for k in node.terms)
    graph.nodes[started] = replace(node, key=started, kind="initial", arguments=arguments, terms=terms)
    return started


def corrected(value: float, error: float) -> float:
    """Return a value that is known roughly, error its relative error."""
    return value * (1.0 + error)


def switched_at_start(guard: float) -> Any:
    return np.where(guard <= 0.0, 1.0, 0.0)


def leaves(plant: Plant, effects: tuple[Effect, ...]) -> list[tuple[str, str]]:
    """Return key and kind of what no equation gives."""
    leaves = [(p.name, "parameter") for p in plant.parameters] + [(s.name, "state") for s in plant.states]
    for e in effects:
        leaves += [(f"{e.name}__{p.name}", "parameter") for p in e.parameters]
        leaves += [(f"{e.name}__{s.name}", "state") for s in e.states]
        leaves += [(f"{e.name}__{g.name}", "latch") for g in e.guards if g.latch]
    leaves += [(c.name, "constant") for c in plant.constants] + [(i.name, "input") for i in plant.inputs]
    return [*leaves, *((g.name, "latch") for g in plant.guards if g.latch), ("time", "time")]


def add_equations(graph: Graph, plant: Plant, effect: Effect | None) -> None:
    owner, prefix = ("", "") if effect is None else (effect.name, f"{effect.name}__")
    who = f"plant '{plant.name}'" if effect is None else f"effect '{owner}'"

    def equation(key: str, kind: str, function: Equation, what: str) -> None:
        bound = bind(function, f"{who}, {what},", names_for(plant, effect, kind == "initial"))
        graph.add(Node(key, kind, owner, function, bound))

    if effect is None:
        for name, function in plant.quantities.items():
            equation(name, "quantity", function, f"quantity '{name}'")
    else:
        if effect.unless in plant.ports:
            raise ModelError(f"{who} is for plants without the port '{effect.unless}'")
        for port, function in effect.adds.items():
            if port not in plant.ports:
                raise ModelError(f"{who} adds to the port '{port}', which plant '{plant.name}' does not offer: "
                                 f"{nearest(port, plant.ports)}")  # fmt: skip
            equation(f"{prefix}{port}", "term", function, f"port '{port}'")
    for delay in () if effect is None else effect.delays:
        now = f"{prefix}{delay.name}__now"
        equation(now, "quantity", delay.of, f"late signal '{delay.name}'")
        by = (f"{prefix}{delay.by}",)
        graph.add(Node(f"{prefix}{delay.name}", "delayed", owner, itself, (("value", now),), by=by))
    holder = plant if effect is None else effect
    for state in holder.states:
        equation(f"rate__{prefix}{state.name}", "rate", state.rate, f"rate of '{state.name}'")
        equation(f"initial__{prefix}{state.name}", "initial", state.initial, f"initial value of '{state.name}'")
    for guard in holder.guards:
        equation(f"guard__{prefix}{guard.name}", "guard", guard.function, f"guard '{guard.name}'")


def bind(function: Equation, label: str, names: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return (argument, key) for each argument that has a meaning here; one with a default may stay unbound."""
    bound = []
    for a in inspect.signature(function).parameters.values():
        if a.kind not in (a.POSITIONAL_OR_KEYWORD, a.POSITIONAL_ONLY):
            raise ModelError(f"{label} has the argument '{a}': plain named arguments are expected")
        if a.name in names:
            bound.append((a.name, names[a.name]))
        elif a.default is a.empty:
            raise ModelError(f"{label} asks for '{a.name}', which nobody offers here: {nearest(a.name, names)}")
    return tuple(bound)


def names_for(plant: Plant, effect: Effect | None, initial: bool) -> dict[str, str]:
    """Return name -> key of what equations of one owner may ask for; initial: in an initial value."""
    shared = [*(p.name for p in plant.parameters), *(c.name for c in plant.constants), *plant.quantities, *plant.ports]
    names = {n: n for n in shared} | {n: f"{n}__corrected" for n in plant.rough}
    names |= {s.name: f"initial__{s.name}" if initial else s.name for s in plant.states}
    if not initial:
        names |= {n: n for n in [*(i.name for i in plant.inputs), *(g.name for g in plant.guards if g.latch), "time"]}
    names |= {alias: names[name] for alias, name in plant.aliases.items() if name in names}
    if effect is None:
        return names
    if "output" in effect.adds and not plant.records_omega:
        names.pop("omega", None)
    for argument, name in effect.binds.items():
        if name not in names and not initial:
            raise ModelError(f"effect '{effect.name}' binds '{argument}' to '{name}', which nobody offers here: "
                             f"{nearest(name, names)}")  # fmt: skip
        names |= {argument: names[name]} if name in names else {}
        if plant.aliases.get(name, name) in (i.name for i in plant.inputs):
            names |= {argument: plant.aliases.get(name, name)}  # an initial value takes the first sample of an input
    names |= {p.name: f"{effect.name}__{p.name}" for p in effect.parameters}
    names |= {s.name: f"{'initial__' if initial else ''}{effect.name}__{s.name}" for s in effect.states}
    names |= {d.name: f"{effect.name}__{d.name}" for d in effect.delays if not initial}
    return names | {g.name: f"{effect.name}__{g.name}" for g in effect.guards if g.latch}


def spelled(key: str) -> str:
    by, is_late, of = key.removeprefix("late__").partition("__of__")
    if key.startswith("late__") and is_late:
        return f"{spelled(of)}(t - {' - '.join(map(spelled, by.split('__and__')))})"
    return key.replace("__", ".")


def right_hand_side(node: Node) -> str:
    if node.function is None:
        return " + ".join(spelled(t) for t in node.terms) or "0"
    return returned_text(node.function, {a: spelled(k) for a, k in node.arguments})


def equations_text(plant: Plant, effects: tuple[Effect, ...], graph: Graph) -> str:
    """Return the composed equations: motion, then what they need, then start, switches and the recorded signal."""

    def unit_of(node: Node) -> str:
        return f"  [{plant.ports[node.key]}]" if node.kind == "port" else ""

    lines = [" + ".join([plant.name, *(e.name for e in effects)])]
    rates = graph.of_kind("rate")
    lines += [f"  d {spelled(r.key.removeprefix('rate__'))}/dt = {right_hand_side(r)}" for r in rates]
    guards = graph.of_kind("guard")
    needed = graph.order([n.key for n in (*rates, *guards)] + [o.signal for o in plant.outputs])
    inner = [n for n in needed if n.kind in ("quantity", "port", "term", "late")]
    lines += ["  where"] + [f"    {spelled(n.key)} = {right_hand_side(n)}{unit_of(n)}" for n in inner]
    lines += ["  start"] + [
        f"    {spelled(n.key.removeprefix('initial__'))} = {right_hand_side(n).replace('initial.', '')}"
        for n in graph.of_kind("initial")
    ]
    latches = {n.key for n in graph.of_kind("latch")}
    for guard in guards:
        name = guard.key.removeprefix("guard__")
        what = "switches once to 1 when" if name in latches else "kink where"
        sign = "<= 0" if name in latches else "= 0"
        lines.append(f"  {spelled(name)}: {what} {right_hand_side(guard)} {sign}")
    for o in plant.outputs:
        name = "" if plant.records_one_speed else f" {o.name}"
        lines.append(f"  recorded{name} [{o.unit}]: {o.signal}")
    return "\n".join(lines)


def returned_text(function: Equation, names: Mapping[str, str] | None = None) -> str:
    """Return the expression that a function returns, or its call when it has several lines.

    names: argument -> the name that replaces it, for bound ones; None: every argument keeps its name.
    """
    names = {a: a for a in inspect.signature(function).parameters} if names is None else names
    expression = returned_expression(function, names)
    return f"{function.__name__}({', '.join(names.values())})" if expression is None else ast.unparse(expression)


class Insert(ast.NodeTransformer):
    """Replace names by expressions, and drop the prefix of numpy."""

    def __init__(self, known: Mapping[str, ast.expr]) -> None:
        self.known = known

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return copy.deepcopy(self.known.get(node.id, node))

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        if isinstance(node.value, ast.Name) and node.value.id in ("np", "numpy", "math"):
            return ast.Name(node.attr, node.ctx)
        return self.generic_visit(node)


def returned_expression(function: Equation, names: Mapping[str, str]) -> ast.expr | None:
    """Return the expression of a function with its earlier assignments put in; None when it branches or loops."""
    try:
        body = definition_of(function).body
    except ModelError:
        return None
    known: dict[str, ast.expr] = {a: ast.Name(name) for a, name in names.items()}
    for statement in body:
        if isinstance(statement, ast.Return) and statement.value is not None:
            return Insert(known).visit(statement.value)  # type: ignore[no-any-return]
        if not (isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)):
            return None
        known[statement.targets[0].id] = Insert(known).visit(statement.value)
    return None


def definition_of(function: Equation) -> ast.FunctionDef:
    """Return the definition, bare of docstring, decorators and annotations; a lambda becomes one `return`."""
    label = getattr(function, "__qualname__", repr(function))
    if not isinstance(function, FunctionType):
        raise ModelError(f"the equation {label} is not a plain Python function: write it as a def")
    try:
        # a comment may stand further out than what it stands in
        source = textwrap.dedent(re.sub(r"(?m)^\s*#.*\n", "", inspect.getsource(function)))
    except (OSError, TypeError) as error:
        raise ModelError(f"the source of the equation {label} cannot be read: define it in a file") from error
    if function.__name__ == "<lambda>":
        return lambda_definition(function)
    tree = ast.parse(source).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise ModelError(f"the equation {label} is not a plain Python function: write it as a def")
    body = [s for s in tree.body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))]
    kinds = {type(node) for statement in body for node in ast.walk(statement)}
    if ast.Return not in kinds:
        what = "raises an error and returns nothing" if ast.Raise in kinds else "returns nothing"
        raise ModelError(f"the equation {label} {what}: a number is expected")
    return make_definition(tree.name, tree.args, body)


def lambda_definition(function: LambdaType) -> ast.FunctionDef:
    """Return the definition of a lambda, found in its file by the place of its code."""
    module = inspect.getmodule(function)
    lines = inspect.findsource(function)[0] if module is None else inspect.getsourcelines(module)[0]
    lambdas = [n for n in lambdas_in("".join(lines)) if is_code_of(n, function)]
    if not lambdas:
        arguments = ", ".join(inspect.signature(function).parameters)
        raise ModelError(f"the source of a lambda with the arguments {arguments} cannot be found: write it as a def")
    # The innermost: a lambda may stand inside another.
    innermost = copy.deepcopy(max(lambdas, key=lambda n: (n.lineno, n.col_offset)))
    return make_definition("<lambda>", innermost.args, [ast.Return(innermost.body)])


@cache
def lambdas_in(text: str) -> list[ast.Lambda]:
    """Return the lambdas of a file; a plant has many in one."""
    return [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Lambda)]


def is_code_of(node: ast.Lambda, function: LambdaType) -> bool:
    """Tell whether the body of a lambda in a file is the code of a function."""
    code, body = function.__code__, node.body
    if [a.arg for a in node.args.args] != list(code.co_varnames[: code.co_argcount]):
        return False
    places = [p for p in code.co_positions() if p[0] is not None and p[2] is not None and p[3]]
    begin, end = (body.lineno, body.col_offset), (body.end_lineno or 0, body.end_col_offset or 0)
    return bool(places) and all(begin <= (line or 0, first or 0) <= end for line, _, first, _ in places)


def make_definition(name: str, arguments: ast.arguments, body: list[ast.stmt]) -> ast.FunctionDef:
    for argument in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs):
        argument.annotation = None
    empty = ast.parse("def f(): pass").body[0]
    assert isinstance(empty, ast.FunctionDef)
    empty.name, empty.args, empty.body = name, arguments, body
    return empty
