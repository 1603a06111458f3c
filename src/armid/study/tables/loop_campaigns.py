"""Campaigns one by one: what is true, what was said."""

from pandas import DataFrame

from armid.study.tables.table import Column, Table


def said_lines(rows: DataFrame, name: str, title: str, words: str) -> Table:
    """Return one line a campaign; its files hold every number that was judged."""
    columns = (
        Column("campaign", "campaign"), Column("truth", "truth"), Column("strength", "strength"),
        Column("noise", "noise"), Column("verdict", "verdict"), Column("named", "said"),
        Column("judgement", "judgement"), Column("before_over_floor", "error/noise before", ".3g"),
        Column("after_over_floor", "after", ".3g"),
    )  # fmt: skip
    return Table(name, title, words, rows.sort_values(["truth", "campaign"], ignore_index=True), columns)


def all_campaigns(rows: DataFrame) -> Table:
    """Return every campaign and number, as a file alone."""
    words = "Every campaign with all that was judged of it."
    return Table("campaigns", "All campaigns", words, rows, (Column("campaign", "campaign"),), most=0)
