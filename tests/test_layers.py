"""Layers are one-way, files import each other in no circle, packages only re-export; public names say what they are."""

import ast
import importlib
import inspect
import pkgutil
import re
from collections import defaultdict
from pathlib import Path

import click

import armid
from commands import python

ROOT = Path(__file__).parents[1] / "src" / "armid"
# A folder or file may import only what stands before it.
LAYERS = [
    "errors", "units", "progress", "report", "model", "engine", "record", "problem", "identifiers", "estimation",
    "registry", "contract", "inference", "loop", "study", "api", "cli", "__main__",
]  # fmt: skip
TREES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(ROOT.rglob("*.py"))}


def module_of(path):
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def layer_of(module):
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else None


MODULES = {module_of(path) for path in TREES}


def imported(path, tree):
    """Modules of armid that a file imports, wherever in the file; names of submodules are followed."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: a relative import"
            submodules = {f"{node.module}.{a.name}" for a in node.names} & MODULES
            found |= submodules or {node.module}
    return {m for m in found if m == "armid" or m.startswith("armid.")}


GRAPH = {module_of(path): imported(path, tree) - {module_of(path)} for path, tree in TREES.items()}


def test_imports_go_one_way():
    assert len(TREES) > 50
    assert {layer_of(module) for module in MODULES} - {None} <= set(LAYERS)
    for module, others in GRAPH.items():
        own = layer_of(module)
        for other in others if own else ():
            assert layer_of(other) is not None, f"{module} imports the whole package"
            assert LAYERS.index(layer_of(other)) <= LAYERS.index(own), f"{module} may not import {other}"


def test_no_circle_of_files():
    done = set()

    def visit(module, path):
        assert module not in path, f"circle: {' -> '.join((*path, module))}"
        if module not in done:
            for other in sorted(GRAPH.get(module, ())):
                visit(other, (*path, module))
            done.add(module)

    for module in GRAPH:
        visit(module, ())


def test_packages_only_re_export_and_the_model_knows_no_numba_and_no_files():
    for path, tree in TREES.items():
        for node in tree.body if path.name == "__init__.py" and path.parent != ROOT else ():
            docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            names = isinstance(node, ast.Assign) and [t.id for t in node.targets] == ["__all__"]
            assert docstring or names or isinstance(node, ast.ImportFrom), f"{path}: {ast.unparse(node)[:60]}"
    for path, tree in TREES.items():
        nodes = [*ast.walk(tree)] if layer_of(module_of(path)) == "model" else []
        modules = {a.name.split(".")[0] for n in nodes if isinstance(n, ast.Import) for a in n.names}
        modules |= {n.module.split(".")[0] for n in nodes if isinstance(n, ast.ImportFrom) and n.module}
        assert not modules & {"numba", "llvmlite", "pathlib", "os", "io", "pandas", "tomllib"}, path
        assert not any(isinstance(n, ast.Call) and getattr(n.func, "id", "") == "open" for n in nodes), path


LIGHT = """
import sys
import armid
from armid.cli.main import main

try:
    main(["--help"])
except SystemExit:
    print([name for name in ("numba", "pymoo", "pandas", "matplotlib") if name in sys.modules])
import armid.problem.fitness
print([name for name in ("pymoo", "pandas", "matplotlib", "seaborn") if name in sys.modules])
"""


def test_importing_is_light():
    done = python("-c", LIGHT)
    assert done.stdout.splitlines()[-2:] == ["[]", "[]"]


def test_test_stand_shares_no_code_with_the_package():
    studies = ROOT.parents[1] / "studies"
    ours = {path for name in ("bench", "guide", "measured") for path in (studies / name).rglob("*.py")}
    ours |= {studies / "your_own_machine" / "plant.py", studies / "suite" / "landscape.py"}
    ours |= {
        studies / "machines" / "plants.py",
        *(studies / "calibration" / f"{n}.py" for n in ("run", "fit", "former", "nested")),
    }
    ours.add(studies / "interval_coverage.py")
    for path in {*studies.rglob("*.py")} - ours:
        assert not imported(path, ast.parse(path.read_text(encoding="utf-8"))), f"{path} imports the package"


NAMES = sorted(m.name for m in pkgutil.walk_packages(armid.__path__, "armid.") if m.name != "armid.__main__")


def test_the_package_lists_its_names_and_all_is_true():
    for name, home in armid.HOME.items():
        assert getattr(armid, name) is getattr(importlib.import_module(home), name)
    assert dir(armid) == sorted(armid.HOME)
    assert not hasattr(armid, "nothing_of_the_sort")
    for there in map(importlib.import_module, NAMES):
        names = getattr(there, "__all__", [])
        assert len(set(names)) == len(names), there
        assert [name for name in names if getattr(there, name, None) is None] == [], there


def methods(thing):
    for name, method in vars(thing).items() if inspect.isclass(thing) else ():
        function = method.fget if isinstance(method, property) else method
        if inspect.isfunction(function) and not name.startswith("_"):
            yield f"{thing.__name__}.{name}", function


def test_files_exported_names_and_commands_have_a_docstring():
    assert [name for name in NAMES if not (importlib.import_module(name).__doc__ or "").strip()] == []
    exported = {name: getattr(armid, name) for name in armid.HOME}
    for module in map(importlib.import_module, NAMES):
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
SLOTS = {"EFFECTS", "FIGURES", "FIGURE_CAPTION"}


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


def test_two_classes_never_share_a_name():
    places = defaultdict(list)
    for path, tree in TREES.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                places[node.name].append(path.name)
    assert {name: files for name, files in places.items() if len(files) > 1} == {}
