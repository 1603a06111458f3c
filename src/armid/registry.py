"""What there is to choose from: the catalogues, installed entry points, and files that the user names."""

import importlib.util
import inspect
import linecache
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from traceback import walk_tb
from typing import Any

from armid.errors import ArmidError, nearest
from armid.model import EFFECTS, PLANTS, Effect, Plant
from armid.model.effects.sensor import sensor_effects

PLUGIN_PREFIX = "armid_plugin_"
# What a plug-in's file held when it was run stands under this name in its module.
CONTENT = "__armid_content__"


def is_fitness(thing: Any) -> bool:
    """Tell whether an object is a Fitness or a function of (measured, simulated)."""
    if hasattr(thing, "function") and hasattr(thing, "join"):
        return True
    return inspect.isfunction(thing) and {"measured", "simulated"} <= set(inspect.signature(thing).parameters)


# Kind -> what belongs to it; an object is of the first kind that takes it.
ACCEPTS: dict[str, Callable[[Any], bool]] = {
    "plants": lambda thing: isinstance(thing, Plant),
    "effects": lambda thing: isinstance(thing, Effect),
    "fitness": is_fitness,
    "analyses": lambda thing: inspect.isfunction(thing) and "runs" in inspect.signature(thing).parameters,
    "identifiers": lambda thing: (
        hasattr(thing, "build")
        or inspect.isclass(thing)
        or inspect.isfunction(thing)
        or {"ask", "tell", "setup"} <= set(dir(thing))
    ),
}
KINDS = tuple(ACCEPTS)


@dataclass
class Registry:
    """Hold what a command may name; `fitness` and `identifiers` are read from their catalogues when first asked for.

    own: kind -> name -> what the user has registered in addition to a catalogue, as it was given.
    """

    plants: dict[str, Plant] = field(default_factory=lambda: dict(PLANTS))
    effects: dict[str, Effect] = field(default_factory=lambda: dict(EFFECTS))
    own: dict[str, dict[str, Any]] = field(default_factory=lambda: {kind: {} for kind in KINDS})

    @property
    def fitness(self) -> dict[str, Any]:
        """Name -> Fitness."""
        from armid.problem.fitness import FITNESS, as_fitness

        return FITNESS | {name: as_fitness(name, own) for name, own in self.own["fitness"].items()}

    @property
    def identifiers(self) -> dict[str, Any]:
        """Name -> Identifier."""
        from armid.identifiers import IDENTIFIERS, as_identifier

        return IDENTIFIERS | {name: as_identifier(name, own) for name, own in self.own["identifiers"].items()}

    @property
    def analyses(self) -> dict[str, Any]:
        """Name -> function of the runs of a study, of users alone: ours stand in armid.study.analyses."""
        return self.own["analyses"]

    def effects_for(self, plant: Plant) -> dict[str, Effect]:
        """Return name -> Effect: those that are registered, and those of the sensors of a plant."""
        return {**sensor_effects(plant), **self.effects}

    def identifier_of(self, name: str) -> Any:
        """Return the Identifier of a name, a chain such as `pso+bobyqa` or `multistart:bobyqa`; errors in words."""
        from armid.identifiers import identifier_of

        return identifier_of(name, self.identifiers)

    def add(self, kind: str, name: str, thing: Any) -> None:
        """Register a user's own.

        Raises ArmidError when the name is taken: a user's own must not stand silently in for ours.
        """
        if name in getattr(self, kind):
            raise ArmidError(f"{kind}: '{name}' is there already, give yours another name")
        self.own[kind][name] = thing
        if kind in ("plants", "effects"):
            getattr(self, kind)[name] = thing


