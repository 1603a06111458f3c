"""The shape of the TOML file of a study that closes the loop: which keys there are and of what kind."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from armid.record.kinds import any_table, list_of, table_of, text
from armid.record.schema import key
from armid.study.sheet import BOUNDS, NUMBERS, any_text, line_of_text, plain_name, whole_number

REPORTS = ("", "blind", "advice")


@dataclass(frozen=True, kw_only=True)
class LoopSheet:
    """Declare a study that closes the loop on every campaign of a folder.

    campaigns: folder of campaigns, relative to the study's file. made_by: the command that makes it, for people. key:
    file that holds the truth, which the report alone opens. only: patterns of names of campaigns. candidates: effects
    to look for, empty: all; without: those that are left out. rivals: patterns of names of campaigns -> the effects
    that are looked for there, in place of the candidates. suite: what the campaigns are made of, for who makes them;
    the study does not read it.
    """

    name: str = field(metadata=key(plain_name, "a plain name of letters, digits, '_', '-' and '.'"))
    campaigns: str = field(metadata=key(line_of_text, "a folder of campaigns, relative to this file"))
    kind: str = field(default="close_loop", metadata=key(text, "the kind of a study"))
    question: str = field(default="", metadata=key(any_text, "a text"))
    report: str = field(default="", metadata=key(any_text, f"one of {', '.join(map(repr, REPORTS))}"))
    made_by: str = field(default="", metadata=key(line_of_text, "the command that makes the campaigns"))
    only: tuple[str, ...] = field(default=("*",), metadata=key(list_of(text, 1), "a list of names of campaigns"))
    candidates: tuple[str, ...] = field(default=(), metadata=key(list_of(text, 1), "a list of names of effects"))
    without: tuple[str, ...] = field(default=(), metadata=key(list_of(text, 1), "a list of names of effects"))
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict, metadata=BOUNDS)
    fixed: Mapping[str, float] = field(default_factory=dict, metadata=NUMBERS)
    seed: int = field(default=1, metadata=key(whole_number, "a whole number of at least 0"))
    rivals: Mapping[str, tuple[str, ...]] = field(
        default_factory=dict, metadata=key(table_of(list_of(text, 1)), "lists of effects by names of campaigns")
    )
    suite: Mapping[str, Any] = field(default_factory=dict, metadata=key(any_table, "a table"))
    # last: from here on the name stands for this field
    key: str = field(default="", metadata=key(line_of_text, "the file that holds the truth, relative to this file"))
