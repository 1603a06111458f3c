"""pymoo's own swarm, genetic algorithm and differential evolution, their options checked and safe from NaN."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any

from pymoo.core.algorithm import Algorithm

from armid.errors import ArmidError
from armid.identifiers.identifier import (
    Identifier,
    checked,
    checked_choice,
    checked_count,
    checked_flag,
    checked_population,
    checked_share,
    refuse_unknown,
)
from armid.identifiers.search import SwarmEvaluator

Check = Callable[[str, Any], Any]
VARIANT = re.compile(r"DE/(rand|best|target-to-best)/[12]/(bin|exp|hypercube|line)")


def checked_variant(name: str, value: Any) -> str:
    """Return a scheme of differential evolution; refuse with ArmidError what is none."""
    if not isinstance(value, str) or not VARIANT.fullmatch(value):
        raise ArmidError(f"{name} is {value!r}, expected DE/rand|best|target-to-best/1|2/bin|exp|hypercube|line")
    return value


@dataclass(frozen=True, eq=False)
class PymooAlgorithm:
    """Declare an algorithm of pymoo: where it stands, how many individuals it has, and the options that it may get.

    options: option, as pymoo calls it -> check of its value; pymoo would swallow any other.
    """

    name: str
    note: str
    place: str
    pop_size: int
    options: Mapping[str, Check]

    def __call__(self, budget: int, **options: Any) -> Algorithm:
        """Return the algorithm; refuse with ArmidError options that pymoo would swallow, and bad values."""
        checked_count("the budget", budget)
        refuse_unknown(options, self.options, f"'{self.name}'")
        given = {"pop_size": self.pop_size} | options
        checked_values = {option: self.options[option](option, value) for option, value in given.items()}
        module, kind = self.place.split(":")
        algorithm = getattr(import_module(f"pymoo.algorithms.soo.nonconvex.{module}"), kind)
        return algorithm(evaluator=SwarmEvaluator(finite=True), **checked_values)

    def identifier(self) -> Identifier:
        return Identifier(self.name, self, self.note, is_global=True)


PYMOO = (
    PymooAlgorithm("pymoo_pso", "adaptive particle swarm (pymoo)", "pso:PSO", 40, {
        "pop_size": checked_population, "w": checked, "c1": checked, "c2": checked, "adaptive": checked_flag,
        "initial_velocity": partial(checked_choice, known=("random", "zero")), "max_velocity_rate": checked_share,
        "pertube_best": checked_flag,
    }),
    PymooAlgorithm("ga", "genetic algorithm (pymoo)", "ga:GA", 80, {
        "pop_size": checked_population, "n_offsprings": checked_population, "eliminate_duplicates": checked_flag,
    }),
    PymooAlgorithm("de", "differential evolution (pymoo)", "de:DE", 40, {
        "pop_size": checked_population, "n_offsprings": checked_population, "variant": checked_variant,
        "CR": checked_share, "F": partial(checked, least=1e-6, expected="a number above 0"), "jitter": checked_flag,
    }),
)  # fmt: skip
