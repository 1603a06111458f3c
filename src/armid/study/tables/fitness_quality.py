"""Fitness functions side by side as a table."""

from pandas import DataFrame

from armid.study.metrics import fitness_quality as qualities
from armid.study.tables.table import Column, Table

COLUMNS = (
    Column("setting", "noise"), Column("fitness", "fitness"), Column("identifier", "identifier"),
    Column("n", "runs", ".0f"), Column("median_error", "largest error, median [%]", ".3g", 100.0),
    Column("worst_error", "worst [%]", ".3g", 100.0), Column("median_misfit", "1 - S reached, median", ".3g"),
    Column("correlation", "rank correlation", ".2f"),
)  # fmt: skip
WORDS = (
    "Which fitness gives right parameters: the largest relative error of a run, median and worst over cases and seeds "
    "(a failed run counts as infinite), beside 1 - S, the similarity degree that the result reached on the train "
    "records whatever was minimised (median). rank correlation: Spearman's, over the runs of the line, between 1 - S "
    "and the largest error; near 1 a higher similarity means better parameters, near 0 it says nothing about them."
)


def fitness_quality(found: DataFrame) -> Table:
    """Return one line a setting, fitness and identifier. found: outcomes of runs."""
    return Table("fitness", "Fitness against error", WORDS, qualities(found), COLUMNS)
