"""Keys of the candidates: one for each form of an effect, and a mark on those whose fixed shape was set free."""

from collections.abc import Iterable, Mapping
from typing import TypeVar

from armid.model import Effect

T = TypeVar("T")
LOOSE = "+"
# What the names of empirical terms begin with: no effect of a library may claim it.
UNNAMED, SHOWN_AS = "unnamed_", "unnamed:"


def base(key: str) -> str:
    """Return a key without the mark."""
    return key.removesuffix(LOOSE)


def loose(active: Iterable[str], name: str) -> tuple[str, ...]:
    """Return keys with the mark on one of them.

    >>> loose(("coulomb", "tilt"), "coulomb")
    ('coulomb+', 'tilt')
    """
    return tuple(key + LOOSE if key == name else key for key in active)


def is_empirical(name: str) -> bool:
    """Tell whether a name stands for an empirical term, which claims no physical effect."""
    return name.startswith(UNNAMED)


def shown_name(name: str) -> str:
    """Return the name of an effect as reports show it: `unnamed:torque` for an empirical term at that port.

    >>> shown_name("unnamed_torque_by_theta"), shown_name("coulomb")
    ('unnamed:torque', 'coulomb')
    """
    return f"{SHOWN_AS}{name.removeprefix(UNNAMED).split('_by_')[0]}" if is_empirical(name) else name


def own_name(effect: str, parameter: str) -> str:
    """Return the qualified name of an effect's parameter."""
    return f"{effect}.{parameter}"


def forms_of(effect: Effect) -> dict[str, Effect]:
    """Return key -> form: the effect's name for its first form, name and word for the others."""
    return {effect.name if e is effect else f"{effect.name}_{e.form}": e for e in effect.every_form}


def renamed(given: Mapping[str, T], originals: Mapping[str, Effect]) -> dict[str, T]:
    """Return what is told of parameters, repeated for the keys of every form that has a parameter of that name."""
    found = dict(given)
    for key, effect in originals.items():
        names = {own_name(effect.name, p.name): own_name(key, p.name) for p in effect.parameters}
        found |= {names[n]: value for n, value in given.items() if n in names}
    return found
