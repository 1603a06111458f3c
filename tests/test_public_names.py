"""Every public name can be imported and says what it is."""

import importlib
import inspect
import pkgutil

import click

import armid

MODULES = sorted(m.name for m in pkgutil.walk_packages(armid.__path__, "armid.") if m.name != "armid.__main__")
# equations of one line that are named after what they give, and overloads whose operator is their name
SPELT_OUT = ("armid.model.plants.", "armid.engine.simd")


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


def members(module):
    """Yield public functions and classes that a module defines, and the public methods of those classes."""
    for name, found in vars(module).items():
        thing = found.callback if isinstance(found, click.Command) else found
        if name.startswith("_") or getattr(thing, "__module__", None) != module.__name__:
            continue
        if inspect.isfunction(thing) or inspect.isclass(thing):
            yield name, thing
        for own, method in vars(thing).items() if inspect.isclass(thing) else ():
            function = method.fget if isinstance(method, property) else method
            # a method of a syntax tree's visitor says what it does by its name
            if inspect.isfunction(function) and not own.startswith(("_", "visit_")):
                yield f"{name}.{own}", function


def test_everything_public_has_a_docstring():
    for module in MODULES:
        there = importlib.import_module(module)
        assert there.__doc__ or not list(members(there)), module
        if not module.startswith(SPELT_OUT):
            assert [name for name, thing in members(there) if not (thing.__doc__ or "").strip()] == [], module
