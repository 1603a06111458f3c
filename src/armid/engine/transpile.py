"""The source text of one plain function, made self-contained for the generated module."""

import ast
import builtins
import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial, reduce
from itertools import pairwise
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from armid.engine.simd_math import LANE_FUNCTIONS
from armid.errors import ArmidError, nearest
from armid.model.graph import definition_of

# A name that no function can have; it becomes `np` when the names of the function are replaced.
NUMPY = "numpy itself"
NUMBER_CLASSES = (bool, int, float, np.floating, np.integer)
CONTROL_FLOW = (ast.If, ast.While, ast.For, ast.Try, ast.With, ast.Match)
LANE_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.BitAnd, ast.BitOr)
# What these return, or take, is one plain number: a function that uses them is computed lane by lane.
SCALAR_BUILTINS = {"float", "int", "bool", "range", "len", "round"}
ALLOWED_BUILTINS = {"abs", "min", "max", "pow", *SCALAR_BUILTINS}
# Names of the generated module itself: an argument or a variable of that name gets another one.
RESERVED_IN_KERNEL = {"np", "math", "lane", "with_lane", "splat", "WIDTH", "result", "i"}


def local_name(name: str) -> str:
    return f"{name}__own" if name in RESERVED_IN_KERNEL else name


@dataclass
class SourceText:
    """Collect the definitions of functions by their new name, helpers first; by_lane: those that choose or loop."""

    definitions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    by_lane: set[str] = field(default_factory=set)
    functions: dict[str, Callable[..., Any]] = field(default_factory=dict)

    def add(self, name: str, function: Callable[..., Any]) -> None:
        plain = plain_function(function)
        self.functions[name] = plain
        definition = with_values(definition_of(plain), plain)
        names = Names(name, plain, self)
        definition = names.visit(Vectorise().visit(definition))
        definition.name = name
        if names.is_scalar or any(isinstance(node, CONTROL_FLOW) for node in ast.walk(definition)):
            self.by_lane.add(name)
        self.definitions[name] = ast.fix_missing_locations(definition)

    def add_helper(self, caller: str, name: str, function: Callable[..., Any]) -> str:
        """Add what a function calls and return its new name."""
        plain, helper = plain_function(function), f"{caller}__{name}"
        if any(plain is f for n, f in self.functions.items() if n not in self.definitions):
            raise ArmidError(f"the equation {plain.__qualname__} calls itself: write it as a loop")
        while self.functions.get(helper, plain) is not plain:
            helper += "_"
        if helper not in self.definitions:
            self.add(helper, plain)
        return helper


def plain_function(function: Callable[..., Any]) -> Any:
    return inspect.unwrap(getattr(function, "py_func", function))


def with_values(definition: ast.FunctionDef, function: FunctionType) -> ast.FunctionDef:
    """Replace defaults by values, and make every argument one that can be named."""
    values = function.__defaults__ or ()
    for value in values:
        if not isinstance(value, NUMBER_CLASSES):
            raise ArmidError(f"the equation {function.__qualname__} has the default {value!r}: a number is expected")
    arguments = definition.args
    arguments.args = [*arguments.posonlyargs, *arguments.args]
    arguments.posonlyargs = []
    arguments.defaults = [number(value) for value in values]
    return definition


def number(value: Any) -> ast.expr:
    """Return the expression of a number; a negative one in parentheses of its own, as in (-2) ** x."""
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        plain: int | float = int(value)
    else:
        plain = float(value)
    if math.isnan(plain):
        return ast.Attribute(ast.Name("np", ast.Load()), "nan", ast.Load())
    return ast.UnaryOp(ast.USub(), ast.Constant(-plain)) if plain < 0 else ast.Constant(plain)


def is_number(node: ast.expr) -> bool:
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.op, ast.USub | ast.UAdd)
    return isinstance(node, ast.Constant) and not isinstance(node.value, bool)


def call(function: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Attribute(ast.Name(NUMPY, ast.Load()), function, ast.Load()), list(arguments), [])


