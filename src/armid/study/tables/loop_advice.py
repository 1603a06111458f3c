"""How often one record more told two effects apart, advised or random."""

from pandas import DataFrame

from armid.study.loops.advice import rates
from armid.study.tables.table import Column, Table

PERCENT = (".1f", 100.0)


def advice_rates(rows: DataFrame) -> Table:
    """Return one line a pair."""
    columns = (
        Column("pair", "pair"), Column("tried", "tried", ".0f"), Column("in_doubt", "in doubt", ".0f"),
        Column("n", "taken", ".0f"), Column("advised", "advised [%]", *PERCENT),
        Column("advised_low", "low [%]", *PERCENT), Column("advised_high", "high [%]", *PERCENT),
        Column("advised_wrong", "wrong one", ".0f"), Column("power", "promised [%]", *PERCENT),
        Column("random", "random [%]", *PERCENT), Column("random_low", "low [%]", *PERCENT),
        Column("random_high", "high [%]", *PERCENT), Column("random_wrong", "wrong one", ".0f"),
        Column("p", "p", ".2g"),
    )  # fmt: skip
    words = (
        "Campaigns of few strokes that left the pair in doubt, the first so many of those tried; one record more each, "
        "advised by the loop, or random among those that the arm can make; share in which the true effect stands alone "
        "after the loop was closed again, with its 95 % Wilson interval. Wrong one: the other effect stands alone. "
        "Promised: mean power that the advice told. p: chance of so great a lead where neither is better (exact sign "
        "test over campaigns on which only one of both told the pair apart)."
    )
    frame = rates(rows)
    return Table("advice", "Told apart by one record more", words, frame.reindex(columns=[c.key for c in columns]),
                 columns)  # fmt: skip


def advice_campaigns(rows: DataFrame) -> Table:
    """Return every campaign."""
    columns = tuple(Column(key, key) for key in ("campaign", "pair", "truth", "noise", "next", "said", "answer"))
    return Table("campaigns", "Campaigns", "Every campaign with its last record and what was said then.", rows, columns)
