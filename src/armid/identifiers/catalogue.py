"""Identifiers by name, the composed ones too, and what can be set of each."""

import inspect
from collections.abc import Mapping
from functools import partial
from typing import Any

from armid.errors import ArmidError, nearest
from armid.identifiers.chain import PREFIX, chain_of, multistart_of
from armid.identifiers.evolutionary import EVOLUTIONARY, PymooAlgorithm
from armid.identifiers.foreign import FOREIGN
from armid.identifiers.identifier import Identifier, checked_count, checked_population
from armid.identifiers.least_squares import LEAST_SQUARES
from armid.identifiers.nlopt import NLOPT
from armid.identifiers.pso import PaperPSO
from armid.identifiers.pymoo_adapter import built_search
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


def swarm(budget: int, **options: Any) -> PaperPSO:
    """Return the paper's swarm with its inertia schedule stretched over the budget, below 80 with as many particles."""
    budget = checked_count("the budget", budget)
    n_particles = checked_population("n_particles", options.pop("n_particles", min(80, budget)))
    return PaperPSO(**({"n_particles": n_particles, "n_iterations": -(-budget // n_particles)} | options))


_IDENTIFIERS = (
    Identifier("pso", swarm, "the paper's particle swarm (Eqs 8-9)", is_global=True),
    *EVOLUTIONARY,
    *NLOPT,
    LEAST_SQUARES,
    *FOREIGN,
)

IDENTIFIERS = Catalogue[Identifier]({identifier.name: identifier for identifier in _IDENTIFIERS})
"""Name -> identifier, in the order in which `armid list` shows them."""

RANGE = "share of the range"
# Option -> unit and meaning; one name means the same everywhere.
OPTIONS = {
    "n_particles": ("1", "particles of the swarm, at most 80 by default"),
    "n_iterations": ("1", "iterations over which the inertia falls, by default budget / n_particles"),
    "c1": ("1", "pull towards a particle's own best"),
    "c2": ("1", "pull towards the best of all"),
    "first_inertia": ("1", "inertia of the first step"),
    "last_inertia": ("1", "inertia of the last step"),
    "velocity_limit": (RANGE, "largest step of a particle; literal: the paper's, the largest magnitude in the box"),
    "first_velocity": (RANGE, "largest of the first velocities"),
    "pop_size": ("1", "individuals of the population"),
    "w": ("1", "inertia"),
    "adaptive": ("", "whether w, c1 and c2 adapt themselves"),
    "initial_velocity": ("", "random or zero"),
    "max_velocity_rate": (RANGE, "largest step of a particle"),
    "pertube_best": ("", "whether the best is disturbed at random"),
    "n_offsprings": ("1", "offspring of a generation, by default as many as individuals"),
    "eliminate_duplicates": ("", "whether equal individuals are dropped"),
    "variant": ("", "scheme, DE/rand/1/bin"),
    "CR": ("1", "chance that a parameter is crossed over"),
    "F": ("1", "weight of a difference, by default random"),
    "jitter": ("", "whether the weight is disturbed for each parameter"),
    "initial_step": (RANGE, "first step, of cmaes the first standard deviation"),
    "n_candidates": ("1", "candidates at a time, of cmaes those of the first population"),
    "growth": ("1", "factor of the population at each restart"),
    "tolerance": (RANGE, "it ends when a step changes no parameter by more (least_squares: nor the sum of squares)"),
    "differences": ("", "forward or central"),
    "step": (RANGE, "how far a perturbed candidate is"),
}


def options_of(identifier: Identifier) -> dict[str, dict[str, Any]]:
    """Return option -> default, unit, meaning, of those that an identifier declares; a default of None is its own."""
    build = identifier.build
    if build is swarm:
        defaults = defaults_in(PaperPSO) | {"n_particles": None, "n_iterations": None}
    elif isinstance(build, PymooAlgorithm):
        of_pymoo = defaults_in(build.algorithm())
        defaults = {name: of_pymoo.get(name) for name in build.options} | {"pop_size": build.pop_size}
    elif isinstance(build, partial):
        defaults = defaults_in(build.args[0]) if build.func is built_search else {}
    else:
        defaults = defaults_in(build)
    none = ("", "")
    return {name: {"default": value, "unit": OPTIONS.get(name, none)[0], "meaning": OPTIONS.get(name, none)[1]}
            for name, value in defaults.items()}  # fmt: skip


def defaults_in(function: Any) -> dict[str, Any]:
    empty = inspect.Parameter.empty
    parameters = inspect.signature(function).parameters.values()
    return {p.name: p.default for p in parameters if p.default is not empty}
