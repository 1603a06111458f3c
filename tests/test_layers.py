"""Layers are one-way, files import each other in no circle, and packages only re-export."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "src" / "armid"
# A folder or file may import only what stands before it.
LAYERS = [
    "errors", "units", "report", "model", "engine", "record", "problem", "identifiers", "estimation", "registry",
    "contract", "loop", "study", "cli", "__main__",
]  # fmt: skip
FILES = sorted(ROOT.rglob("*.py"))


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def layer_of(module: str) -> str | None:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else None


def imported(path: Path) -> set[str]:
    """Modules of armid that a file imports, wherever in the file; names of submodules are followed."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: a relative import"
            submodules = {f"{node.module}.{a.name}" for a in node.names} & MODULES
            found |= submodules or {node.module}
    return {m for m in found if m == "armid" or m.startswith("armid.")}


MODULES = {module_of(p) for p in FILES}


def test_every_layer_is_known():
    there = {layer_of(module_of(p)) for p in FILES} - {None}
    assert there <= set(LAYERS)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_one_way(path):
    own = layer_of(module_of(path))
    if own is None:
        return
    for module in imported(path):
        other = layer_of(module)
        assert other is not None, f"{path} imports the whole package"
        assert LAYERS.index(other) <= LAYERS.index(own), f"{own} may not import {module}"


def test_no_circle_of_files():
    graph = {module_of(p): imported(p) - {module_of(p)} for p in FILES}
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, f"circle: {' -> '.join((*path, module))}"
        if module not in done:
            for other in sorted(graph.get(module, ())):
                visit(other, (*path, module))
            done.add(module)

    for module in graph:
        visit(module, ())


@pytest.mark.parametrize("path", [p for p in FILES if p.name == "__init__.py" and p.parent != ROOT],
                         ids=lambda p: str(p.parent.relative_to(ROOT)))  # fmt: skip
def test_packages_only_re_export(path):
    for node in ast.parse(path.read_text()).body:
        docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        names = isinstance(node, ast.Assign) and [t.id for t in node.targets] == ["__all__"]
        assert docstring or names or isinstance(node, ast.ImportFrom), f"{path}: {ast.unparse(node)[:60]}"


@pytest.mark.parametrize("path", [p for p in FILES if layer_of(module_of(p)) == "model"],
                         ids=lambda p: str(p.relative_to(ROOT)))  # fmt: skip
def test_model_knows_no_numba_and_no_files(path):
    tree = ast.parse(path.read_text())
    modules = {a.name.split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    modules |= {n.module.split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module}
    assert not modules & {"numba", "llvmlite", "pathlib", "os", "io", "pandas", "tomllib"}
    assert not any(isinstance(n, ast.Call) and getattr(n.func, "id", "") == "open" for n in ast.walk(tree))


def test_test_stand_shares_no_code_with_the_package():
    studies = ROOT.parents[1] / "studies"
    ours = {*(studies / "bench").rglob("*.py"), studies / "your_own_machine" / "plant.py"}
    for path in {*studies.rglob("*.py")} - ours:
        assert not imported(path), f"{path} imports the package"
