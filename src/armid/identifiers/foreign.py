"""Algorithms of other libraries; each calls for values by itself."""

import random as python_random
import threading
import warnings
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from armid.identifiers.identifier import declared, option
from armid.identifiers.own import Value, search_by
from armid.identifiers.pymoo_adapter import SEEDS, SearchOptions
from armid.identifiers.search import SearchTask
from armid.model import Array


class Foreign(SearchOptions):
    """Options of a search of another library."""

    def search(self, task: SearchTask) -> None:
        """Minimise until the task drops it."""
        search_by(self.minimise, {}, task)

    @abstractmethod
    def minimise(self, value: Value, low: Array, high: Array, budget: int, random: np.random.Generator) -> None:
        """Call for values within a box until they raise; random: draws its seed."""


@dataclass(frozen=True)
class Lshade(Foreign):
    """Differential evolution with success history and a population that shrinks linearly.

    Source: Tanabe and Fukunaga 2014, doi:10.1109/CEC.2014.6900380.
    """

    package = "minionpy"
    per_parameter: float = option(18.0, "candidates of the first population a parameter, at most a tenth of the budget",
                                  least=1e-15, most=1e4, tune=(2.0, 30.0))  # fmt: skip
    memory: int = option(6, "length of the history", least=1, most=1000, tune=(2, 30))

    def minimise(self, value: Value, low: Array, high: Array, budget: int, random: np.random.Generator) -> None:
        """Run minionpy's L-SHADE."""
        from minionpy import LSHADE

        n_candidates = max(4, min(round(self.per_parameter * low.size), budget // 10))
        options = {"population_size": n_candidates, "memory_size": self.memory, "x_tol": 0.0}
        box = list(zip(low.tolist(), high.tolist(), strict=True))
        LSHADE(value, box, None, budget, None, int(random.integers(1, SEEDS)), options).optimize()


@dataclass(frozen=True)
class Ngopt(Foreign):
    """Choose among nevergrad's methods by dimension and budget: its wizard NGOpt10.

    Its newest one lets cma draw its seed from the clock, so that no run could be repeated.
    Source: Meunier et al. 2022, arXiv:2010.04542.
    """

    package = "nevergrad"

    def minimise(self, value: Value, low: Array, high: Array, budget: int, random: np.random.Generator) -> None:
        """Run nevergrad's wizard, and leave the global generators and threads as they were."""
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


@dataclass(frozen=True)
class Tpe(Foreign):
    """Bayesian optimisation with Parzen estimators, for budgets of up to some hundreds.

    Source: Bergstra et al. 2011, NeurIPS 24.
    """

    package = "optuna"
    n_first: int = option(10, "candidates that are drawn before the model is asked", least=1, most=10**15, tune=(4, 40))

    def minimise(self, value: Value, low: Array, high: Array, budget: int, random: np.random.Generator) -> None:
        """Run Optuna's sampler."""
        import optuna
        from optuna.distributions import BaseDistribution, FloatDistribution

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            seed = int(random.integers(1, SEEDS))
            sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, n_startup_trials=self.n_first)
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        study = optuna.create_study(sampler=sampler)
        ends = enumerate(zip(low.tolist(), high.tolist(), strict=True))
        ranges: dict[str, BaseDistribution] = {f"u{i}": FloatDistribution(*pair) for i, pair in ends}
        for _ in range(budget):
            trial = study.ask(ranges)
            study.tell(trial, float(value([trial.params[name] for name in ranges])))


FOREIGN = (
    declared("lshade", "success-history differential evolution, L-SHADE (minionpy)", Lshade, is_global=True),
    declared("ngopt", "chooses by dimension and budget, NGOpt10 (nevergrad)", Ngopt, is_global=True),
    declared("tpe", "Bayesian, Parzen estimators (Optuna), for small budgets", Tpe, is_global=True),
)
