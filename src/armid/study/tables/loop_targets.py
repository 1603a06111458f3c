"""What was aimed at, what came of it, and whether that is enough."""

from collections.abc import Sequence

import numpy as np
from pandas import DataFrame

from armid.study.loops.targets import Target
from armid.study.metrics import wilson
from armid.study.tables.table import Column, Table

WORDS = (
    "Shares with their 95 % Wilson interval; `n` counts campaigns (of a bias: values). A group holds the truth when it "
    "has at most 4 effects, one of them true. An aim that no campaign tells of is neither met nor missed."
)


def loop_targets(targets: Sequence[Target], words: str = WORDS) -> Table:
    """Return one line an aim."""
    frame = DataFrame(
        [
            {
                "topic": t.topic, "question": t.question, "measured": measured(t), "target": aim(t), "n": t.n,
                "result": {True: "met", False: "missed", None: ""}[t.met], "found": t.found, "limit": t.limit,
            }
            for t in targets
        ]
    )  # fmt: skip
    columns = (
        Column("topic", "about"), Column("question", "question"), Column("measured", "measured"),
        Column("target", "target"), Column("n", "n", ".0f"), Column("result", "result"),
    )  # fmt: skip
    return Table("targets", "Targets", words, frame, columns)


def measured(target: Target) -> str:
    """Return what was found, in words."""
    if not np.isfinite(target.found):
        return ""
    text = amount(target.found, target.kind)
    if target.is_counted:
        low, high = wilson(round(target.found * target.n), target.n)
        return f"{text} ({100 * low:.1f} to {100 * high:.1f} %)"
    return text


def aim(target: Target) -> str:
    """Return the limit, in words."""
    word = "below" if target.at_most else "above"
    if not target.is_strict:
        word = "at most" if target.at_most else "at least"
    return f"{word} {amount(target.limit, target.kind)}"


def amount(value: float, kind: str) -> str:
    """Return a number with its unit."""
    if kind == "share":
        return f"{100 * value:.3g} %"
    return f"{value:.3g}" if kind in ("ratio", "count") else f"{value:.3g} {kind}"
