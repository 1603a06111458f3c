"""Identifiers by name, the composed ones too."""

from collections.abc import Mapping

from armid.identifiers.chain import chain_of
from armid.identifiers.identifier import Identifier
from armid.identifiers.multistart import PREFIX, multistart_of
from armid.model.errors import ArmidError, nearest


def identifier_of(name: str, known: Mapping[str, Identifier]) -> Identifier:
    """Return the identifier of a name, of `multistart:LOCAL`, or of a chain `GLOBAL+LOCAL[+LOCAL]`.

    known: name -> identifier, those that may stand in a name; a user's own among them.
    Raises ArmidError with the nearest name for one that is not known, and for a composition that makes no sense.
    """
    if name in known:
        return known[name]
    parts = name.split("+")
    if len(parts) > 1:
        return chain_of([identifier_of(part, known) for part in parts])
    if name.startswith(PREFIX):
        return multistart_of(identifier_of(name.removeprefix(PREFIX), known))
    raise ArmidError(f"identifier '{name}' is not known: {nearest(name, known)}")
