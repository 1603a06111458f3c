"""Every public name can be imported and says what it is."""

import ast
import importlib
import inspect
import pkgutil
import re
from collections import defaultdict
from pathlib import Path

import click

import armid

MODULES = sorted(m.name for m in pkgutil.walk_packages(armid.__path__, "armid.") if m.name != "armid.__main__")


def test_the_package_lists_its_names():
    for name, home in armid.HOME.items():
        assert getattr(armid, name) is getattr(importlib.import_module(home), name)
    assert dir(armid) == sorted(armid.HOME)
    assert not hasattr(armid, "nothing_of_the_sort")


def test_all_is_true():
    for there in map(importlib.import_module, MODULES):
        names = getattr(there, "__all__", [])
        assert len(set(names)) == len(names), there
        assert [name for name in names if getattr(there, name, None) is None] == [], there


def methods(thing):
    for name, method in vars(thing).items() if inspect.isclass(thing) else ():
        function = method.fget if isinstance(method, property) else method
        if inspect.isfunction(function) and not name.startswith("_"):
            yield f"{thing.__name__}.{name}", function


def test_files_exported_names_and_commands_have_a_docstring():
    assert [name for name in MODULES if not (importlib.import_module(name).__doc__ or "").strip()] == []
    exported = {name: getattr(armid, name) for name in armid.HOME}
    for module in map(importlib.import_module, MODULES):
        exported |= {f"{module.__name__}.{name}": getattr(module, name) for name in getattr(module, "__all__", [])}
        exported |= {
            name: c.callback for name, c in vars(module).items() if isinstance(c, click.Command) and c.callback
        }
    things = {name: thing for name, thing in exported.items() if inspect.isfunction(thing) or inspect.isclass(thing)}
    for name in armid.HOME:
        things |= dict(methods(exported[name]))
    assert [name for name, thing in things.items() if not (thing.__doc__ or "").strip()] == []


def test_exported_functions_tell_every_parameter_and_what_they_return():
    for name in armid.HOME:
        function = getattr(armid, name)
        if inspect.isfunction(function):
            doc = inspect.getdoc(function)
            assert "\nReturns\n-------\n" in doc, name
            section = doc.partition("\nParameters\n----------\n")[2].partition("\n\n")[0]
            told = {word.strip(" *") for line in re.findall(r"^[^\s:].*", section, re.MULTILINE)
                    for word in line.partition(" :")[0].split(",")}  # fmt: skip
            assert told == set(inspect.signature(function).parameters), name


# What each file of a kind brings under the same name: effects, a statistic, the figures of a page.
SLOTS = {"EFFECTS", "COLUMNS", "FIGURES", "FIGURE_CAPTION", "TABLE_CAPTION"}


def constants_of(file):
    for node in ast.parse(file.read_text()).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        for target in targets:
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            yield from (n.id for n in names if isinstance(n, ast.Name) and n.id.isupper() and len(n.id) > 1)


def test_a_constant_is_defined_in_one_file():
    root = Path(armid.__file__).parent
    homes = defaultdict(set)
    for file in root.rglob("*.py"):
        for name in constants_of(file):
            homes[name].add(str(file.relative_to(root)))
    assert {name: files for name, files in homes.items() if len(files) > 1 and name not in SLOTS} == {}
    assert all(len(homes[name]) > 1 for name in SLOTS)
