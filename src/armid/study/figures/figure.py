"""A figure of a report: what it is called, what it shows, and how it is drawn."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class Figure:
    """Hold one figure.

    name: of its files; title; words: what it shows and how each mark was computed; draw: returns it as matplotlib's.
    """

    name: str
    title: str
    words: str
    draw: Callable[[], Any]
