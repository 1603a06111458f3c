"""The answer to the question of a study that identifies, a sentence for its kind."""

from typing import Any

import numpy as np
from pandas import DataFrame, Series

from armid.report.document import listed
from armid.study.analyses.analysis import PAPER, Evidence, fitness_scale, is_swarm
from armid.study.analyses.ranks import HALF, alike_text, arrived_text, compared, suite_answer

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
            f"{percent(quarter)} to {percent(three_quarters)}){cost}.",)  # fmt: skip


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
    why = "since the model lacks an effect of these records, or their truth is another"
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
    said = []
    for setting in noisy_first(evidence)[:MOST_SETTINGS]:
        medians = runs[runs["setting"] == setting].groupby("fitness", sort=False)["largest_error"].median()
        ordered = medians.sort_values(kind="stable")
        said.append(f"{setting}: {', '.join(f'{name} {percent(value)}' for name, value in ordered.items())}")
    return (f"Largest error of a run by fitness, median, the nearest to the truth first. {'; '.join(said)}.",)


def best(evidence: Evidence, frame: DataFrame) -> tuple[str, ...]:
    """Return the best identifier of each setting, those that do not differ from it, and how many arrived."""
    known = frame[frame["variant"] != PAPER].dropna(subset="largest_median")
    settings = [s for s in noisy_first(evidence) if (known["setting"] == s).any()]
    said = [best_at(evidence, known[known["setting"] == setting], setting) for setting in settings[:MOST_SETTINGS]]
    more = len(settings) - MOST_SETTINGS
    rest = f"; {more} more setting{'s' if more > 1 else ''} below" if more > 0 else ""
    return (f"Best: {'; '.join(said)}{rest}.",) if said else ()


def best_at(evidence: Evidence, own: DataFrame, setting: str) -> str:
    tests, reached = evidence.once(compared, setting)
    ranked, rows = len(own) > 1 and tests.n_cases > 1, own.set_index("variant")
    name = str(tests.ranks.index[0] if ranked else rows["largest_median"].idxmin())
    row: Any = rows.loc[name]
    by = f" (mean rank {tests.ranks.iloc[0]:.3g} of {len(own)} over {tests.n_cases} cases)" if ranked else ""
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
    said = []
    for setting in noisy_first(evidence)[:MOST_SETTINGS]:
        rows = frame[(frame["setting"] == setting) & (frame["variant"] != PAPER)]
        medians, (tests, _) = rows.set_index("variant")["largest_median"], evidence.once(compared, setting)
        order = tests.ranks if len(rows) > 1 and tests.n_cases > 1 else medians
        mine = [v for v in order.sort_values(kind="stable").index if v in evidence.own and np.isfinite(medians[v])]
        said += [f"{v} is number {1 + int((order < order[v]).sum())} of {len(order)} ({setting}, "
                 f"{percent(medians[v])})" for v in mine[:MOST_OWN]]  # fmt: skip
        said += [f"{len(mine) - MOST_OWN} more in the table ({setting})"] if len(mine) > MOST_OWN else []
    return (f"Your own: {'; '.join(said)}.",) if said else ()


def undetermined(evidence: Evidence) -> tuple[str, ...]:
    """Return which parameters the records of a case do not determine: their errors say nothing of an identifier."""
    runs = evidence.parameters.merge(evidence.runs[["run", "case"]], on="run")
    unseen = runs["deviation"].astype(float).replace(np.inf, np.nan).isna()
    share = unseen.groupby([runs["case"], runs["parameter"]], sort=False).mean()
    names = [f"{parameter} of {case}" for case, parameter in share.index[share > HALF]]
    if not names:
        return ()
    return (f"Not determined by the records: {listed(names[:MOST_OWN])}"
            f"{f' and {len(names) - MOST_OWN} more' if len(names) > MOST_OWN else ''}. Their errors, and the largest "
            "errors that these make, say nothing of an identifier.",)  # fmt: skip


def lowest_fitness(evidence: Evidence) -> str:
    done = evidence.runs[evidence.runs["status"] == "done"]
    if done.empty:
        return "No run has a result."
    medians = done.groupby(["fitness", "variant"], sort=False)["value"].median()
    scales = {f: fitness_scale(str(f), evidence.unit) for f in dict.fromkeys(done["fitness"])}
    said = [f"{medians.loc[f].idxmin()}, {factor * medians.loc[f].min():.6g} of {f}{unit}"
            for f, (unit, factor) in scales.items()]  # fmt: skip
    return f"No truth is known. Lowest median fitness: {'; '.join(said)}."


def percent(value: float) -> str:
    return "not finite" if not np.isfinite(value) else f"{100.0 * value:.3g} %"
