"""What answers a study's question: a sentence for its kind, and a table of all identifiers or of all campaigns.

Also the last table of every report: what was run, and why runs stopped.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pandas import DataFrame, Series, concat, factorize

from armid.report.document import Column, Table, listed
from armid.study.analyses.analysis import N_RUNS, PAPER, PARAMETER, SETTING, VARIANT, Analysis, Evidence, is_swarm
from armid.study.analyses.ranks import HALF, alike_text, arrived_text, compared, suite_answer
from armid.units import counted, scale_of

OVERVIEW_CAPTION = (
    "Relative error abs(value - truth)/abs(truth) in %, mean and median over all finished runs; simulations: median "
    "of a run. 'largest' is the largest error among the parameters of one run: its median, 95th percentile and worst "
    "over the runs, where a failed run counts as infinite."
)
PAPER_CAPTION = (
    f" The line '{PAPER}' is computed from the values that the paper printed, one run a row, on its own data."
)
VALUES_CAPTION = (
    "Median and population standard deviation of each parameter over all finished runs. Cramer-Rao, RMSE: medians at "
    "the solution; at a bound: runs whose parameter ended on its bound."
)
RUNS_CAPTION = (
    "used: simulations of a run, median; diverged: share of these that gave no finite record. failed: runs without a "
    "result; at a bound: runs that ended with a parameter on a bound of the box."
)
VALUES_COLUMNS = (
    SETTING, VARIANT, PARAMETER, Column("unit", "unit"), N_RUNS, Column("median", "median", ".6g"),
    Column("deviation", "standard deviation", ".2g"), Column("bound", "Cramer-Rao", ".2g"),
    Column("train", "RMSE train", ".4g"), Column("holdout", "RMSE holdout", ".4g"),
    Column("n_at_bound", "at a bound", ".0f"),
)  # fmt: skip
RUNS_COLUMNS = (
    SETTING, VARIANT, N_RUNS, Column("failed", "failed", ".0f"), Column("budget", "budget", ".0f"),
    Column("used", "used", ".0f"), Column("diverged", "diverged [%]", ".2g", 100.0),
    Column("held", "at a bound", ".0f"),
)  # fmt: skip


def main_table(evidence: Evidence) -> Table:
    if not evidence.knows_truth:
        return values(evidence.runs, evidence.estimates, evidence.unit)
    is_table1 = evidence.study.get("report") == "table1"
    return overview(evidence.runs, evidence.estimates, evidence.published if is_table1 else evidence.published[:0])


OVERVIEW = Analysis("overview", "Overview", lambda evidence: (main_table(evidence),),
                    "errors of all identifiers, without truths their values")  # fmt: skip
RUNS_ANALYSIS = Analysis("runs", "Runs", lambda evidence: (
    runs_table(evidence.runs, evidence.parameters), reasons(evidence.runs),
), "what was run, and why runs stopped")  # fmt: skip


def overview(runs: DataFrame, estimates: DataFrame, published: DataFrame) -> Table:
    """Return mean and median relative error of each parameter, and the tail of the largest, one line a variant."""
    names, by = list(dict.fromkeys(estimates["parameter"])), ["setting", "variant"]
    if len(published):
        # the paper's rows are runs of one identifier more
        paper = published.assign(setting="", variant=PAPER)
        largest = paper.groupby(["case", *by], sort=False)["relative_error"].max().rename("largest_error").reset_index()
        runs = concat([largest.assign(status="done", used=np.nan), runs])
        estimates = concat([paper, estimates])
    of_each = estimates.groupby([*by, "parameter"], sort=False)["relative_error"].agg(["mean", "median"]).unstack()
    frame = runs.groupby(by, sort=False).agg(
        n=("status", "size"), n_failed_runs=("status", lambda s: int((s != "done").sum())), used=("used", "median"),
        largest_median=("largest_error", lambda e: e.median(skipna=False)),
        largest_p95=("largest_error", lambda e: np.quantile(e, 0.95, method="inverted_cdf")),
        largest_worst=("largest_error", lambda e: e.max(skipna=False)),
    )  # fmt: skip
    frame = frame.assign(**{f"{name}_{kind}": of_each[kind, name] for name in names for kind in ("mean", "median")})
    # rows of a setting stand together, settings in the order of their first row
    frame = frame.reset_index().sort_values("setting", key=lambda s: Series(factorize(s)[0], s.index), kind="stable")
    columns = [Column("used", "simulations", ",.0f")]
    columns += [Column(f"largest_{key}", f"largest {text}", ".3g", 100.0)
                for key, text in (("median", "median"), ("worst", "worst"), ("p95", "95 %"))]  # fmt: skip
    columns += [N_RUNS] + [Column(f"{n}_{kind}", f"{n} {kind}", ".3g", 100.0)
                           for n in names for kind in ("median", "mean")]  # fmt: skip
    caption = OVERVIEW_CAPTION + (PAPER_CAPTION if len(published) else "")
    return Table("overview", "Relative errors of all identifiers [%]", caption, frame,
                 (SETTING, VARIANT, *columns), grouped=True)  # fmt: skip


def values(runs: DataFrame, estimates: DataFrame, unit: str) -> Table:
    """Return what the parameters are, in units that people read; unit: of the records, SI."""
    joined = estimates.merge(runs[["run", "train_rmse", "holdout_rmse"]], on="run")
    frame = joined.groupby(["setting", "variant", "parameter", "unit"], sort=False).agg(
        n=("run", "size"), median=("value", "median"), deviation=("value", lambda v: v.std(ddof=0)),
        bound=("deviation", "median"), train=("train_rmse", "median"), holdout=("holdout_rmse", "median"),
        n_at_bound=("at_bound", "sum"),
    ).reset_index()  # fmt: skip
    scales, (signal, factor) = list(map(scale_of, frame["unit"], frame["median"])), scale_of(unit)
    frame = frame.assign(unit=[name for name, _ in scales], **{
        key: frame[key] * [scale for _, scale in scales] for key in ("median", "deviation", "bound")
    })  # fmt: skip
    columns = tuple(replace(c, header=f"{c.header} [{signal}]", factor=factor) if c.key in ("train", "holdout") else c
                    for c in VALUES_COLUMNS)  # fmt: skip
    return Table("values", "Parameters found", VALUES_CAPTION, frame, columns, grouped=True)


def runs_table(runs: DataFrame, parameters: DataFrame) -> Table:
    held = set(parameters.loc[parameters["at_bound"].astype(bool), "run"])
    marked = runs.assign(done=runs["status"] == "done", held=runs["run"].isin(held))
    frame = marked.groupby(["setting", "variant"], sort=False).agg(
        n=("run", "size"), done=("done", "sum"), budget=("budget", "max"), used=("used", "median"),
        total=("used", "sum"), lost=("n_failed", "sum"), held=("held", "sum"),
    ).reset_index()  # fmt: skip
    frame["failed"] = frame["n"] - frame["done"]
    frame["diverged"] = frame["lost"] / frame["total"].where(frame["total"] > 0)
    return Table("runs", "Runs", RUNS_CAPTION, frame, RUNS_COLUMNS)


def reasons(runs: DataFrame) -> Table:
    failed = runs["status"] != "done"
    reason = runs["stopped"].where(~failed, "failed: " + runs["error"].map(first_line))
    frame = runs.assign(reason=reason).groupby(["variant", "reason"], sort=False).size().reset_index(name="n")
    columns = (VARIANT, Column("reason", "reason"), N_RUNS)
    return Table("reasons", "Why runs stopped", "Counted over all cases, noise levels and seeds.", frame, columns)


def first_line(text: str) -> str:
    line = str(text).strip().partition("\n")[0]
    return line if len(line) <= 120 else f"{line[:117]}..."


VERDICTS_CAPTION = "Campaigns by verdict and by what was added to the declared model."
CAMPAIGNS_CAPTION = (
    "Error on the records held out: RMSE over the rms noise of the campaign, before and after the effects were added "
    "to the declared model; 1 where only noise is left, empty without such records. CPU: processor time of the loop."
)
VERDICTS_COLUMNS = Column("verdict", "verdict"), Column("effects", "effects"), Column("n", "campaigns", ".0f")
CAMPAIGNS_COLUMNS = (
    Column("case", "campaign"), Column("verdict", "verdict"), Column("effects", "effects"),
    Column("before", "held-out error before [noise]", ".3f"), Column("after", "after [noise]", ".3f"),
    Column("cpu_seconds", "CPU [s]", ".1f"),
)  # fmt: skip


def loop_runs(loops: DataFrame) -> DataFrame:
    """Return one row a campaign that was closed: verdict, effects, error on the records held out over the noise."""
    reports = loops["report"]
    runs = loops[["case", "verdict"]].assign(
        plant=[report["plant"] for report in reports],
        effects=[" + ".join(report["effects"]) or "nothing" for report in reports],
        before=[over_noise(report, "before") for report in reports],
        after=[over_noise(report, "after") for report in reports],
    )
    return runs.join(loops[["cpu_seconds", "seconds"]])


def over_noise(report: Mapping[str, Any], when: str) -> float:
    error = report["error"][when]["holdout"]
    return np.nan if error is None else float(error["rmse"] / report["noise_rms"])


def loop_tables(runs: DataFrame) -> tuple[str, Table, Table]:
    """Return the answer of a study that closes loops, and the tables of what was found and of its campaigns."""
    counts = [f"{n} {str(verdict).replace('_', ' ')}" for verdict, n in runs["verdict"].value_counts().items()]
    found = runs.groupby(["verdict", "effects"]).size().rename("n").reset_index()
    return (
        f"Of {len(runs)} campaigns: {', '.join(counts)}." if counts else "No campaign was closed.",
        Table("verdicts", "What was found", VERDICTS_CAPTION, found, VERDICTS_COLUMNS, grouped=True),
        Table("campaigns", "Campaigns", CAMPAIGNS_CAPTION, runs, CAMPAIGNS_COLUMNS),
    )


# The answer names so many settings; the table holds all.
MOST_SETTINGS = 3
# Of the paper's simulations: what its table is to be beaten with.
QUARTER_OF_RUNS = 0.25
# A parameter whose mean error is more times its scatter than this is off, whatever the search does.
OFF = 3.0
# Identifiers of plug-ins that the answer places in one setting, the best first; the table holds all.
MOST_OWN = 3


def answer_of(evidence: Evidence, overview: Any) -> tuple[str, ...]:
    """Return the answer to the question of a study; overview: its main table."""
    if evidence.is_suite:
        return suite_answer(evidence)
    if not evidence.knows_truth:
        return (lowest_fitness(evidence),)
    kind = evidence.study.get("report")
    frame = overview.frame
    first = {"table1": beside_paper, "table2": repeats}.get(str(kind), by_fitness)(evidence, frame)
    return (*first, *best(evidence, frame), *own(evidence, frame), *undetermined(evidence))


def noisy_first(evidence: Evidence) -> list[str]:
    """Return the settings, those with noise before those without."""
    with_noise = set(evidence.runs.loc[evidence.runs["noise_deg_s"] != 0.0, "setting"])
    return sorted(evidence.settings, key=lambda s: s not in with_noise)


def beside_paper(evidence: Evidence, frame: DataFrame) -> tuple[str, ...]:
    """Return whether the paper's table is reproduced, and beaten at a quarter of the cost; nothing without its row.

    It is reproduced where the paper's error is not below the middle half of our runs of its own method.
    """
    setting = noisy_first(evidence)[0]
    ours = frame[(frame["variant"] != PAPER) & (frame["setting"] == setting)].set_index("variant")
    swarms = ours.loc[[v for v in ours.index if is_swarm(v)]]
    printed = frame.loc[frame["variant"] == PAPER, "largest_median"]
    if printed.empty or swarms.empty:
        return ()
    paper, swarm = float(printed.iloc[0]), swarms.iloc[0]
    cheap = ours[ours["used"] <= QUARTER_OF_RUNS * swarm["used"]]
    best = cheap.loc[cheap["largest_median"].idxmin()] if len(cheap) else None
    own = evidence.of(setting)
    errors = own.loc[own["variant"] == swarm.name, "largest_error"].to_numpy(float)
    quarter, three_quarters = (float(np.quantile(errors, share, method="nearest")) for share in (0.25, 0.75))
    reproduced = quarter <= paper
    beaten = best is not None and best["largest_median"] < min(paper, swarm["largest_median"])
    words = {(True, True): "Yes, reproduced and beaten", (True, False): "Reproduced, not beaten",
             (False, True): "Beaten, but not reproduced by the paper's own method", (False, False): "No"}  # fmt: skip
    cost = "" if best is None else (f"; with at most a quarter of these, {best.name} is off by "
                                    f"{percent(best['largest_median'])} with {best['used']:,.0f}")  # fmt: skip
    return (f"{words[bool(reproduced), bool(beaten)]} ({setting}): the paper's printed values are off by "
            f"{percent(paper)} (largest error of a run, median), its own swarm here ({swarm.name}) by "
            f"{percent(swarm['largest_median'])} with {swarm['used']:,.0f} simulations (half of its runs by "
            f"{percent(quarter)} to {percent(three_quarters)}, 95 % by at most {percent(swarm['largest_p95'])})"
            f"{cost}.",)  # fmt: skip


def repeats(evidence: Evidence, _: DataFrame) -> tuple[str, ...]:
    """Return how well repeats agree on each record, and which parameters are off beyond their scatter."""
    runs = evidence.estimates.assign(signed=evidence.estimates["value"] / evidence.estimates["truth"] - 1.0)
    groups = runs.groupby(["setting", "variant", "case", "parameter"], sort=False)["signed"]
    within = groups.std(ddof=0).groupby(["setting", "variant"], sort=False).max()
    if within.empty or groups.size().max() < 2:
        return ()
    setting = noisy_first(evidence)[0]
    searches: Series[float] = within[within.index.get_level_values("setting") == setting].droplevel("setting")
    tight, wide = searches.idxmin(), searches.idxmax()
    own = runs[(runs["setting"] == setting) & (runs["variant"] == tight)].groupby("parameter", sort=False)["signed"]
    mean, scatter = own.mean(), own.std(ddof=0)
    off = [f"{name} by {percent(abs(mean[name]))}" for name in mean.index if abs(mean[name]) > OFF * scatter[name]]
    why = "since the model lacks an effect of these records"
    lacks = f"; off is {listed(off)}, {why}" if off else ""
    worst = f", to {percent(searches.max())} with {wide}" if wide != tight else ""
    return (f"Repeats on a record agree to {percent(searches.min())} with {tight}{worst} ({setting}; standard "
            f"deviation of the worst parameter){lacks}.",)  # fmt: skip


def by_fitness(evidence: Evidence, _: DataFrame) -> tuple[str, ...]:
    """Return, where identifiers ran on several fitnesses, which of these comes nearest to the truth at each noise.

    Of the identifiers that ran on the most fitnesses alone: others would compare identifiers, too.
    """
    several = evidence.runs.groupby("identifier")["fitness"].transform("nunique")
    runs = evidence.runs[several == several.max()]
    if several.max() < 2:
        return ()
    texts = []
    for setting in noisy_first(evidence)[:MOST_SETTINGS]:
        medians = runs[runs["setting"] == setting].groupby("fitness", sort=False)["largest_error"].median()
        ordered = medians.sort_values(kind="stable")
        texts.append(f"{setting}: {', '.join(f'{name} {percent(value)}' for name, value in ordered.items())}")
    return (f"Largest error of a run by fitness, median, the nearest to the truth first. {'; '.join(texts)}.",)


def best(evidence: Evidence, frame: DataFrame) -> tuple[str, ...]:
    """Return the best identifier of each setting, those that do not differ from it, and how many arrived."""
    known = frame[frame["variant"] != PAPER].dropna(subset="largest_median")
    settings = [s for s in noisy_first(evidence) if (known["setting"] == s).any()]
    texts = [best_at(evidence, known[known["setting"] == setting], setting) for setting in settings[:MOST_SETTINGS]]
    more = len(settings) - MOST_SETTINGS
    rest = f"; {counted(more, 'more setting')} below" if more > 0 else ""
    return (f"Best: {'; '.join(texts)}{rest}.",) if texts else ()


def best_at(evidence: Evidence, own: DataFrame, setting: str) -> str:
    tests, reached = evidence.once(compared, setting)
    ranked, rows = len(own) > 1 and tests.n_cases > 1, own.set_index("variant")
    name = str(tests.ranks.index[0] if ranked else rows["largest_median"].idxmin())
    row: Any = rows.loc[name]
    by = f" (mean rank {tests.ranks.iloc[0]:.3g} of {len(own)} over {counted(tests.n_cases, 'case')})" if ranked else ""
    text = (f"{setting}: {name}{by}, largest error of a run {percent(row['largest_median'])} (median), "
            f"{percent(row['largest_p95'])} (95 % of {row['n']} runs)")  # fmt: skip
    if not ranked:
        return text
    pairs = tests.pairs[(tests.pairs["first"] == name) | (tests.pairs["second"] == name)]
    named = zip(pairs["first"], pairs["second"], pairs["p_holm"], strict=True)
    text += alike_text([(str(a if b == name else b), p) for a, b, p in named], tests.n_cases)
    return f"{text}; {arrived_text(reached)}" if len(reached) else text


def own(evidence: Evidence, frame: DataFrame) -> tuple[str, ...]:
    """Return where the identifiers of plug-ins stand: by mean rank over the cases, on one case by their error."""
    texts = []
    for setting in noisy_first(evidence)[:MOST_SETTINGS]:
        rows = frame[(frame["setting"] == setting) & (frame["variant"] != PAPER)]
        medians, (tests, _) = rows.set_index("variant")["largest_median"], evidence.once(compared, setting)
        order = tests.ranks if len(rows) > 1 and tests.n_cases > 1 else medians
        mine = [v for v in order.sort_values(kind="stable").index if v in evidence.own and np.isfinite(medians[v])]
        texts += [f"{v} is number {1 + int((order < order[v]).sum())} of {len(order)} ({setting}, "
                 f"{percent(medians[v])})" for v in mine[:MOST_OWN]]  # fmt: skip
        texts += [f"{len(mine) - MOST_OWN} more in the table ({setting})"] if len(mine) > MOST_OWN else []
    runs = evidence.runs[evidence.runs["variant"].isin(evidence.own)]
    lost = runs[runs["status"] != "done"]
    if len(lost):
        error = " ".join(str(lost["error"].iloc[0]).split()).rstrip(".")
        texts.append(f"{len(lost)} of {len(runs)} runs failed, the first of {lost['variant'].iloc[0]}: {error}")
    return (f"Your own: {'; '.join(texts)}.",) if texts else ()


def undetermined(evidence: Evidence) -> tuple[str, ...]:
    """Return which parameters the records of a case do not determine: their errors say nothing of an identifier."""
    runs = evidence.parameters.merge(evidence.runs[["run", "case"]], on="run")
    unseen = runs["deviation"].astype(float).replace(np.inf, np.nan).isna()
    share = unseen.groupby([runs["case"], runs["parameter"]], sort=False).mean()
    names = [f"{parameter} of {case}" for case, parameter in share.index[share > HALF]]
    if not names:
        return ()
    return (f"Not determined by the records: {listed(names, MOST_OWN)}. Their errors, and the largest errors that they "
            "make, say nothing of an identifier.",)  # fmt: skip


def lowest_fitness(evidence: Evidence) -> str:
    done = evidence.runs[evidence.runs["status"] == "done"]
    if done.empty:
        return "No run has a result."
    medians = done.groupby(["fitness", "variant"], sort=False)["value"].median()
    scales = {f: evidence.scale_of_fitness(str(f)) for f in dict.fromkeys(done["fitness"])}
    texts = [f"{medians.loc[f].idxmin()}, {factor * medians.loc[f].min():.6g} of {f}{unit}"
            for f, (unit, factor) in scales.items()]  # fmt: skip
    return f"No truth is known. Lowest median fitness: {'; '.join(texts)}."


def percent(value: float) -> str:
    return "not finite" if not np.isfinite(value) else f"{100.0 * value:.3g} %"
