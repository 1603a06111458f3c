"""Options of identifiers, tuned on instances of the suite that the study itself does not use.

Tuning goes in rounds: the defaults of every identifier, then one further configuration of each at a time, as Optuna's
Bayesian sampler proposes it. All are identifiers of one training study, which is run and kept like any other; what is
proposed follows from the runs that it holds, so that a tuning that was interrupted goes on as if it had not been.
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from armid.errors import ArmidError
from armid.identifiers import IDENTIFIERS, Identifier
from armid.identifiers.identifier import options_in
from armid.report.document import Column, Document, listed, table
from armid.study.analyses.analysis import TARGETS, first_hits, remaining_share
from armid.study.analyses.convergence import area_over_curve
from armid.study.cases import suite_cases
from armid.study.results import StudyResults, load_study
from armid.study.runner import Ending, Progress, run
from armid.study.spec import EntrySpec
from armid.study.store import DONE
from armid.study.tasks import Study


def ranges_of(identifier: Identifier) -> dict[str, tuple[float, float]]:
    """Return option -> range: whole numbers where both ends are; in the logarithm where they are 10 times apart."""
    options = options_in(identifier.algorithm) if identifier.algorithm else []
    return {option.name: ends for option in options if (ends := option.metadata["option"].tune)}


@dataclass(frozen=True)
class Tuned:
    """What was found for an identifier: options that are better than its defaults, empty where none are.

    default, tuned: area over the convergence curve, mean over the training instances, from 0 to 1.
    """

    label: str
    options: Mapping[str, float]
    default: float
    tuned: float


def tune(
    first: Study, file: str | Path, out: Path, n: int, jobs: int | None = None, dask: str | None = None,
    progress: Progress = lambda counts, outcome: None,
) -> tuple[list[Tuned], Ending]:  # fmt: skip
    """Try n configurations of each identifier; return what was found, nothing after Ctrl-C, and how all rounds ended.

    first: see `training`. The others are those of `armid.study.runner.run`; progress counts all rounds as one
    study. Raises ArmidError without Optuna, and while another process is at the store.
    """
    if find_spec("optuna") is None:
        raise ArmidError("armid tune needs the package optuna, which is not installed: "
                         "pip install 'armid[suite]' is expected")  # fmt: skip
    tried: dict[str, list[EntrySpec]] = {entry.label: [] for entry in first.entries}
    areas: dict[str, float] = {}
    endings: list[Ending] = []
    for i in range(n):
        for entry in first.entries:
            own = tried[entry.label]
            known = [(trial.options, areas[trial.label]) for trial in own[1:]]
            options = proposed(ranges_in(first, entry), known, (entry.seeds[0], i)) if i else {}
            # the same once more would tell nothing new
            if all(trial.options != options for trial in own):
                own.append(replace(entry, label=f"{entry.label} {i}", options=options))
        study = replace(first, entries=tuple(trial for own in tried.values() for trial in own))
        later = (n - 1 - i) * len(first.entries) * len(first.cases)
        endings.append(run(study, file, jobs, dask, out, progress=_with_later(progress, later)))
        if endings[-1].interrupted:
            return [], _together(endings, later)
        areas = scores(study, load_study(out))
    tunings = []
    for label, own in tried.items():
        # the first of the best: nothing is returned where nothing surpasses the defaults
        best = max(own, key=lambda trial: areas[trial.label])
        tunings.append(Tuned(label, best.options, areas[own[0].label], areas[best.label]))
    return tunings, _together(endings, 0)


def training(study: Study, seed: int) -> Study:
    """Return the study of the training instances: identifiers as they are, one seed, their largest budget.

    Refuse with ArmidError a study without a suite, one that is tried on them, and one without what could be tuned.
    """
    if study.spec.suite is None:
        raise ArmidError(f"study '{study.name}' has no table [suite], armid tune expects one with train instances")
    if not re.search(r"(?m)^\s*\[\[\s*identifiers\s*\]\]", study.text):
        raise ArmidError(f"study '{study.name}' has its identifiers in one line: tables headed [[identifiers]] are "
                         "expected, as those that are tuned join them")  # fmt: skip
    cases = suite_cases(study.spec, f"study '{study.name}', suite", train=True)
    both = {case.name for case in cases} & set(study.case_names)
    if both:
        raise ArmidError(f"study '{study.name}': {min(both)} is in train and in instances, each in one is expected")
    entries = [replace(e, seeds=(seed,), budget_per_parameter=e.budget_per_parameter[-1:], budget=e.budget[-1:])
               for e in tunable(study)]  # fmt: skip
    if not entries:
        known = ", ".join(name for name, identifier in IDENTIFIERS.items() if ranges_of(identifier))
        raise ArmidError(f"study '{study.name}' has nothing to tune, one of {known} without options is expected, or a "
                         'function of your own with a range, step: Annotated[float, (0.05, 0.5)] = 0.2')  # fmt: skip
    spec = replace(study.spec, name=f"{study.name}_training", question="Which options are best on the train instances?")
    return replace(study, spec=spec, cases=tuple(cases), entries=tuple(entries))


def tunable(study: Study) -> list[EntrySpec]:
    """Return the identifiers whose options can be tuned, those of one label or of one budget once."""
    entries: list[EntrySpec] = []
    for entry in study.entries:
        same = any(
            e.label == entry.label or (e.name, e.largest_budget) == (entry.name, entry.largest_budget) for e in entries
        )
        if ranges_in(study, entry) and not entry.options and not same:
            entries.append(entry)
    return entries


def ranges_in(study: Study, entry: EntrySpec) -> dict[str, tuple[float, float]]:
    return ranges_of(study.registry.identifier(entry.name, f"study '{study.name}'"))


def proposed(
    wanted: Mapping[str, tuple[float, float]], known: Iterable[tuple[Mapping[str, Any], float]], seed: Sequence[int]
) -> dict[str, Any]:  # fmt: skip
    """Return the next configuration for ranges of options; the same scores and seed propose the same."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    kinds: dict[type, Any] = {int: optuna.distributions.IntDistribution, float: optuna.distributions.FloatDistribution}
    ranges = {option: kinds[type(low)](low, high, log=high >= 10 * low) for option, (low, high) in wanted.items()}
    sampler = optuna.samplers.TPESampler(seed=int(np.random.SeedSequence(seed).generate_state(1)[0]))
    trials = optuna.create_study(direction="maximize", sampler=sampler)
    for options, area in known:
        trials.add_trial(optuna.create_trial(params=dict(options), distributions=ranges, value=area))
    return dict(trials.ask(ranges).params)


