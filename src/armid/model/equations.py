"""Equations as text: what `print(model)` shows."""

import ast
import copy
import inspect

from armid.model.definition import definition_of
from armid.model.effect import Effect, Equation
from armid.model.errors import ArmidError
from armid.model.graph import Graph, Node
from armid.model.plant import Plant


class Rename(ast.NodeTransformer):
    """Put the bound names into an expression and drop the prefix of numpy."""

    def __init__(self, names: dict[str, str]) -> None:
        self.names = names

    def visit_Name(self, node: ast.Name) -> ast.Name:
        return ast.Name(self.names.get(node.id, node.id), node.ctx)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        if isinstance(node.value, ast.Name) and node.value.id in ("np", "numpy", "math"):
            return ast.Name(node.attr, node.ctx)
        return self.generic_visit(node)


class Insert(ast.NodeTransformer):
    """Put expressions in the place of names."""

    def __init__(self, known: dict[str, ast.expr]) -> None:
        self.known = known

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return copy.deepcopy(self.known.get(node.id, node))


def returned_expression(function: Equation) -> ast.expr | None:
    """Return the expression of a function with its earlier assignments put in; None when it branches or loops."""
    try:
        body = definition_of(function).body
    except ArmidError:
        return None
    known: dict[str, ast.expr] = {}
    for statement in body:
        if isinstance(statement, ast.Return) and statement.value is not None:
            return Insert(known).visit(statement.value)  # type: ignore[no-any-return]
        if not (isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)):
            return None
        known[statement.targets[0].id] = Insert(known).visit(statement.value)
    return None


def shown(key: str) -> str:
    """Return a key as people write it."""
    return key.replace("__", ".")


def right_hand_side(node: Node) -> str:
    """Return the text right of the equals sign."""
    if node.kind == "port":
        return " + ".join(shown(t) for t in node.terms) or "0"
    if node.function is None:
        return ""
    expression = returned_expression(node.function)
    if expression is None:
        return f"{node.function.__name__}({', '.join(shown(k) for _, k in node.arguments)})"
    return ast.unparse(Rename({a: shown(k) for a, k in node.arguments}).visit(expression))


def equations_text(plant: Plant, effects: tuple[Effect, ...], graph: Graph) -> str:
    """Return the composed equations: motion, then what they need, then start, switches and the recorded signal."""
    lines = [" + ".join([plant.name, *(e.name for e in effects)])]
    rates = graph.of_kind("rate")
    lines += [f"  d {shown(r.key.removeprefix('rate__'))}/dt = {right_hand_side(r)}" for r in rates]
    guards = graph.of_kind("guard")
    needed = graph.order([n.key for n in (*rates, *guards)] + [plant.output])
    inner = [n for n in needed if n.kind in ("quantity", "port", "term")]
    lines += ["  where"] + [f"    {shown(n.key)} = {right_hand_side(n)}{_unit(n, plant)}" for n in inner]
    lines += ["  start"] + [
        f"    {shown(n.key.removeprefix('initial__'))} = {right_hand_side(n).replace('initial.', '')}"
        for n in graph.of_kind("initial")
    ]
    latches = {g.name for g in plant.guards if g.latch}
    latches |= {f"{e.name}__{g.name}" for e in effects for g in e.guards if g.latch}
    for guard in guards:
        name = guard.key.removeprefix("guard__")
        what = "switches once to 1 when" if name in latches else "kink where"
        sign = "<= 0" if name in latches else "= 0"
        lines.append(f"  {shown(name)}: {what} {right_hand_side(guard)} {sign}")
    lines.append(f"  recorded [{plant.output_unit}]: {plant.output}")
    return "\n".join(lines)


def _unit(node: Node, plant: Plant) -> str:
    return f"  [{plant.ports[node.key]}]" if node.kind == "port" else ""


def returned_text(function: Equation) -> str:
    """Return the expression that a function returns, in its own names, or its call when it has several lines."""
    expression = returned_expression(function)
    if expression is None:
        return f"{function.__name__}({', '.join(inspect.signature(function).parameters)})"
    return ast.unparse(Rename({}).visit(expression))
