"""Ranks over cases: Friedman's test, Wilcoxon's signed-rank test for each pair with Holm's correction, effect sizes."""

import warnings
from bisect import bisect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from pandas import DataFrame, Series

from armid.model import Array
from armid.problem.suite import DEFINITIONS
from armid.report.document import Column, Figure, Part, Table, Text, listed, slug
from armid.report.style import INK, line_look, pyplot
from armid.study.analyses.analysis import BUDGET_COLUMN, VARIANT, Analysis, Evidence, is_swarm
from armid.study.store import ON
from armid.units import counted

# Errors of 1e-6 % and below are all as good as exact: what is left is rounding.
ARRIVED_ERROR = 1e-8
# With noise, a smaller difference than this share of the Cramer-Rao standard deviation is not a difference.
SHARE_OF_BOUND = 0.01
# A smaller corrected p tells two identifiers apart. The answer names so many that it does not tell from the best.
SURE_LEVEL, MOST_ALIKE = 0.05, 4
# An identifier has arrived when more than this share of its runs has.
HALF = 0.5
# A critical-difference diagram of fewer cases would say little.
LEAST_CASES = 20
# Of so many cases every way to set the signs is counted (8,192), of more Wilcoxon's test is asymptotic.
EXACT_TEST_TO = 13
INTRODUCTION = "How sure is it that one identifier is better than another on cases like these?"
RANK_CAPTION = (
    "Largest relative error of a run, median over the seeds: one number a case and identifier. Errors that differ by "
    "less than a hundredth of the Cramer-Rao bound are alike, and so are those below 1e-6 %. Rank 1 is the best of a "
    "case. arrived: share of the runs that end that near to the run with the lowest fitness on the same noise."
)
PAIRS_CAPTION = (
    "Wilcoxon's signed-rank test of the logarithms of these values (two-sided, Pratt's rule), corrected after Holm "
    "over {n} pairs; with {n_cases} cases the smallest p before correction is {least:.2g}. A12: probability that a "
    "run of the first has a smaller error than a run of the second, ties by half."
)
FIGURE_CAPTION = "Mean ranks over the cases. A bar joins identifiers that do not differ at 5 % (Wilcoxon, Holm)."


def parts(evidence: Evidence) -> Sequence[Part]:
    tables, figures, said = [], [], []
    for setting in evidence.settings:
        tests, reached = evidence.once(compared, setting)
        if tests.n_cases < 2 or len(tests.ranks) < 2:
            continue
        end = "" if len(evidence.settings) == 1 else setting
        said += [f"{setting}: {arrived_text(reached)}."] if len(reached) else []
        tables += [mean_ranks(tests, reached, setting, slug("ranks", end)), pairs(tests, setting, slug("pairs", end))]
        if tests.n_cases >= LEAST_CASES and len(tests.ranks) > 2:
            draw = partial(critical_difference_figure, tests, evidence.colours)
            name = slug("critical_difference", end)
            figures.append(Figure(name, f"Critical differences, {setting}", FIGURE_CAPTION, draw))
    note = "" if figures else f" A critical-difference diagram wants {LEAST_CASES} cases or more."
    return Text(" ".join([INTRODUCTION + note, *said])), *tables, *figures


def compared(evidence: Evidence, setting: str) -> tuple["RankTests", Series]:
    """Return the tests of all variants at a setting, and the share of the runs of each that arrive."""
    return rank_tests(evidence.of(setting), steps_of(evidence, setting)), arrived(evidence, setting)


RANKS = Analysis("ranks", "Ranks", parts, "which identifiers differ: Friedman, Wilcoxon with Holm, effect sizes",
                 lambda e: e.knows_truth and min(len(e.variants), len(e.cases)) > 1)  # fmt: skip


@dataclass(frozen=True, eq=False)
class RankTests:
    """The comparison of all variants on the same cases.

    blocks: median over the seeds, one row a case and one column a variant. ranks: mean rank of each variant, 1 is best,
    rising. p: probability of Friedman's test, NaN for fewer than 3. pairs: first, second, n, p, p_holm, a12.
    """

    blocks: DataFrame
    ranks: Series
    friedman: float
    p: float
    pairs: DataFrame

    @property
    def n_cases(self) -> int:
        return len(self.blocks)


