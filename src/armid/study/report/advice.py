"""The report of the proof of advice: one record more, advised against random."""

from pandas import DataFrame

from armid.study.figures import Figure
from armid.study.figures.loop_advice import advice_figure
from armid.study.loops.advice import advice_targets, rates
from armid.study.loops.targets import Target
from armid.study.report.report import Section
from armid.study.tables import Table
from armid.study.tables.loop_advice import advice_campaigns, advice_rates
from armid.study.tables.loop_targets import loop_targets

LIMIT = 0.80
TARGET_WORDS = "Shares with their 95 % Wilson interval; n: campaigns, each with an advised and with a random record."
FIGURE = (
    "Share of the campaigns in which the true effect of the pair stands alone after one record more, with its 95 % "
    "Wilson interval; the number of campaigns stands behind the pair."
)


def advice_parts(rows: DataFrame) -> tuple[list[Target], Table, tuple[Section, ...]]:
    """Return targets, the main table and all sections. rows: one a campaign, as `separations` gives them."""
    targets = advice_targets(rows)
    main = loop_targets(targets, TARGET_WORDS)
    found = rates(rows)
    drawn = (Figure("advice", "Advised and random records", FIGURE, lambda: advice_figure(found, LIMIT)),)
    tables = (advice_rates(rows), advice_campaigns(rows))
    return targets, main, (Section("Targets", "", (main,)), Section("Pairs", "", tables, drawn if len(found) else ()))
