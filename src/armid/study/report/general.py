"""Sections that every study has, as far as its results allow."""

from collections.abc import Mapping

import numpy as np
from pandas import DataFrame

from armid.study.figures import (
    LEAST_CASES,
    Figure,
    convergence_figure,
    critical_difference_figure,
    data_profile_figure,
    ecdf_figure,
    error_map_figure,
    running_time_figure,
    success_figure,
    valley_figure,
)
from armid.study.metrics import ERROR_TARGETS, VALUE_TARGETS, RankTests, end_points, error_map, success_rates
from armid.study.report import words
from armid.study.report.evidence import Evidence
from armid.study.report.report import Section
from armid.study.tables import fixed_target, mean_ranks, pairs, reasons, running_time, runs, slug, success

FLOOR_PERCENT = 1e-6
MOST_COLOURED = 6


def by_setting(evidence: Evidence, values: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
    """Return setting -> variant -> the values of its runs; values: one row a run."""
    groups = {s: {v: evidence.rows(s, v) for v in evidence.variants} for s in evidence.settings}
    return {s: {v: values[r] for v, r in of.items() if r.any()} for s, of in groups.items()}


def zipped(first: Mapping[str, dict[str, np.ndarray]], second: Mapping[str, dict[str, np.ndarray]]
           ) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:  # fmt: skip
    """Return both of setting -> variant side by side."""
    return {s: {v: (first[s][v], second[s][v]) for v in first[s]} for s in first}


def success_section(evidence: Evidence) -> Section | None:
    """Return how often runs end within a tolerance, where truths are known."""
    if not evidence.knows_truth:
        return None
    figure = Figure("success", "Success rates", words.SUCCESS, lambda: success_figure(success_rates(evidence.found)))
    return Section("Success rates", "", (success(evidence.found),), (figure,))


def running_time_section(evidence: Evidence) -> Section | None:
    """Return what it costs to get to the truth, where truths are known."""
    if not evidence.knows_truth:
        return None
    kept = evidence.histories
    hits = by_setting(evidence, kept.error_hits)
    used = by_setting(evidence, evidence.used)
    label = "largest relative error of the best candidate [%]"
    figures = (
        Figure("ecdf", "ECDF over targets", words.ECDF, lambda: ecdf_figure(hits, kept.grid, evidence.order)),
        Figure("running_time", "Expected running time", words.RUNNING_TIME, lambda: running_time_figure(
            zipped(hits, used), 100.0 * ERROR_TARGETS, evidence.order, label)),
    )  # fmt: skip
    table = running_time(evidence.found.assign(used=evidence.used), kept.error_hits)
    return Section("Cost of the truth", "", (table,), figures)


def best_fitness_section(evidence: Evidence) -> Section | None:
    """Return what it costs to get to the best known fitness."""
    kept = evidence.histories
    hits = by_setting(evidence, kept.value_hits)
    used = by_setting(evidence, evidence.used)
    free = by_setting(evidence, evidence.n_free)
    most = int(kept.grid[-1])
    label = "share of the way to the best known fitness that is left"
    figures = (
        Figure("data_profile", "Data profiles", words.DATA_PROFILE, lambda: data_profile_figure(
            zipped(hits, free), most, evidence.order)),
        Figure("fixed_target", "Expected running time to the best known fitness", words.FIXED_TARGET,
               lambda: running_time_figure(zipped(hits, used), VALUE_TARGETS, evidence.order, label)),
    )  # fmt: skip
    table = fixed_target(evidence.found.assign(used=evidence.used), kept.value_hits)
    return Section("Cost of the best fitness", "", (table,), figures)


def convergence_section(evidence: Evidence) -> Section | None:
    """Return bands of error and fitness against simulations."""
    kept, figures = evidence.histories, []
    if evidence.knows_truth:
        errors = flipped(by_setting(evidence, 100.0 * kept.errors))
        figures.append(Figure(
            "convergence_error", "Convergence of the parameters", words.CONVERGENCE_ERROR,
            lambda: convergence_figure(errors, kept.grid, "largest relative\nerror [%]", FLOOR_PERCENT)
        ))  # fmt: skip
    for fitness in dict.fromkeys(evidence.found["fitness"]):
        figures.append(fitness_convergence(evidence, str(fitness)))
    return Section("Convergence", "", (), tuple(figures))


def fitness_convergence(evidence: Evidence, fitness: str) -> Figure:
    """Return the figure of one fitness."""
    kept = evidence.histories
    own = (evidence.found["fitness"] == fitness).to_numpy()
    groups = {s: {v: own & evidence.rows(s, v) for v in evidence.variants} for s in evidence.settings}
    values = flipped({s: {v: kept.values[r] for v, r in of.items() if r.any()} for s, of in groups.items()})
    several = evidence.found["fitness"].nunique() > 1
    return Figure(
        slug("convergence", fitness) if several else "convergence_fitness", f"Convergence of {fitness}",
        words.CONVERGENCE_FITNESS.format(fitness=fitness),
        lambda: convergence_figure(values, kept.grid, f"best fitness\n({fitness})", 1e-16),
    )  # fmt: skip


def flipped(groups: Mapping[str, Mapping[str, np.ndarray]]) -> dict[str, dict[str, np.ndarray]]:
    """Return variant -> setting -> values."""
    variants = dict.fromkeys(v for of in groups.values() for v in of)
    return {v: {s: of[v] for s, of in groups.items() if v in of} for v in variants}


def errors_section(evidence: Evidence) -> Section | None:
    """Return where errors are large: by case, and along the valley."""
    if not evidence.knows_truth:
        return None
    ends = end_points(evidence.estimates)
    coloured = evidence.interesting[:MOST_COLOURED]
    title = "Errors by identifier and case"
    maps = {s: error_map(evidence.of(s), evidence.best_first, evidence.cases) for s in evidence.settings}
    figures = [Figure("error_map", title, words.ERROR_MAP, lambda: error_map_figure(maps))]
    if ends.shape[1] > 3 and len(ends) > 1:
        figures += [valley(ends[ends["setting"] == s], s, coloured, len(evidence.settings)) for s in evidence.settings]
    return Section("Where the errors are", "", (), tuple(figures))


def valley(ends: DataFrame, setting: str, coloured: list[str], n_settings: int) -> Figure:
    """Return where the runs of one setting end."""
    name = slug("valley", setting if n_settings > 1 else "")
    return Figure(name, f"Where runs end, {setting}", words.VALLEY, lambda: valley_figure(ends, coloured))


def ranks_section(evidence: Evidence) -> Section | None:
    """Return rank tests, where truths are known and there is more than one variant and case."""
    if not evidence.knows_truth or len(evidence.variants) < 2 or len(evidence.cases) < 2:
        return None
    tables, figures = [], []
    for setting, tests in evidence.ranks.items():
        if tests.n_cases < 2 or len(tests.ranks) < 2:
            continue
        end = "" if len(evidence.settings) == 1 else setting
        tables += [mean_ranks(tests, setting, slug("ranks", end)), pairs(tests, setting, slug("pairs", end))]
        if tests.n_cases >= LEAST_CASES and len(tests.ranks) > 2:
            figures.append(critical_difference(tests, setting, slug("critical_difference", end)))
    note = "" if figures else f" A critical-difference diagram wants {LEAST_CASES} cases or more."
    return Section("Ranks", words.RANKS + note, tuple(tables), tuple(figures))


def critical_difference(tests: RankTests, setting: str, name: str) -> Figure:
    """Return the diagram of one setting."""
    return Figure(name, f"Critical differences, {setting}", words.CRITICAL_DIFFERENCE,
                  lambda: critical_difference_figure(tests, setting))  # fmt: skip


def runs_section(evidence: Evidence) -> Section:
    """Return what was run."""
    return Section("Runs", "", (runs(evidence.found, evidence.parameters), reasons(evidence.found)))
