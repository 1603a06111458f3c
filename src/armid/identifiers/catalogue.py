"""Identifiers by name, the composed ones too."""

from collections.abc import Mapping
from typing import Any

from armid.errors import ArmidError, nearest
from armid.identifiers.chain import PREFIX, chain_of, multistart_of
from armid.identifiers.evolutionary import PYMOO, Cmaes, UniformSearch
from armid.identifiers.identifier import Identifier, checked_count, checked_population
from armid.identifiers.least_squares import LeastSquares
from armid.identifiers.nlopt import NLOPT
from armid.identifiers.pso import PaperPSO


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


def swarm(budget: int, **options: Any) -> PaperPSO:
    """Return the paper's swarm with its inertia schedule stretched over the budget.

    budget: number of simulations; below 80 the swarm has that many particles. options: of PaperPSO.
    Raises ArmidError unless the budget is above 0, and for an unknown option.
    """
    budget = checked_count("the budget", budget)
    n_particles = checked_population("n_particles", options.pop("n_particles", min(80, budget)))
    return PaperPSO(**({"n_particles": n_particles, "n_iterations": -(-budget // n_particles)} | options))


_IDENTIFIERS = (
    Identifier("pso", swarm, "the paper's particle swarm (Eqs 8-9)", is_global=True),
    *(declared.identifier() for declared in (*PYMOO, Cmaes, UniformSearch, *NLOPT, LeastSquares)),
)

IDENTIFIERS: dict[str, Identifier] = {identifier.name: identifier for identifier in _IDENTIFIERS}
"""Name -> identifier, in the order in which `armid list` shows them."""
