"""The definition of a plain function as a syntax tree."""

import ast
import inspect
import textwrap
from types import FunctionType, LambdaType

from armid.model.effect import Equation
from armid.model.errors import ArmidError


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
    found = [n for n in ast.walk(whole_file(function)) if isinstance(n, ast.Lambda) and holds(n, function)]
    if not found:
        arguments = ", ".join(inspect.signature(function).parameters)
        raise ArmidError(f"the source of a lambda with the arguments {arguments} cannot be found: write it as a def")
    # The innermost: a lambda may stand inside another.
    innermost = max(found, key=lambda n: (n.lineno, n.col_offset))
    return make_definition("<lambda>", innermost.args, [ast.Return(innermost.body)])


def whole_file(function: LambdaType) -> ast.Module:
    """Return the parsed file in which a function stands."""
    module = inspect.getmodule(function)
    lines = inspect.findsource(function)[0] if module is None else inspect.getsourcelines(module)[0]
    return ast.parse("".join(lines))


def holds(node: ast.Lambda, function: LambdaType) -> bool:
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
