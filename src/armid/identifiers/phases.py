"""Options of identifiers that are made of others."""

from collections.abc import Mapping, Sequence
from typing import Any

from armid.identifiers.identifier import Identifier
from armid.model.errors import ArmidError, nearest


def of_phases(
    options: Mapping[str, Any], phases: Sequence[Identifier], own: Sequence[str], whose: str
) -> tuple[Identifier, ...]:
    """Return the phases with their options: NAME.OPTION belongs to each phase of that name.

    own: options of the whole, which are passed over; whose: how a message names the whole.
    Raises ArmidError for an option of no phase; what a phase does not know it refuses itself when it is built.
    """
    named: dict[str, dict[str, Any]] = {simple_name(phase): {} for phase in phases}
    for key, value in options.items():
        name, dot, option = key.partition(".")
        if dot and name in named:
            named[name][option] = value
        elif key not in own:
            known = [*own, *(f"{phase}.{option or key}" for phase in named)]
            raise ArmidError(f"{whose} has no option '{key}', {nearest(key, known)}")
    return tuple(phase.with_options(told(phase, named[simple_name(phase)])) for phase in phases)


def simple_name(phase: Identifier) -> str:
    """Return the name by which options call a phase: that of the local one for a multistart."""
    return phase.name.rpartition(":")[2]


def told(phase: Identifier, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options as the phase itself wants them: a multistart passes them on by name."""
    prefix = f"{simple_name(phase)}." if phase.name != simple_name(phase) else ""
    return {f"{prefix}{option}": value for option, value in options.items()}