def rank_tests(runs: DataFrame, steps: Mapping[str, float] | None = None) -> RankTests:
    """Compare the largest errors of the variants of one setting on the cases that all of them ran.

    A case is one block, its value the median over the seeds, which are no independent evidence about other cases.
    steps: case -> difference of errors below which two are alike, see `steps_of`.
    Source: Demsar, J. Mach. Learn. Res. 7 (2006) 1.
    """
    raised = runs.assign(largest_error=runs["largest_error"].clip(lower=ARRIVED_ERROR))
    blocks = tied(blocks_of(raised, "largest_error"), steps or {})
    statistic, p = friedman(blocks.to_numpy())
    ranks = blocks.rank(axis=1).mean(axis=0).sort_values(kind="stable")
    return RankTests(blocks, ranks, statistic, p, pair_tests(blocks, raised))


def tied(blocks: DataFrame, steps: Mapping[str, float]) -> DataFrame:
    """Return blocks in which values of a case that differ by less than its step are alike: the least of their chain."""
    values = blocks.to_numpy(float, copy=True)
    for row, case in zip(values, blocks.index, strict=True):
        order = np.argsort(row, kind="stable")
        with np.errstate(invalid="ignore"):
            begins = np.flatnonzero(np.append(True, np.diff(row[order]) >= max(steps.get(str(case), 0.0), 1e-300)))
        row[order] = np.repeat(row[order][begins], np.diff(np.append(begins, len(row))))
    return DataFrame(values, index=blocks.index, columns=blocks.columns)


def steps_of(evidence: Evidence, setting: str) -> dict[str, float]:
    """Return case -> a hundredth of the Cramer-Rao bound, relative, at the run with the least error."""
    own = evidence.estimates[evidence.estimates["setting"] == setting]
    own = own.assign(bound=SHARE_OF_BOUND * own["deviation"] / own["truth"].abs())
    runs = own.groupby(["case", "run"], sort=False)[["relative_error", "bound"]].max().reset_index("case")
    least = runs.sort_values("relative_error").drop_duplicates("case").set_index("case")["bound"]
    return {str(case): float(step) for case, step in least.items() if np.isfinite(step)}


def arrived(evidence: Evidence, setting: str) -> Series:
    """Return the share of the runs of each variant that end where the lowest fitness on the same noise lies.

    A run has arrived if each of its parameters lies there within a hundredth of the Cramer-Rao bound. A variant is left
    out if no other variant minimises its fitness.
    """
    problem, runs = ["case", "seed", "fitness"], evidence.of(setting)
    shared = runs[runs.groupby(problem)["variant"].transform("nunique") > 1]
    done = shared[shared["status"] == "done"]
    if done.empty:
        return Series(dtype=float)
    lowest = done.sort_values("value").drop_duplicates(problem)[[*problem, "run"]]
    own = evidence.estimates[evidence.estimates["run"].isin(done["run"])][["run", *problem, "parameter", "value"]]
    best = evidence.parameters.merge(lowest, on="run")[[*problem, "parameter", "value", "deviation"]]
    both = own.merge(best, on=[*problem, "parameter"], suffixes=("", "_best"))
    bound = np.where(np.isfinite(both["deviation"]), both["deviation"], 0.0)
    reach = np.maximum(SHARE_OF_BOUND * bound, ARRIVED_ERROR * both["value_best"].abs())
    near = ((both["value"] - both["value_best"]).abs() <= reach).groupby(both["run"]).all()
    return shared.assign(near=shared["run"].map(near).eq(True)).groupby("variant", sort=False)["near"].mean()


def arrived_text(reached: Series) -> str:
    what = "pairs of identifier and fitness" if any(ON in variant for variant in reached.index) else "identifiers"
    return (f"{(reached > HALF).sum()} of the {len(reached)} {what} that share a fitness arrive at its lowest value in "
            "most runs")  # fmt: skip


