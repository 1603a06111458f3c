"""A starting file out of its template, under a name that can be used."""

import ast
import re
import sys
import sysconfig
from collections.abc import Collection
from importlib.resources import files
from importlib.util import find_spec
from string import Template

from armid.model import ArmidError
from armid.model.effect import RESERVED
from armid.model.parameter import check_name

CAMPAIGN = "campaign"
KINDS = ("effect", "fitness", "identifier", "plant", CAMPAIGN)
FOLDER_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")


def template(file: str) -> Template:
    """Return the text of a file of templates; `$name` in it stands for the user's name."""
    return Template((files("armid.new") / "templates" / file).read_text(encoding="utf-8"))


def python_file(kind: str, name: str) -> str:
    """Return the text of a Python file that declares one thing of a user.

    kind: "effect", "fitness", "identifier" or "plant". name: of the thing, and of the file without its ending.
    """
    return template(f"{kind}.py.txt").substitute(name=name)


def check_new_name(kind: str, name: str, taken: Collection[str] = ()) -> None:
    """Refuse a name that a starting file could not have.

    taken: names of the same kind that are registered.

    Raises ArmidError for a name that is no Python name (for a campaign: no plain name of a folder), is registered, is
    used in the file itself, or is that of a module, which the file would hide.
    """
    if kind == CAMPAIGN:
        if not FOLDER_NAME.fullmatch(name) or name.endswith("."):
            raise ArmidError(f"campaign '{name}' is no usable name: letters, digits, '_', '-' and '.' are expected")
        return
    check_name(name, kind)
    if name in taken or (kind == "effect" and name in RESERVED):
        raise ArmidError(f"{kind} '{name}' is there already: another name is expected")
    if name in names_in(python_file(kind, "_")):
        raise ArmidError(f"{kind} '{name}' cannot have this name, which the file itself uses: another is expected")
    if is_module(name):
        raise ArmidError(f"{kind} '{name}' cannot have this name: {name}.py would hide the module '{name}'")


def names_in(text: str) -> set[str]:
    """Return every name that a Python file uses or binds."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Name):
            found.add(node.id)
        elif isinstance(node, ast.FunctionDef | ast.alias):
            found.add(getattr(node, "asname", None) or node.name)
        elif isinstance(node, ast.arg):
            found.add(node.arg)
    return found


def is_module(name: str) -> bool:
    """Tell whether Python or a package that is installed has a module of the name."""
    found = find_spec(name)
    if name == __package__.partition(".")[0] or name in sys.stdlib_module_names:
        return True
    return found is not None and str(found.origin).startswith(tuple(sysconfig.get_paths().values()))