def load_registry(plugins: Iterable[str] = ()) -> Registry:
    """Return the catalogues, the entry points of installed packages, and what `FILE.py:attribute` names.

    Parameters
    ----------
    plugins : FILE.py:attribute
        Things of the user, whose code is run.

    Returns
    -------
    Registry

    Raises
    ------
    ArmidError
        For a plug-in that cannot be found, fails, belongs to another kind or to no kind of armid.
    """
    registry = Registry()
    installed = entry_points()
    for kind in KINDS:
        for point in installed.select(group=f"armid.{kind}"):
            where = f"entry point '{point.name}' ({point.value}) of armid.{kind}"
            try:
                thing = point.load()
            except (Exception, SystemExit) as error:
                raise ArmidError(f"{where} cannot be loaded: {type(error).__name__}: {error}") from error
            actual = kind_of(thing, where)
            if actual != kind:
                raise ArmidError(f"{where} belongs to {actual}: armid.{actual} is expected")
            registry.add(kind, name_of(thing, point.name), thing)
    for plugin in plugins:
        registry.add(*load_plugin(plugin))
    return registry


def load_plugin(plugin: str) -> tuple[str, str, Any]:
    """Return kind, name and object of `FILE.py:attribute`. This runs the file's code."""
    path, _, attribute = plugin.rpartition(":")
    if not path or not attribute:
        raise ArmidError(f"plug-in '{plugin}' is not of the form FILE.py:attribute")
    file = Path(path)
    if not file.is_file():
        raise ArmidError(f"plug-in '{plugin}': there is no file {file}")
    module = load_file(file)
    if not hasattr(module, attribute):
        names = [n for n, own in vars(module).items() if any(accepts(own) for accepts in ACCEPTS.values())]
        raise ArmidError(f"plug-in '{plugin}': {file.name} has no '{attribute}', {nearest(attribute, names)}")
    thing = getattr(module, attribute)
    return kind_of(thing, f"plug-in '{plugin}'"), name_of(thing, attribute), thing


def load_file(file: Path) -> Any:
    """Run a Python file as a module of its own name; its folder is searched for what it imports.

    It is run once, and again when it has changed: equations are read from the file, and must be those that were run.
    """
    name, content = f"{PLUGIN_PREFIX}{file.stem}", file.read_bytes()
    known = sys.modules.get(name)
    if known is not None and Path(str(known.__file__)) == file.resolve() and vars(known).get(CONTENT) == content:
        return known
    linecache.checkcache(str(file.resolve()))
    spec = importlib.util.spec_from_file_location(name, file.resolve())
    if spec is None or spec.loader is None:
        raise ArmidError(f"plug-in {file} is not a Python file: FILE.py:attribute is expected")
    module = importlib.util.module_from_spec(spec)
    setattr(module, CONTENT, content)
    sys.modules[name] = module
    folder = str(file.resolve().parent)
    if folder not in sys.path:
        sys.path.append(folder)
    importlib.invalidate_caches()  # a file that was written a moment ago is seen
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        where = f"plug-in {place_in_plugin(error) or file}"
        if isinstance(error, ArmidError):
            raise type(error)(f"{where}: {error}") from error
        raise ArmidError(f"{where}: it fails when it is read: {type(error).__name__}: {error}") from error
    return module


def name_of(thing: Any, found_under: str) -> str:
    """Return the name that an object declares, else (a function, a class) the one that it was found under."""
    name = None if inspect.isclass(thing) else getattr(thing, "name", None)
    return name if isinstance(name, str) else found_under


def kind_of(thing: Any, where: str) -> str:
    for kind, accepts in ACCEPTS.items():
        if accepts(thing):
            return kind
    raise ArmidError(f"{where} is of type {type(thing).__name__}: a Plant, an Effect, a fitness function (measured, "
                     "simulated), an analysis (runs) or an algorithm of pymoo is expected")  # fmt: skip


def place_in_plugin(error: BaseException) -> str | None:
    """Return file and line of the user's plug-in in which an error arose, None when no plug-in was running."""
    frames = [(f, line) for f, line in walk_tb(error.__traceback__)
              if str(f.f_globals.get("__name__")).startswith(PLUGIN_PREFIX)]  # fmt: skip
    return f"{frames[-1][0].f_code.co_filename}, line {frames[-1][1]}" if frames else None