def blocks_of(runs: DataFrame, quantity: str) -> DataFrame:
    """Return the median over the seeds, one row a case that all ran and one column a variant."""
    medians = runs.groupby(["case", "variant"], sort=False)[quantity].median().unstack("variant")
    return medians.reindex(columns=list(dict.fromkeys(runs["variant"]))).dropna(axis=0)


def friedman(blocks: Array) -> tuple[float, float]:
    """Return Friedman's statistic and its probability; NaN for under 3 variants or 2 cases, or if all are equal."""
    from scipy.stats import friedmanchisquare

    n_cases, n_variants = blocks.shape
    if n_variants < 3 or n_cases < 2 or (blocks == blocks[:, :1]).all():
        return np.nan, np.nan
    test = friedmanchisquare(*blocks.T)
    return float(test.statistic), float(test.pvalue)


def pair_tests(blocks: DataFrame, runs: DataFrame) -> DataFrame:
    from statsmodels.stats.multitest import multipletests

    samples = {v: g["largest_error"].to_numpy() for v, g in runs.groupby("variant", sort=False)}
    rows = [
        (a, b, len(blocks), signed_rank(blocks[a].to_numpy(), blocks[b].to_numpy()), a12(samples[a], samples[b]))
        for a, b in combinations(blocks.columns, 2)
    ]
    pairs = DataFrame(rows, columns=["first", "second", "n", "p", "a12"])
    corrected = multipletests(pairs["p"], method="holm")[1] if len(pairs) and len(blocks) else np.nan
    return pairs.assign(p_holm=corrected)


def signed_rank(first: Array, second: Array) -> float:
    """Return the two-sided probability of Wilcoxon's signed-rank test; 1 for a single pair or when no pair differs.

    Differences are taken between the logarithms, since errors span many powers of ten, zero and infinity counting as
    the ends of all floats; Pratt's rule for ties.
    """
    from scipy.stats import permutation_test, rankdata, wilcoxon

    ends = np.finfo(np.float64)
    x, y = (np.log(np.clip(v, ends.tiny, ends.max)) for v in (first, second))
    differences = np.where(first == second, 0.0, x - y)
    if len(differences) < 2 or not differences.any():
        return 1.0
    if len(differences) > EXACT_TEST_TO:
        return float(wilcoxon(differences, zero_method="pratt").pvalue)

    def signed_ranks(d: Array, axis: int) -> Any:
        return np.sum(np.sign(d) * rankdata(np.abs(d), axis=axis), axis=axis)

    # `wilcoxon` counts the same signs one by one, in Python: seconds a pair
    return float(permutation_test((differences,), signed_ranks, permutation_type="samples", vectorized=True,
                                  n_resamples=2**EXACT_TEST_TO).pvalue)  # fmt: skip


def a12(first: Sequence[float] | Array, second: Sequence[float] | Array) -> float:
    """Return the probability that a number of the first sample is smaller than one of the second, ties by half.

    Infinite ones are allowed. Source: Vargha and Delaney, J. Educ. Behav. Stat. 25 (2000) 101.
    """
    from scipy.stats import rankdata

    n, ranks = len(first), rankdata([*second, *first])
    return float((ranks[:-n].sum() / (len(ranks) - n) - 0.5 * (len(ranks) - n + 1)) / n)


def size_in_words(value: float) -> str:
    """Return how large the effect is: negligible, small, medium, large (Vargha and Delaney's 0.56, 0.64, 0.71)."""
    return ("negligible", "small", "medium", "large")[bisect((0.06, 0.14, 0.21), abs(value - 0.5))]


def mean_ranks(tests: RankTests, reached: Series, setting: str, name: str) -> Table:
    medians = tests.blocks[tests.ranks.index].median()
    frame = DataFrame({"variant": tests.ranks.index, "rank": tests.ranks.to_numpy(), "median": medians.to_numpy(),
                       "arrived": reached.reindex(tests.ranks.index).to_numpy(float)})  # fmt: skip
    columns = (VARIANT, Column("rank", "mean rank", ".2f"), Column("median", "median of the cases [%]", ".3g", 100.0),
               Column("arrived", "arrived [%]", ".3g", 100.0))  # fmt: skip
    title = f"Mean ranks over {counted(tests.n_cases, 'case')}, {setting}"
    return Table(name, title, f"{RANK_CAPTION} {friedman_sentence(tests)}", frame, columns)


