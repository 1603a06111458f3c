"""Identifiers by name, the composed ones too."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from armid.errors import ArmidError, nearest
from armid.identifiers.adapter import Searching
from armid.identifiers.chain import PREFIX, chain_of, multistart_of
from armid.identifiers.cmaes import CmaesOptions, UniformOptions, cmaes_method, uniform_method
from armid.identifiers.identifier import Identifier, checked_count, checked_population, options_of
from armid.identifiers.least_squares import LeastSquaresOptions, least_squares_method
from armid.identifiers.nlopt import GradientOptions, LocalOptions, nlopt_method
from armid.identifiers.pso import PaperPSO
from armid.identifiers.pymoo_algorithms import differential, genetic, pymoo_swarm
from armid.identifiers.search import Method


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


def searching(name: str, kind: type, method: Callable[[Any], Method], budget: int, **options: Any) -> Searching:
    """Return a search of ours as an algorithm; kind: dataclass of its options, which refuses bad ones."""
    return Searching(method(options_of(kind, options, f"'{name}'")), budget)


def ours(name: str, kind: type, method: Callable[[Any], Method], note: str, **capabilities: bool) -> Identifier:
    """Return the identifier of a search of ours."""
    return Identifier(name, partial(searching, name, kind, method), note, **capabilities)


def of_nlopt(name: str, kind: type, note: str, **capabilities: bool) -> Identifier:
    """Return the identifier of a local search of NLopt."""
    return ours(name, kind, partial(nlopt_method, name), f"{note} (NLopt)", **capabilities)


_IDENTIFIERS = (
    Identifier("pso", swarm, "the paper's particle swarm (Eqs 8-9)", is_global=True),
    Identifier("pymoo_pso", pymoo_swarm, "adaptive particle swarm (pymoo)", is_global=True),
    Identifier("ga", genetic, "genetic algorithm (pymoo)", is_global=True),
    Identifier("de", differential, "differential evolution (pymoo)", is_global=True),
    ours("cmaes", CmaesOptions, cmaes_method, "CMA-ES, restarted with larger populations (cma)", is_global=True),
    ours("random", UniformOptions, uniform_method, "uniform random search, to compare with", is_global=True),
    of_nlopt("nelder_mead", LocalOptions, "simplex of Nelder and Mead"),
    of_nlopt("bobyqa", LocalOptions, "quadratic models, BOBYQA"),
    of_nlopt("sbplx", LocalOptions, "Nelder-Mead on subspaces, Subplex"),
    of_nlopt("cobyla", LocalOptions, "linear models, COBYLA"),
    of_nlopt("lbfgs", GradientOptions, "quasi-Newton steps, L-BFGS", uses_gradient=True),
    of_nlopt("slsqp", GradientOptions, "sequential quadratic programmes, SLSQP", uses_gradient=True),
    ours("least_squares", LeastSquaresOptions, least_squares_method, "trust region on the residual vector (scipy)",
         uses_gradient=True, needs_residuals=True),
)  # fmt: skip

IDENTIFIERS: dict[str, Identifier] = {identifier.name: identifier for identifier in _IDENTIFIERS}
