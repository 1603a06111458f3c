"""Options of identifiers, tuned on instances of the suite that the study itself does not use.

Every identifier gets the same number of configurations, its defaults among them; what is better goes into a study file
with each identifier twice, as it is and tuned.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from armid.errors import ArmidError
from armid.estimation.identify import search
from armid.problem.meter import Meter
from armid.problem.problem import IdentificationProblem
from armid.study.analyses.analysis import TARGETS, first_hits, remaining_share
from armid.study.analyses.convergence import area_over_curve
from armid.study.cases import Case, suite_cases
from armid.study.tasks import Entry, Study

SWARM_PULLS = {"c1": (0.3, 2.5), "c2": (0.3, 2.5)}
CMA = {"initial_step": (0.05, 0.5), "n_candidates": (4, 40), "growth": (1.0, 4.0)}
FIRST_STEP = {"initial_step": (0.005, 0.5)}
# Identifier -> option -> range: whole numbers where both ends are; in the logarithm where they are 10 times apart.
RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "pso": {"n_particles": (5, 160), **SWARM_PULLS, "first_inertia": (0.4, 1.0), "last_inertia": (0.1, 0.7),
            "velocity_limit": (0.02, 1.0)},
    "pymoo_pso": {"pop_size": (5, 100), **SWARM_PULLS, "w": (0.3, 1.0), "max_velocity_rate": (0.02, 1.0)},
    "ga": {"pop_size": (8, 160)},
    "de": {"pop_size": (8, 120), "CR": (0.1, 1.0), "F": (0.3, 1.0)},
    "lshade": {"per_parameter": (2.0, 30.0), "memory": (2, 30)},
    "cmaes": CMA, "bipop_cmaes": CMA, "tpe": {"n_first": (4, 40)},
    "nelder_mead": FIRST_STEP, "bobyqa": FIRST_STEP, "sbplx": FIRST_STEP, "cobyla": FIRST_STEP, "lbfgs": FIRST_STEP,
    "slsqp": FIRST_STEP,
}  # fmt: skip


@dataclass(frozen=True)
class Tuned:
    """What was found for an identifier: options that are better than its defaults, empty where none are.

    default, tuned: area over the convergence curve, mean over the training instances, from 0 to 1.
    """

    label: str
    options: Mapping[str, float]
    default: float
    tuned: float


def tunable(study: Study) -> list[Entry]:
    return [entry for entry in study.entries if entry.name in RANGES and not entry.options]


def training(study: Study) -> list[Case]:
    """Return the training instances; refuse with ArmidError a study without a suite and one that is tried on them."""
    if study.spec.suite is None:
        raise ArmidError(f"study '{study.name}' has no table [suite], armid tune expects one with train instances")
    cases = suite_cases(study.spec, f"study '{study.name}', suite", train=True)
    both = {case.name for case in cases} & set(study.case_names)
    if both:
        raise ArmidError(f"study '{study.name}': {min(both)} is in train and in instances, each in one is expected")
    return cases


def tune(entry: Entry, study: Study, cases: list[Case], n: int, seed: int) -> Tuned:
    """Try n configurations of an identifier, its defaults first, then as Optuna's Bayesian sampler proposes."""
    try:
        import optuna
    except ImportError as error:
        raise ArmidError("armid tune needs the package optuna, which is not installed: "
                         "pip install 'armid[suite]' is expected") from error  # fmt: skip
    default = score(entry, study, cases, {}, seed)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    trials = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=seed))
    for _ in range(n - 1):
        trial = trials.ask()
        chosen = {name: suggested(trial, name, *ends) for name, ends in RANGES[entry.name].items()}
        trials.tell(trial, score(entry, study, cases, chosen, seed))
    if n < 2 or trials.best_value <= default:
        return Tuned(entry.label, {}, default, default)
    return Tuned(entry.label, trials.best_params, default, trials.best_value)


def suggested(trial: Any, name: str, low: float, high: float) -> Any:
    suggest: Callable[..., Any] = trial.suggest_int if isinstance(low, int) else trial.suggest_float
    return suggest(name, low, high, log=high >= 10 * low)


def score(entry: Entry, study: Study, cases: list[Case], options: Mapping[str, Any], seed: int) -> float:
    """Return the area over the convergence curve at the largest budget, mean over cases."""
    identifier = study.registry.identifier(entry.name, "tune").with_options(options)
    hits, budgets = [], []
    for case in cases:
        assert case.suite is not None
        known = case.suite.identification
        meter = Meter(entry.budgets(known.n_var)[-1])
        search(IdentificationProblem(known.space, known.replays, known.fitness, meter), meter, identifier, seed, None)
        start = float(np.median(case.suite(case.suite.spread(64))))
        trace = meter.trace()
        hits.append(first_hits(trace.evaluation, remaining_share(trace.value, start, case.suite.floor), TARGETS))
        budgets.append(meter.budget)
    return float(area_over_curve(np.array(hits), np.array(budgets, dtype=np.float64)).mean())


def tuned_study(study: Study, found: list[Tuned]) -> str:
    """Return the text of the study with the tuned identifiers behind the others."""
    names = {entry.label: entry.name for entry in study.entries}
    text = re.sub(r'(?m)^name = ".*"$', f'name = "{study.name}_tuned"', study.text.rstrip(), count=1)
    for each in found:
        if each.options:
            options = ", ".join(f"{name} = {value!r}" for name, value in each.options.items())
            text += (f'\n\n[[identifiers]]\nname = "{names[each.label]}"\nlabel = "{each.label}, tuned"\n'
                     f"options = {{ {options} }}")  # fmt: skip
    return f"{text}\n"