def friedman_sentence(tests: RankTests) -> str:
    if np.isnan(tests.p):
        return "Friedman's test needs at least three identifiers that differ and two cases."
    verdict = "differ" if tests.p < 0.05 else "cannot be told apart"
    degrees = len(tests.ranks) - 1
    return f"Friedman: chi2({degrees}) = {tests.friedman:.3g}, p = {tests.p:.2g}: the identifiers {verdict} at 5 %."


def pairs(tests: RankTests, setting: str, name: str) -> Table:
    """Return the tests of all pairs, those with the best-ranked identifier first."""
    best = tests.ranks.index[0]
    frame = tests.pairs.assign(size=tests.pairs["a12"].map(size_in_words))
    without_best = (frame["first"] != best) & (frame["second"] != best)
    frame = frame.assign(_last=without_best).sort_values(["_last", "p_holm"], kind="stable").drop(columns="_last")
    caption = PAIRS_CAPTION.format(n=len(frame), n_cases=tests.n_cases, least=2.0 ** (1 - tests.n_cases))
    columns = (
        Column("first", "first"), Column("second", "second"), Column("n", "cases", ".0f"), Column("p", "p", ".2g"),
        Column("p_holm", "p, Holm", ".2g"), Column("a12", "A12", ".2f"), Column("size", "difference"),
    )  # fmt: skip
    return Table(name, f"Pairs, {setting}", caption, frame, columns, most=max(20, len(tests.ranks) - 1))


def p_matrix(tests: RankTests) -> DataFrame:
    """Return the corrected p of each pair, 1 of a variant with itself."""
    names = tests.blocks.columns
    above = tests.pairs.pivot(index="first", columns="second", values="p_holm").reindex(index=names, columns=names)
    return above.combine_first(above.T).fillna(1.0)


def critical_difference_figure(tests: RankTests, colours: Mapping[str, int]) -> Any:
    """Draw the mean ranks on a line (Demsar 2006); a bar joins identifiers that do not differ significantly at 5 %."""
    import scikit_posthocs as sp

    plt = pyplot()
    n = len(tests.ranks)
    figure, axis = plt.subplots(figsize=(10.5, 1.6 + 0.26 * n), layout="constrained")
    look = {name: line_look(colours[str(name)])["color"] for name in tests.blocks.columns}
    with warnings.catch_warnings():
        # pandas warns scikit-posthocs of what it does inside
        warnings.simplefilter("ignore", FutureWarning)
        sp.critical_difference_diagram(
            tests.ranks, p_matrix(tests), ax=axis, color_palette=look, label_fmt_left="{label} ({rank:.2f})",
            label_fmt_right="({rank:.2f}) {label}", label_props={"fontsize": 10}, crossbar_props={"color": INK},
        )  # fmt: skip
    figure.supxlabel(f"mean rank over {counted(tests.n_cases, 'case')}, 1 is best", fontsize="medium")
    return figure


CLASS_CAPTION = (
    "Rank of the fitness that a run ends with, median over the seeds, among all identifiers on a case; values below "
    "that of the truth, or apart by less than 1e-8, are alike. Mean over the cases, in brackets the 95 % interval of "
    "a bootstrap over the problems. first: cases in which nobody is better; then the mean in each class of "
    "difficulty."
)
CLASSES = ("smooth", "valley", "rugged", "plateau", "stair")
# A fitness this near to that of the truth equals it: [rad/s], or of a similarity 1.
NEAR_TRUTH = 1e-8
N_BOOTSTRAP = 1000


BY_CLASS = Analysis("by_class", "Ranks by class of difficulty", lambda evidence: (
    class_ranks(evidence), swarm_pairs(evidence), problems(evidence),
), "who is best on which problems of a suite", lambda evidence: evidence.is_suite)  # fmt: skip


