"""What a study may name: the registry, with the text of the user's own."""

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from armid.fitness import Fitness
from armid.identifiers import Identifier, identifier_of
from armid.model import ArmidError, Effect, Plant
from armid.record.schema import unknown_name
from armid.registry import Registry, load_plugin, load_registry


@dataclass(frozen=True, eq=False)
class Known:
    """Hold the registered things by name.

    plugins: `FILE.py:attribute` of the user's own. digests: (kind, name) -> hash of the file that it was read from, so
    that what an older text of it gave is not taken for what the present one gives.
    """

    registry: Registry
    plugins: tuple[str, ...]
    digests: Mapping[tuple[str, str], str]

    @cached_property
    def plants(self) -> dict[str, Plant]:
        """Name -> Plant."""
        return self.registry.plants

    @cached_property
    def effects(self) -> dict[str, Effect]:
        """Name -> Effect."""
        return self.registry.effects

    @cached_property
    def fitness(self) -> dict[str, Fitness]:
        """Name -> Fitness."""
        return self.registry.fitness

    @cached_property
    def identifiers(self) -> dict[str, Identifier]:
        """Name -> Identifier, those composed of others left out."""
        return self.registry.identifiers

    def identifier(self, name: str, where: str) -> Identifier:
        """Return an identifier, also a chain or a multistart.

        Raises ArmidError with the nearest name for an unknown one.
        """
        try:
            return identifier_of(name, self.identifiers)
        except ArmidError as error:
            raise ArmidError(f"{where}: {error}") from error

    def own(self, kind: str, *names: str) -> dict[str, str]:
        """Return `kind name` -> hash for those of the names that are the user's own; chains are looked into."""
        parts = [part for name in names for part in re.split(r"[+:]", name)]
        return {f"{kind} {part}": self.digests[kind, part] for part in parts if (kind, part) in self.digests}


def load_known(plugins: Iterable[str] = ()) -> Known:
    """Return what may be named: catalogues, entry points, and the user's own. This runs the code of the plug-ins.

    Raises ArmidError for a plug-in that cannot be used.
    """
    named = tuple(plugins)
    registry = load_registry(named)
    digests = {}
    for plugin in named:
        kind, name, _ = load_plugin(plugin)
        with open(plugin.rpartition(":")[0], "rb") as file:
            digests[kind, name] = hashlib.sha256(file.read()).hexdigest()
    return Known(registry, named, digests)


def chosen(known: Mapping[str, Any], name: str, what: str, where: str) -> Any:
    """Return what is registered under a name.

    Raises ArmidError with the nearest name for an unknown one.
    """
    if name not in known:
        raise unknown_name(what, name, known, where)
    return known[name]
