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
        return lambda_definition(function, source)
    tree = ast.parse(source).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise ArmidError(f"the equation {label} is no plain Python function: write it as a def")
    body = [s for s in tree.body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))]
    if not any(isinstance(node, ast.Return) for statement in body for node in ast.walk(statement)):
        raise ArmidError(f"the equation {label} returns nothing: a number is expected")
    return make_definition(tree.name, tree.args, body)


def lambda_definition(function: LambdaType, source: str) -> ast.FunctionDef:
    """Return the definition of a lambda when it stands alone in its line.

    Raises ArmidError when it cannot be told from its neighbours.
    """
    wanted = list(inspect.signature(function).parameters)
    line = source.strip()
    for text in (source, line.rstrip(",)"), f"({line.rstrip(',')})", f"{{{line}}}"):
        try:
            tree = ast.parse(text)
        except SyntaxError:
            continue
        found = [n for n in ast.walk(tree) if isinstance(n, ast.Lambda) and [a.arg for a in n.args.args] == wanted]
        if len(found) == 1:
            return make_definition("<lambda>", found[0].args, [ast.Return(found[0].body)])
    raise ArmidError(f"the source of a lambda with the arguments {', '.join(wanted)} cannot be told from its "
                     "neighbours: write it as a def")  # fmt: skip


def make_definition(name: str, arguments: ast.arguments, body: list[ast.stmt]) -> ast.FunctionDef:
    """Return a definition without annotations."""
    for argument in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs):
        argument.annotation = None
    empty = ast.parse("def f(): pass").body[0]
    assert isinstance(empty, ast.FunctionDef)
    empty.name, empty.args, empty.body = name, arguments, body
    return empty
