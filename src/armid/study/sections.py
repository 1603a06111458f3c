"""Sections that every study has, as far as its results allow."""

from collections.abc import Mapping

import numpy as np
from pandas import DataFrame

from armid.study import captions as words
from armid.study.analyses.convergence import convergence_figure
from armid.study.analyses.cramer_rao import cramer_rao, cramer_rao_figure, cramer_rao_summary
from armid.study.analyses.drawing import Figure
from armid.study.analyses.ecdf import data_profile_figure, ecdf_figure
from armid.study.analyses.errors import error_map, error_map_figure
from armid.study.analyses.fitness_quality import fitness_quality_figure, fitness_quality_table
from armid.study.analyses.histories import ERROR_TARGETS, VALUE_TARGETS
from armid.study.analyses.overview import reasons, runs
from armid.study.analyses.ranks import LEAST_CASES, RankTests, critical_difference_figure, mean_ranks, pairs
from armid.study.analyses.running_time import fixed_target, running_time, running_time_figure
from armid.study.analyses.success import success, success_figure, success_rates
from armid.study.analyses.table import slug, unlike
from armid.study.analyses.table1 import table1, table1_all, table1_figure, table1_rows
from armid.study.analyses.table2 import table2, table2_figure, table2_records
from armid.study.analyses.valley import end_points, valley_figure
from armid.study.report import Evidence, ReportSection

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


def success_section(evidence: Evidence) -> ReportSection | None:
    """Return how often runs end within a tolerance, where truths are known."""
    if not evidence.knows_truth:
        return None
    figure = Figure("success", "Success rates", words.SUCCESS, lambda: success_figure(success_rates(evidence.found)))
    return ReportSection("Success rates", "", (success(evidence.found),), (figure,))


def running_time_section(evidence: Evidence) -> ReportSection | None:
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
    return ReportSection("Cost of the truth", "", (table,), figures)


def best_fitness_section(evidence: Evidence) -> ReportSection | None:
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
    return ReportSection("Cost of the best fitness", "", (table,), figures)


def convergence_section(evidence: Evidence) -> ReportSection | None:
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
    return ReportSection("Convergence", "", (), tuple(figures))


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


def errors_section(evidence: Evidence) -> ReportSection | None:
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
    return ReportSection("Where the errors are", "", (), tuple(figures))


def valley(ends: DataFrame, setting: str, coloured: list[str], n_settings: int) -> Figure:
    """Return where the runs of one setting end."""
    name = slug("valley", setting if n_settings > 1 else "")
    return Figure(name, f"Where runs end, {setting}", words.VALLEY, lambda: valley_figure(ends, coloured))


def ranks_section(evidence: Evidence) -> ReportSection | None:
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
    return ReportSection("Ranks", words.RANKS + note, tuple(tables), tuple(figures))


def critical_difference(tests: RankTests, setting: str, name: str) -> Figure:
    """Return the diagram of one setting."""
    return Figure(name, f"Critical differences, {setting}", words.CRITICAL_DIFFERENCE,
                  lambda: critical_difference_figure(tests, setting))  # fmt: skip


def runs_section(evidence: Evidence) -> ReportSection:
    """Return what was run."""
    return ReportSection("Runs", "", (runs(evidence.found, evidence.parameters), reasons(evidence.found)))


TABLE1_WORDS = (
    "Relative error [%] on a logarithmic axis, all rows and seeds together: the box spans the quartiles, the thick "
    "line is the median, the whiskers reach from the 5th to the 95th percentile, dots are the runs beyond. Diamonds "
    "are the paper's errors on its rows, the dashed line is their mean. Errors below 1e-9 % are drawn there."
)
TABLE2_WORDS = (
    "Result of each run, one mark and colour a record; the paper's identifications of its measured records above as "
    "diamonds. The line is the truth of the synthetic records, the grey band the truth +- one Cramer-Rao standard "
    "deviation of one record (median over the runs), dotted lines are bounds of the box."
)
CRAMER_RAO_WORDS = (
    "Standard deviation over the noise realisations divided by the Cramer-Rao bound, with its 95 % interval, a mark "
    "and colour a case. The band spans 0.9 to 1.1; left of 1 by more than chance would be too good to be true, unless "
    "a bound of the box holds runs back."
)
FITNESS_WORDS = (
    "Each mark is a run: the largest relative error of its result against 1 - S, the similarity degree that it "
    "reached on the train records, whatever was minimised. A fitness that gives right parameters is low; one that "
    "only gives a high similarity is left but not low. Failed runs are left out; values below 1e-16 are drawn there."
)


def table1_section(evidence: Evidence) -> ReportSection | None:
    """Return Table I beside ours, where the study asks for it and a case carries a published result."""
    if evidence.study.get("report") != "table1" or evidence.published.empty:
        return None
    rows = table1_rows(evidence.estimates, evidence.published)
    if rows.empty:
        return None
    wanted = [(s, v) for v in evidence.interesting for s in evidence.settings if evidence.rows(s, v).any()]
    names = unlike([slug("table1", v, s) for s, v in wanted])
    tables = [table1(rows, s, v, name) for (s, v), name in zip(wanted, names, strict=True)]
    order = [v for v in evidence.best_first if v in set(evidence.estimates["variant"])]
    figure = Figure("table1", "Errors on Table I beside the paper's", TABLE1_WORDS,
                    lambda: table1_figure(evidence.estimates, evidence.published, order))  # fmt: skip
    title = "Table I of the paper beside ours"
    words = (
        f"Shown for {', '.join(evidence.interesting)}: the swarm in every form that was run, then the best of the "
        "others by the rank of their median largest error. All identifiers are in table1.csv."
    )
    return ReportSection(title, words, (*tables, table1_all(rows)), (figure,))


def table2_section(evidence: Evidence) -> ReportSection | None:
    """Return Table II beside ours, where the study asks for it."""
    if evidence.study.get("report") != "table2" or evidence.estimates.empty:
        return None
    figure = Figure("table2", "Repeated identifications beside the paper's", TABLE2_WORDS,
                    lambda: table2_figure(evidence.estimates, evidence.published))  # fmt: skip
    tables = table2(evidence.estimates, evidence.published), table2_records(evidence.estimates)
    return ReportSection("Table II of the paper beside ours", "", tables, (figure,))


def cramer_rao_section(evidence: Evidence) -> ReportSection | None:
    """Return scatter against its bound, where there are enough noise realisations of known truths."""
    if evidence.estimates.empty:
        return None
    noisy = evidence.estimates[evidence.estimates["noise_deg_s"] > 0.0]
    table = cramer_rao(noisy)
    if table.frame.empty:
        return None
    figure = Figure("cramer_rao", "Scatter against the Cramer-Rao bound", CRAMER_RAO_WORDS,
                    lambda: cramer_rao_figure(table.frame))  # fmt: skip
    return ReportSection(
        "Scatter against the Cramer-Rao bound", "", (cramer_rao_summary(table.frame), table), (figure,)
    )


def fitness_section(evidence: Evidence) -> ReportSection | None:
    """Return fitness functions side by side, where several were run on known truths."""
    if evidence.found["fitness"].nunique() < 2 or not evidence.knows_truth:
        return None
    figure = Figure("fitness", "Error against the similarity reached", FITNESS_WORDS,
                    lambda: fitness_quality_figure(evidence.found))  # fmt: skip
    return ReportSection(
        "Which fitness gives right parameters", "", (fitness_quality_table(evidence.found),), (figure,)
    )
