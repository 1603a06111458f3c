"""Equations as text: what `print(model)` shows."""

import ast
import copy
import inspect
import textwrap
from types import FunctionType, LambdaType

from armid.errors import ArmidError
from armid.model.effect import Effect, Equation
from armid.model.graph import Graph, Node
from armid.model.plant import Plant


def spelled(key: str) -> str:
    """Return a key as `print(model)` writes it."""
    return key.replace("__", ".")


def right_hand_side(node: Node) -> str:
    """Return the text right of the equals sign."""
    if node.kind == "port":
        return " + ".join(spelled(t) for t in node.terms) or "0"
    if node.function is None:
        return ""
    expression = returned_expression(node.function)
    if expression is None:
        return f"{node.function.__name__}({', '.join(spelled(k) for _, k in node.arguments)})"
    return ast.unparse(Rename({a: spelled(k) for a, k in node.arguments}).visit(expression))


def equations_text(plant: Plant, effects: tuple[Effect, ...], graph: Graph) -> str:
    """Return the composed equations: motion, then what they need, then start, switches and the recorded signal."""

    def unit_of(node: Node) -> str:
        return f"  [{plant.ports[node.key]}]" if node.kind == "port" else ""

    lines = [" + ".join([plant.name, *(e.name for e in effects)])]
    rates = graph.of_kind("rate")
    lines += [f"  d {spelled(r.key.removeprefix('rate__'))}/dt = {right_hand_side(r)}" for r in rates]
    guards = graph.of_kind("guard")
    needed = graph.order([n.key for n in (*rates, *guards)] + [plant.output])
    inner = [n for n in needed if n.kind in ("quantity", "port", "term")]
    lines += ["  where"] + [f"    {spelled(n.key)} = {right_hand_side(n)}{unit_of(n)}" for n in inner]
    lines += ["  start"] + [
        f"    {spelled(n.key.removeprefix('initial__'))} = {right_hand_side(n).replace('initial.', '')}"
        for n in graph.of_kind("initial")
    ]
    latches = {g.name for g in plant.guards if g.latch}
    latches |= {f"{e.name}__{g.name}" for e in effects for g in e.guards if g.latch}
    for guard in guards:
        name = guard.key.removeprefix("guard__")
        what = "switches once to 1 when" if name in latches else "kink where"
        sign = "<= 0" if name in latches else "= 0"
        lines.append(f"  {spelled(name)}: {what} {right_hand_side(guard)} {sign}")
    lines.append(f"  recorded [{plant.output_unit}]: {plant.output}")
    return "\n".join(lines)


def returned_text(function: Equation) -> str:
    """Return the expression that a function returns, in its own names, or its call when it has several lines."""
    expression = returned_expression(function)
    if expression is None:
        return f"{function.__name__}({', '.join(inspect.signature(function).parameters)})"
    return ast.unparse(Rename({}).visit(expression))


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


def definition_of(function: Equation) -> ast.FunctionDef:
    """Return the definition, bare of docstring, decorators and annotations; a lambda becomes one `return`.

    Raises ArmidError for anything but a plain Python function whose source can be read and that returns something.
    """
    label = getattr(function, "__qualname__", repr(function))
    if not isinstance(function, FunctionType):
        raise ArmidError(f"the equation {label} is no plain Python function: write it as a def")
    try:
        source = textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError) as error:
        raise ArmidError(f"the source of the equation {label} cannot be read: define it in a file") from error
    if function.__name__ == "<lambda>":
        return lambda_definition(function)
    tree = ast.parse(source).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise ArmidError(f"the equation {label} is no plain Python function: write it as a def")
    body = [s for s in tree.body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))]
    if not any(isinstance(node, ast.Return) for statement in body for node in ast.walk(statement)):
        raise ArmidError(f"the equation {label} returns nothing: a number is expected")
    return make_definition(tree.name, tree.args, body)


def lambda_definition(function: LambdaType) -> ast.FunctionDef:
    """Return the definition of a lambda, found in its file by the place of its code.

    Raises ArmidError when the file does not show it.
    """
    module = inspect.getmodule(function)
    lines = inspect.findsource(function)[0] if module is None else inspect.getsourcelines(module)[0]
    nodes = ast.walk(ast.parse("".join(lines)))
    found = [n for n in nodes if isinstance(n, ast.Lambda) and is_code_of(n, function)]
    if not found:
        arguments = ", ".join(inspect.signature(function).parameters)
        raise ArmidError(f"the source of a lambda with the arguments {arguments} cannot be found: write it as a def")
    # The innermost: a lambda may stand inside another.
    innermost = max(found, key=lambda n: (n.lineno, n.col_offset))
    return make_definition("<lambda>", innermost.args, [ast.Return(innermost.body)])


def is_code_of(node: ast.Lambda, function: LambdaType) -> bool:
    """Tell whether the body of a lambda in a file is the code of a function."""
    places = [p for p in function.__code__.co_positions() if p[0] is not None and p[2] is not None and p[3]]
    body = node.body
    begin, end = (body.lineno, body.col_offset), (body.end_lineno or 0, body.end_col_offset or 0)
    inside = [begin <= (line or 0, first or 0) <= end for line, _, first, _ in places]
    same = [a.arg for a in node.args.args] == list(function.__code__.co_varnames[: function.__code__.co_argcount])
    return same and bool(inside) and all(inside)


def make_definition(name: str, arguments: ast.arguments, body: list[ast.stmt]) -> ast.FunctionDef:
    """Return a definition without annotations."""
    for argument in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs):
        argument.annotation = None
    empty = ast.parse("def f(): pass").body[0]
    assert isinstance(empty, ast.FunctionDef)
    empty.name, empty.args, empty.body = name, arguments, body
    return empty
