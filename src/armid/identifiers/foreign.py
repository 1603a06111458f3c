"""Identifiers of other libraries, each a function that searches by itself, see `armid.identifiers.own`."""

import random as python_random
import threading
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

from armid.errors import ArmidError
from armid.identifiers.identifier import Identifier, checked_count, checked_share
from armid.identifiers.own import Value, as_identifier
from armid.identifiers.pymoo_adapter import SEEDS, SearchAlgorithm
from armid.model import Array


def lshade(
    value: Value, low: Array, high: Array, budget: int, random: np.random.Generator, *,
    per_parameter: float = 18.0, memory: int = 6,
) -> None:  # fmt: skip
    """Differential evolution with success history and a population that shrinks linearly.

    per_parameter: candidates of the first population a parameter, at most a tenth of the budget. memory: length of the
    history. Source: Tanabe and Fukunaga 2014, doi:10.1109/CEC.2014.6900380.
    """
    from minionpy import LSHADE

    checked_share("per_parameter", per_parameter, 1e4)
    n_candidates = max(4, min(round(per_parameter * low.size), budget // 10))
    options = {"population_size": n_candidates, "memory_size": checked_count("memory", memory, 1000), "x_tol": 0.0}
    box = list(zip(low.tolist(), high.tolist(), strict=True))
    LSHADE(value, box, None, budget, None, int(random.integers(1, SEEDS)), options).optimize()


def ngopt(value: Value, low: Array, high: Array, budget: int, random: np.random.Generator) -> None:
    """Choose among nevergrad's methods by dimension and budget: its wizard NGOpt10.

    Its newest one lets cma draw its seed from the clock, so that no run could be repeated.
    Source: Meunier et al. 2022, arXiv:2010.04542.
    """
    import nevergrad as ng
    from nevergrad.optimization import metamodel

    # nevergrad 1.0.12 makes a number of an array of one, which numpy 2.4 refuses
    vars(metamodel).setdefault("float", lambda number: float(np.asarray(number).item()))
    seed, point = int(random.integers(1, SEEDS)), ng.p.Array(shape=low.shape, lower=0.0, upper=1.0)
    point.random_state = np.random.RandomState(seed)
    # some of its methods draw from the global generators all the same
    state, by_numpy, before = python_random.getstate(), np.random.get_state(), set(threading.enumerate())
    python_random.seed(seed)
    np.random.seed(seed)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            optimizer = ng.optimizers.registry["NGOpt10"](point, budget=budget)
            for _ in range(budget):
                asked = optimizer.ask()
                optimizer.tell(asked, value(low + asked.value * (high - low)))
    finally:
        # some run in threads that wait for their next value
        for thread in set(threading.enumerate()) - before:
            if hasattr(thread, "stop"):
                thread.stop()
                thread.join()
        python_random.setstate(state)
        np.random.set_state(by_numpy)


def tpe(
    value: Value, low: Array, high: Array, budget: int, random: np.random.Generator, *, n_first: int = 10
) -> None:  # fmt: skip
    """Bayesian optimisation with Parzen estimators, for budgets of up to some hundreds.

    n_first: candidates that are drawn before the model is asked. Source: Bergstra et al. 2011, NeurIPS 24.
    """
    import optuna
    from optuna.distributions import BaseDistribution, FloatDistribution

    n_first = checked_count("n_first", n_first)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        seed = int(random.integers(1, SEEDS))
        sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, n_startup_trials=n_first)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=sampler)
    ends = enumerate(zip(low.tolist(), high.tolist(), strict=True))
    ranges: dict[str, BaseDistribution] = {f"u{i}": FloatDistribution(*pair) for i, pair in ends}
    for _ in range(budget):
        trial = study.ask(ranges)
        study.tell(trial, float(value([trial.params[name] for name in ranges])))


def needing(package: str, search: Callable[..., Any], note: str) -> Identifier:
    made = as_identifier(search.__name__, search)
    return replace(made, build=partial(built_with, package, made), note=note, package=package)


def built_with(package: str, identifier: Identifier, budget: int, **options: Any) -> SearchAlgorithm:
    if find_spec(package) is None:
        raise ArmidError(f"identifier '{identifier.name}' needs the package {package}, which is not installed: "
                         "pip install 'armid[suite]' is expected")  # fmt: skip
    made: SearchAlgorithm = identifier.build(checked_count("the budget", budget), **options)
    return made


FOREIGN = (
    needing("minionpy", lshade, "success-history differential evolution, L-SHADE (minionpy)"),
    needing("nevergrad", ngopt, "chooses by dimension and budget, NGOpt10 (nevergrad)"),
    needing("optuna", tpe, "Bayesian, Parzen estimators (Optuna), for small budgets"),
)
