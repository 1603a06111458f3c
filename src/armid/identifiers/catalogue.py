"""Identifiers by name, the composed ones too, and what can be set of each."""

from collections.abc import Mapping
from inspect import signature
from typing import Any

from armid.errors import ArmidError, nearest
from armid.identifiers.chain import PREFIX, chain_of, multistart_of
from armid.identifiers.evolutionary import EVOLUTIONARY
from armid.identifiers.foreign import FOREIGN
from armid.identifiers.identifier import Identifier, options_in
from armid.identifiers.local import LEAST_SQUARES, NLOPT
from armid.identifiers.pso import PSO
from armid.model import Catalogue


def identifier_of(name: str, known: Mapping[str, Identifier]) -> Identifier:
    """Return the identifier of a name, of `multistart:LOCAL`, or of a chain `GLOBAL+LOCAL[+LOCAL]`.

    Parameters
    ----------
    name : str
        The name, composed or not.
    known : Mapping
        Name -> identifier, those that may stand in a name; a user's own among them.

    Returns
    -------
    Identifier

    Raises
    ------
    ArmidError
        With the nearest name for one that is not known, and for a composition that makes no sense.
    """
    if name in known:
        return known[name]
    parts = name.split("+")
    if len(parts) > 1:
        return chain_of([identifier_of(part, known) for part in parts])
    if name.startswith(PREFIX):
        local = name.removeprefix(PREFIX)
        if local.startswith(PREFIX):
            raise ArmidError(f"identifier '{local}' is global, {PREFIX} expects a local one")
        return multistart_of(identifier_of(local, known))
    raise ArmidError(f"identifier '{name}' is not known: {nearest(name, known)}")


_IDENTIFIERS = (
    PSO,
    *EVOLUTIONARY,
    *NLOPT,
    LEAST_SQUARES,
    *FOREIGN,
)

IDENTIFIERS = Catalogue[Identifier]({identifier.name: identifier for identifier in _IDENTIFIERS})
"""Name -> identifier, in the order in which `armid list` shows them."""


def options_of(identifier: Identifier) -> dict[str, dict[str, Any]]:
    """Return option -> default, unit, meaning, of those that an identifier declares; a default of None is its own."""
    if identifier.algorithm is None:
        return {name: {"default": p.default, "unit": "", "meaning": ""}
                for name, p in signature(identifier.build).parameters.items() if p.default is not p.empty}  # fmt: skip
    declared = ((option.name, option.default, option.metadata["option"]) for option in options_in(identifier.algorithm))
    return {name: {"default": default, "unit": o.unit, "meaning": o.meaning} for name, default, o in declared}
