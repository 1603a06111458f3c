"""The source text of one plain function, made self-contained for the generated module."""

import ast
import builtins
import inspect
import math
import textwrap
from collections.abc import Callable
from dataclasses import dataclass, field
from types import FunctionType, LambdaType, ModuleType
from typing import Any

import numpy as np

from armid.model import ArmidError

CONTROL_FLOW = (ast.If, ast.While, ast.For, ast.Try, ast.With, ast.Match)
ALLOWED_BUILTINS = {"abs", "min", "max", "float", "int", "bool", "range", "len", "round", "pow", "True", "False"}


@dataclass
class SourceText:
    """Collect the texts of functions by their new name, helpers first; `by_lane` names those with control flow."""

    texts: dict[str, str] = field(default_factory=dict)
    by_lane: set[str] = field(default_factory=set)

    def add(self, name: str, function: Callable[..., Any]) -> None:
        """Add one function under a new name, with the helpers that it calls.

        Raises ArmidError when its source cannot be read or it uses something that cannot be compiled.
        """
        function = inspect.unwrap(getattr(function, "py_func", function))
        definition = function_definition(name, function)
        names = Names(name, function, self)
        definition = names.visit(Vectorise().visit(definition))
        helpers = {t for t in self.by_lane if t.startswith(f"{name}__")}
        if helpers or any(isinstance(node, CONTROL_FLOW) for node in ast.walk(definition)):
            self.by_lane.add(name)
        self.texts[name] = ast.unparse(ast.fix_missing_locations(definition))


def function_definition(name: str, function: Callable[..., Any]) -> ast.FunctionDef:
    """Return the parsed definition with a new name, bare of docstring, decorators and annotations."""
    label = getattr(function, "__qualname__", repr(function))
    if not isinstance(function, FunctionType):
        raise ArmidError(f"the equation {label} is no plain Python function: write it as a def")
    try:
        source = textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError) as error:
        raise ArmidError(f"the source of the equation {label} cannot be read: define it in a file") from error
    if function.__name__ == "<lambda>":
        return lambda_definition(name, function, source)
    tree = ast.parse(source).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise ArmidError(f"the equation {label} is no plain Python function: write it as a def")
    body = [s for s in tree.body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))]
    return make_definition(name, tree.args, body)


def make_definition(name: str, arguments: ast.arguments, body: list[ast.stmt]) -> ast.FunctionDef:
    """Return a definition without annotations."""
    for argument in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs):
        argument.annotation = None
    empty = ast.parse("def f(): pass").body[0]
    assert isinstance(empty, ast.FunctionDef)
    empty.name, empty.args, empty.body = name, arguments, body
    return empty


def lambda_definition(name: str, function: LambdaType, source: str) -> ast.FunctionDef:
    """Return the definition of a lambda when it stands alone in its line."""
    wanted = list(inspect.signature(function).parameters)
    for text in (source, source.strip().rstrip(",)"), f"({source.strip().rstrip(',')})", f"{{{source.strip()}}}"):
        try:
            tree = ast.parse(text)
        except SyntaxError:
            continue
        found = [n for n in ast.walk(tree) if isinstance(n, ast.Lambda) and [a.arg for a in n.args.args] == wanted]
        if len(found) == 1:
            return make_definition(name, found[0].args, [ast.Return(found[0].body)])
    raise ArmidError(f"the source of a lambda with the arguments {', '.join(wanted)} cannot be told from its "
                     "neighbours: write it as a def")  # fmt: skip


def call(function: str, *arguments: ast.expr) -> ast.Call:
    """Return the expression `np.function(...)`."""
    return ast.Call(ast.Attribute(ast.Name("np", ast.Load()), function, ast.Load()), list(arguments), [])


class Vectorise(ast.NodeTransformer):
    """Turn choices inside expressions into selections, and small whole powers into products."""

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        return call("where", node.test, node.body, node.orelse)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        name = "logical_and" if isinstance(node.op, ast.And) else "logical_or"
        result = node.values[0]
        for value in node.values[1:]:
            result = call(name, result, value)
        return result

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        self.generic_visit(node)
        return call("logical_not", node.operand) if isinstance(node.op, ast.Not) else node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        left, result = node.left, None
        for operator, right in zip(node.ops, node.comparators, strict=True):
            one = ast.Compare(left, [operator], [right])
            result = one if result is None else call("logical_and", result, one)
            left = right
        assert result is not None
        return result

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        if not (isinstance(node.op, ast.Pow) and isinstance(node.right, ast.Constant)):
            return node
        square = call("square", node.left)
        simple = {1: node.left, 2: square, 3: ast.BinOp(square, ast.Mult(), node.left), 4: call("square", square),
                  0.5: call("sqrt", node.left), -1: ast.BinOp(ast.Constant(1.0), ast.Div(), node.left)}  # fmt: skip
        value = node.right.value
        return simple.get(value, node) if isinstance(value, (int, float)) else node


class Names(ast.NodeTransformer):
    """Replace what a function takes from its file: numpy and math by themselves, numbers by value, helpers by copy."""

    def __init__(self, name: str, function: Callable[..., Any], sources: SourceText) -> None:
        self.name, self.function, self.sources = name, function, sources
        closure = inspect.getclosurevars(function)
        self.outside = {**closure.globals, **closure.nonlocals}
        self.local = set(function.__code__.co_varnames)

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id in self.local or not isinstance(node.ctx, ast.Load):
            return node
        if node.id in self.outside:
            return self.replacement(node.id, self.outside[node.id])
        if node.id in ALLOWED_BUILTINS or (node.id == "np" and hasattr(builtins, node.id) is False):
            return node
        raise ArmidError(f"the equation {self.function.__qualname__} uses '{node.id}', which cannot be compiled: "
                         "numpy, math, numbers and plain functions are expected")  # fmt: skip

    def replacement(self, name: str, value: Any) -> ast.AST:
        """Return what stands for an outside name in the generated module."""
        if isinstance(value, ModuleType) and value in (np, math):
            return ast.Name("np" if value is np else "math", ast.Load())
        if isinstance(value, (bool, int, float, np.floating, np.integer)):
            return ast.Constant(float(value))
        if getattr(np, getattr(value, "__name__", ""), None) is value:
            return ast.Attribute(ast.Name("np", ast.Load()), value.__name__, ast.Load())
        if getattr(math, getattr(value, "__name__", ""), None) is value:
            return ast.Attribute(ast.Name("math", ast.Load()), value.__name__, ast.Load())
        if isinstance(getattr(value, "py_func", value), FunctionType):
            helper = f"{self.name}__{name}"
            if helper.count(f"__{name}") > 1:
                raise ArmidError(f"the equation {self.function.__qualname__} calls itself: write it as a loop")
            if helper not in self.sources.texts:
                self.sources.add(helper, value)
            return ast.Name(helper, ast.Load())
        raise ArmidError(f"the equation {self.function.__qualname__} uses '{name}' ({type(value).__name__}), which "
                         "cannot be compiled: numpy, math, numbers and plain functions are expected")  # fmt: skip