class Vectorise(ast.NodeTransformer):
    """Turn choices inside expressions into selections, and small whole powers into products."""

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        return call("where", node.test, node.body, node.orelse)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        name = "logical_and" if isinstance(node.op, ast.And) else "logical_or"
        numeric = next((v for v in node.values if isinstance(v, ast.BinOp) or is_number(v)), None)
        if numeric is not None:
            raise ArmidError(f"'{ast.unparse(node)}' joins numbers by `{name.removeprefix('logical_')}`: conditions "
                             "are expected, and `a if condition else b` for a choice")  # fmt: skip
        self.generic_visit(node)
        return reduce(partial(call, name), node.values)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        self.generic_visit(node)
        return call("logical_not", node.operand) if isinstance(node.op, ast.Not) else node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        pairs = zip(pairwise([node.left, *node.comparators]), node.ops, strict=True)
        each: list[ast.expr] = [ast.Compare(a, [operator], [b]) for (a, b), operator in pairs]
        return reduce(partial(call, "logical_and"), each)

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        if not (isinstance(node.op, ast.Pow) and isinstance(node.right, ast.Constant)):
            return node
        square = call("square", node.left)
        simple = {1: node.left, 2: square, 3: ast.BinOp(square, ast.Mult(), node.left), 4: call("square", square),
                  0.5: call("sqrt", node.left), -1: ast.BinOp(ast.Constant(1.0), ast.Div(), node.left)}  # fmt: skip
        value = node.right.value
        return simple.get(value, node) if isinstance(value, (int, float)) else node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """Turn x += y into x = x + y: lanes cannot be changed in place."""
        if not isinstance(node.target, ast.Name):
            return self.generic_visit(node)
        value = ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value)
        return ast.Assign([node.target], self.visit(value))

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Nest min(a, b, c) and max(a, b, c): two at a time."""
        self.generic_visit(node)
        if not (isinstance(node.func, ast.Name) and node.func.id in ("min", "max") and len(node.args) > 2):
            return node
        return reduce(lambda first, second: ast.Call(node.func, [first, second], []), node.args)


class Names(ast.NodeTransformer):
    """Replace what a function takes from its file: numpy and math by themselves, numbers by value, helpers by copy."""

    def __init__(self, name: str, function: FunctionType, sources: SourceText) -> None:
        self.name, self.function, self.sources = name, function, sources
        closure = inspect.getclosurevars(function)
        self.outside = {**closure.globals, **closure.nonlocals}
        self.local = set(function.__code__.co_varnames)
        self.is_scalar = False

    def visit_arg(self, node: ast.arg) -> ast.AST:
        return ast.arg(local_name(node.arg))

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        value = node.value or ast.Constant(0.0)
        return ast.Assign([self.visit(node.target)], self.visit(value))

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.is_scalar |= not isinstance(node.op, LANE_OPERATORS)
        return self.generic_visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.value, ast.Name) and node.value.id in ("np", "math"):
            self.note_call(getattr(np if node.value.id == "np" else math, node.attr, None))
        return node

    def note_call(self, called: Any) -> None:
        self.is_scalar |= callable(called) and called not in LANE_FUNCTIONS

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id in self.sources.definitions:
            node.keywords = [ast.keyword(k.arg and local_name(k.arg), k.value) for k in node.keywords]
        return node

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id == NUMPY:
            return ast.Name("np", ast.Load())
        if node.id in self.local:
            return ast.Name(local_name(node.id), node.ctx)
        if node.id in self.outside:
            return self.replacement(node.id, self.outside[node.id])
        if node.id in ALLOWED_BUILTINS:
            self.is_scalar |= node.id in SCALAR_BUILTINS
            return node
        uses = f"the equation {self.function.__qualname__} uses '{node.id}'"
        if not hasattr(builtins, node.id):
            raise ArmidError(f"{uses}, which is neither an argument of it nor defined in its file: "
                             f"{nearest(node.id, self.local)}")  # fmt: skip
        raise ArmidError(f"{uses}, which cannot be compiled: numpy, math, numbers and plain functions are expected")

    def replacement(self, name: str, value: Any) -> ast.AST:
        if isinstance(value, ModuleType) and value in (np, math):
            return ast.Name("np" if value is np else "math", ast.Load())
        if isinstance(value, NUMBER_CLASSES):
            return number(value)
        called = getattr(value, "__name__", "")
        for module, name_of_module in ((np, "np"), (math, "math")):
            if called and getattr(module, called, None) is value:
                self.note_call(value)
                return ast.Attribute(ast.Name(name_of_module, ast.Load()), called, ast.Load())
        if isinstance(plain_function(value), FunctionType):
            helper = self.sources.add_helper(self.name, name, value)
            self.is_scalar |= helper in self.sources.by_lane
            return ast.Name(helper, ast.Load())
        raise ArmidError(f"the equation {self.function.__qualname__} uses '{name}' ({type(value).__name__}), which "
                         "cannot be compiled: numpy, math, numbers and plain functions are expected")  # fmt: skip