def scores(study: Study, results: StudyResults) -> dict[str, float]:
    """Return label -> area over the convergence curve, mean over the cases; 0 where a run has failed."""
    ways = {case.name: (float(np.median(p(p.spread(64)))), p.floor) for case in study.cases if (p := case.suite)}
    done = results.runs[results.runs["status"] == DONE]
    hits = [first_hits(trace.evaluations, remaining_share(trace.values, *ways[case]), TARGETS)
            for trace, case in zip(results.iter_traces(), done["case"], strict=True)]  # fmt: skip
    area = area_over_curve(np.reshape(hits, (-1, TARGETS.size)), done["budget"].to_numpy(np.float64))
    means = done.assign(area=area).groupby("identifier")["area"].mean()
    failed = results.runs.loc[results.runs["status"] != DONE, "identifier"]
    return {str(label): float(mean) for label, mean in means.items()} | dict.fromkeys(failed, 0.0)


def tuned_study(study: Study, tunings: list[Tuned]) -> str:
    """Return the text of the study with the tuned identifiers behind the others, on the same budgets and seeds."""
    entries, spec = {entry.label: entry for entry in reversed(study.entries)}, study.spec
    # the study's own name comes before those in any table
    text = re.sub(r"(?m)^[ \t]*name[ \t]*=.*$", f'name = "{study.name}_tuned"', study.text.rstrip(), count=1)
    for tuning in tunings:
        if tuning.options:
            entry = entries[tuning.label]
            options = ", ".join(f"{name} = {value!r}" for name, value in tuning.options.items())
            text += f'\n\n[[identifiers]]\nname = "{entry.name}"\n'
            label = f"{tuning.label}, tuned"
            while label in entries:  # of a study that was tuned before
                label += " again"
            text += f"label = {json.dumps(label, ensure_ascii=False)}\n"
            text += f"budget = {list(entry.budget)}\n" if entry.budget != spec.budget else ""
            if entry.budget_per_parameter != spec.budget_per_parameter:
                text += f"budget_per_parameter = {list(entry.budget_per_parameter)}\n"
            text += f"seeds = {list(entry.seeds)}\n" if entry.seeds != spec.seeds else ""
            text += f"options = {{ {options} }}"
    return f"{text}\n"


def tuned_document(study: Study, tunings: Sequence[Tuned]) -> Document:
    """Return the answer in a sentence and the table of what was found; study: the one that is tuned."""
    better = [tuning for tuning in tunings if tuning.options]
    answer = f"of {len(tunings)} identifiers {len(better) or 'none'} {'are' if len(better) > 1 else 'is'} better tuned"
    if better:
        most = max(better, key=lambda tuning: tuning.tuned - tuning.default)
        answer += f"; the largest gain is {most.label}, area {most.default:.3f} to {most.tuned:.3f}"
    left = [e.label for e in study.entries if e.label not in {tuning.label for tuning in tunings}]
    answer += f"; nothing to tune in {listed(list(dict.fromkeys(left)))}" if left else ""
    rows = [(e.label, e.default, e.tuned, ", ".join(f"{name} = {value:.3g}" for name, value in e.options.items()))
            for e in tunings]  # fmt: skip
    columns = ("identifier", Column("default", "area as it is", ".3f"), Column("tuned", "area tuned", ".3f"), "options")
    caption = ("Area over the convergence curve at the largest budget, mean over the training instances. The best of "
               "several is better on these by chance too: what it is worth the tuned study tells.")  # fmt: skip
    main = table("Options that were found", columns, rows, caption)
    return Document(f"{study.name}_tuned", "Tuning", "", (answer,), (), main=(main,))


def _with_later(progress: Progress, later: int) -> Progress:
    """Return what tells of a round as a part of the whole; later: runs of the rounds that are still to come."""
    return lambda counts, outcome: progress(counts._replace(planned=counts.planned + later), outcome)


def _together(endings: Sequence[Ending], later: int) -> Ending:
    last = endings[-1]
    return replace(last, counts=last.counts._replace(planned=last.counts.planned + later),
                   finished=sum(e.finished for e in endings), simulations=sum(e.simulations for e in endings),
                   seconds=sum(e.seconds for e in endings))  # fmt: skip