def final_values(evidence: Evidence, setting: str) -> DataFrame:
    runs = evidence.of(setting)
    floors = runs["case"].map({c["name"]: c["floor"] for c in evidence.study["cases"]}).astype(float) + NEAR_TRUTH
    reached = np.maximum(runs["value"].where(runs["status"] == "done", np.inf), floors)
    blocks = blocks_of(runs.assign(value=reached), "value")
    return tied(blocks, dict.fromkeys(map(str, blocks.index), NEAR_TRUTH))


def class_ranks(evidence: Evidence) -> Table:
    problem_of, class_of = ({c["name"]: c[key] for c in evidence.study["cases"]} for key in ("suite", "difficulty"))
    present, rows = [name for name in CLASSES if name in class_of.values()], []
    for setting in evidence.settings:
        ranks = final_values(evidence, setting).rank(axis=1)
        if ranks.empty:
            continue
        problems = ranks.groupby(ranks.index.map(problem_of)).mean()
        classes = ranks.groupby(ranks.index.map(class_of)).mean().reindex(present)
        drawn = np.random.default_rng(1).integers(0, len(problems), (N_BOOTSTRAP, len(problems)))
        best = ranks.min(axis=1)
        for variant, mean in ranks.mean().sort_values(kind="stable").items():
            low, high = np.quantile(problems[variant].to_numpy()[drawn].mean(axis=1), [0.025, 0.975])
            n_first = int((ranks[variant] <= best).sum())
            text = f"{mean:.2f} ({low:.2f} to {high:.2f})"
            rows.append((setting, variant, len(ranks), mean, low, high, text, n_first, *classes[variant]))
    names = ["setting", "variant", "n", "rank", "low", "high", "text", "first", *present]
    columns = (BUDGET_COLUMN, VARIANT, Column("n", "cases", ".0f"), Column("text", "mean rank"),
               Column("first", "first", ".0f"), *(Column(c, c, ".2f") for c in present))  # fmt: skip
    return Table("by_class", "Ranks by class of difficulty", CLASS_CAPTION, DataFrame(rows, columns=names), columns,
                 grouped=True)  # fmt: skip


PROBLEMS_CAPTION = (
    "Measured on the first instance of each problem. valley: condition of the derivatives of the residuals at the "
    "truth. stair, plateau: shares of steps of 0.1 % and 5 % of the range that change nothing or next to nothing. "
    "minima: on a straight line through the truth. holes: share of the box where the simulation diverges."
)


def problems(evidence: Evidence) -> Table:
    firsts = {case["suite"]: case for case in reversed(evidence.study["cases"])}
    rows = [{"problem": name, "n": len(case["bounds"]), "class": case["difficulty"], **case["landscape"]}
            for name, case in reversed(firsts.items())]  # fmt: skip
    columns = (
        Column("problem", "problem"), Column("n", "parameters", ".0f"), Column("n_records", "records", ".0f"),
        Column("noise_deg_s", "noise [deg/s]", ".1f"), Column("class", "class"), Column("valley", "valley", ".2g"),
        Column("stair", "stair", ".2f"), Column("plateau", "plateau", ".2f"), Column("minima", "minima", ".1f"),
        Column("holes", "holes", ".2f"),
    )  # fmt: skip
    return Table("problems", "The problems", PROBLEMS_CAPTION, DataFrame(rows), columns)


SWARM_CAPTION = (
    "Median over the problems of the ratio of what the swarm and the other leave of the fitness (above 1: the swarm "
    "leaves more). p: Wilcoxon's signed-rank test on the problems, corrected after Holm within a budget."
)


def swarm_pairs(evidence: Evidence) -> Table:
    rows: list[tuple[object, ...]] = []
    for setting in evidence.settings:
        swarm = next((v for v in evidence.once(final_values, setting).columns if is_swarm(v)), None)
        rows += [(setting, swarm, *line) for line in against(evidence, setting, swarm)] if swarm else []
    columns = (BUDGET_COLUMN, Column("swarm", "swarm"), Column("variant", "against"), Column("ratio", "ratio", ".3g"),
               Column("p", "p, Holm", ".2g"))  # fmt: skip
    frame = DataFrame(rows, columns=[column.key for column in columns])
    return Table("swarm", "The paper's swarm against the others", SWARM_CAPTION, frame, columns, grouped=True)


