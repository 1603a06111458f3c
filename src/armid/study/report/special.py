"""Sections that only some studies have: Tables I and II, scatter against its bound, fitness functions side by side."""

from armid.study.figures import (
    Figure,
    cramer_rao_figure,
    fitness_quality_figure,
    table1_figure,
    table2_figure,
)
from armid.study.report.evidence import Evidence
from armid.study.report.report import Section
from armid.study.tables import (
    cramer_rao,
    cramer_rao_summary,
    fitness_quality,
    slug,
    table1,
    table1_all,
    table1_rows,
    table2,
    table2_records,
    unlike,
)

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


def table1_section(evidence: Evidence) -> Section | None:
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
    return Section(title, words, (*tables, table1_all(rows)), (figure,))


def table2_section(evidence: Evidence) -> Section | None:
    """Return Table II beside ours, where the study asks for it."""
    if evidence.study.get("report") != "table2" or evidence.estimates.empty:
        return None
    figure = Figure("table2", "Repeated identifications beside the paper's", TABLE2_WORDS,
                    lambda: table2_figure(evidence.estimates, evidence.published))  # fmt: skip
    tables = table2(evidence.estimates, evidence.published), table2_records(evidence.estimates)
    return Section("Table II of the paper beside ours", "", tables, (figure,))


def cramer_rao_section(evidence: Evidence) -> Section | None:
    """Return scatter against its bound, where there are enough noise realisations of known truths."""
    if evidence.estimates.empty:
        return None
    noisy = evidence.estimates[evidence.estimates["noise_deg_s"] > 0.0]
    table = cramer_rao(noisy)
    if table.frame.empty:
        return None
    figure = Figure("cramer_rao", "Scatter against the Cramer-Rao bound", CRAMER_RAO_WORDS,
                    lambda: cramer_rao_figure(table.frame))  # fmt: skip
    return Section("Scatter against the Cramer-Rao bound", "", (cramer_rao_summary(table.frame), table), (figure,))


def fitness_section(evidence: Evidence) -> Section | None:
    """Return fitness functions side by side, where several were run on known truths."""
    if evidence.found["fitness"].nunique() < 2 or not evidence.knows_truth:
        return None
    figure = Figure("fitness", "Error against the similarity reached", FITNESS_WORDS,
                    lambda: fitness_quality_figure(evidence.found))  # fmt: skip
    return Section("Which fitness gives right parameters", "", (fitness_quality(evidence.found),), (figure,))