def against(evidence: Evidence, setting: str, one: str) -> list[tuple[str, float, float]]:
    """Return each other variant with the ratio of what `one` and it leave, and the corrected p of their test."""
    from statsmodels.stats.multitest import multipletests

    values, problem_of = evidence.once(final_values, setting), {c["name"]: c["suite"] for c in evidence.study["cases"]}
    others = [v for v in values.columns if v != one]
    if values.empty or not others:
        return []
    logs = DataFrame(np.log(values), index=values.index, columns=values.columns)
    means = DataFrame(np.exp(logs.groupby(values.index.map(problem_of)).mean()), columns=values.columns)
    ratios = [float((means[one] / means[other]).median()) for other in others]
    p = [signed_rank(means[one].to_numpy(), means[other].to_numpy()) for other in others]
    return list(zip(others, ratios, multipletests(p, method="holm")[1], strict=True))


def alike_text(others: Sequence[tuple[str, float]], n_cases: int) -> str:
    """Return which others the tests cannot tell from the best, "" without others. others: with their corrected p."""
    alike = [name for name, p in others if not p < SURE_LEVEL]
    if not alike:
        return "; it is better than each other by the tests" if others else ""
    if len(alike) == len(others) > MOST_ALIKE:
        return f"; on {counted(n_cases, 'case')} the tests can tell nobody from it"
    return f"; the tests cannot tell {listed(alike, MOST_ALIKE)} from it"


def suite_answer(evidence: Evidence) -> tuple[str, ...]:
    """Return who is best at each budget, where plug-ins and the paper's swarm stand, and whether the suite is easy."""
    ranks, pairs = DataFrame(class_ranks(evidence).frame), DataFrame(swarm_pairs(evidence).frame)
    said, winners, classes = [], set(), [name for name in CLASSES if name in ranks]
    for setting, own in ranks.groupby("setting", sort=False):
        for name in classes:
            winners |= set(own.loc[own[name] <= own[name].min(), "variant"])
        best, tested = own.iloc[0], pairs[pairs["setting"] == setting]
        alike = alike_text([(name, p) for name, _, p in against(evidence, str(setting), str(best["variant"]))],
                           int(best["n"]))  # fmt: skip
        first = listed(list(own.loc[own["rank"] <= best["rank"], "variant"]))
        line = f"Budget {setting}, {counted(int(best['n']), 'case')}: best is {first}, mean rank {best['text']}"
        line += f" of {len(own)}{alike}."
        line += "".join(f" Your own {v} {standing(own, v)}." for v in own["variant"] if v in evidence.own)
        if len(tested):
            swarm, sure = own[own["variant"] == tested["swarm"].iloc[0]].iloc[0], tested["p"] < SURE_LEVEL
            others = own[own["variant"] != swarm["variant"]]
            leads = [name for name in classes if swarm[name] < others[name].min()]
            wins, losses = (int((sure & better).sum()) for better in (tested["ratio"] < 1.0, tested["ratio"] > 1.0))
            line += (
                f" The paper's swarm ({swarm['variant']}) {standing(own, swarm['variant'])}: it is better than {wins}, "
                f"worse than {losses}, cannot be told from {len(tested) - wins - losses}, and is best "
                f"{'on ' + ', '.join(leads) if leads else 'in no class'}."
            )
        said.append(line)
    easy = "fewer than three: the suite is too easy" if len(winners) < 3 else "so the suite is not too easy"
    if len(evidence.variants) < 3 or {case["suite"] for case in evidence.study["cases"]} != DEFINITIONS.keys():
        return tuple(said)
    return (*said, f"{len(winners)} identifiers are best in some class at some budget ({', '.join(sorted(winners))}), "
            f"{easy}.")  # fmt: skip


def standing(ranks: DataFrame, variant: str) -> str:
    row = ranks[ranks["variant"] == variant].iloc[0]
    place = 1 + int((ranks["rank"] < row["rank"]).sum())
    return f"is number {place} of {len(ranks)} (mean rank {row['rank']:.3g})"
