"""The campaigns of a suite, before anything of them is drawn."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from stand.blind.suite import Kind, Planted, Suite
from stand.effects import Effects
from stand.refusal import RefusalError

CLASSES = ("control", "single", "two", "unlisted", "one_stroke")
LARGEST = 2**32
"""Seeds of a suite lie below this, so that they fit any generator."""


@dataclass(frozen=True)
class Case:
    """Hold one campaign to be: its place in the whole suite, its class, what is planted, whether noise is coloured."""

    index: int
    label: str
    planted: tuple[Planted, ...]
    coloured: bool

    def effects(self) -> Effects:
        """Join the planted effects."""
        sizes: dict[str, float] = {}
        for each in self.planted:
            sizes |= each.sizes
        return Effects(**sizes)

    def chosen(self, words: Iterable[str]) -> bool:
        """Tell whether the class or an effect of the case is among some words."""
        return bool({self.label, *(each.kind.name for each in self.planted)} & set(words))


def cases_of(suite: Suite, seed: int) -> list[Case]:
    """List every campaign of a suite; the seed draws the signs of effects, and colours alternate."""
    if not 0 <= seed < LARGEST:
        raise RefusalError(f"the seed must be 0 or more and below 2^32, not {seed}")
    rng = np.random.default_rng([seed, 0])
    told: list[tuple[str, tuple[Planted, ...], bool]] = []
    told += [("control", (), bool(count % 2)) for count in range(suite.controls)]
    for kind in suite.effects:
        for strength in range(1, 1 + len(kind.sizes)):
            told += [("single", (_signed(kind, strength, rng),), coloured) for coloured in (False, True)]
    for count, names in enumerate(suite.pairs):
        kinds = [suite.kind(name) for name in names]
        told.append(("two", tuple(_signed(kind, len(kind.sizes), rng) for kind in kinds), bool(count % 2)))
    unlisted = [(kind, strength) for kind in suite.unlisted for strength in range(1, 1 + len(kind.sizes))]
    told += [("unlisted", (_signed(*each, rng),), bool(count % 2)) for count, each in enumerate(unlisted)]
    for count, name in enumerate(suite.one_stroke):
        kinds = [] if name == "none" else [suite.kind(name)]
        middle = tuple(_signed(kind, math.ceil(len(kind.sizes) / 2), rng) for kind in kinds)
        told.append(("one_stroke", middle, bool(count % 2)))
    return [Case(index, *each) for index, each in enumerate(told)]


def _signed(kind: Kind, strength: int, rng: np.random.Generator) -> Planted:
    """Plant an effect; a sign is drawn for each, so that a change to one effect leaves the draws of the others."""
    return kind.planted(strength, float(rng.choice((-1.0, 1.0))))


def shuffled(cases: list[Case], seed: int, only: Iterable[str] = ()) -> Mapping[str, Case]:
    """Name the cases c000, c001 ... in random order; `only` keeps those of some classes or effects.

    What a case draws depends on its place in the whole suite and not on this order. Raises RefusalError for a word
    that is no class and no effect.
    """
    words = tuple(only)
    for word in words:
        if not any(case.chosen((word,)) for case in cases):
            names = sorted({each.kind.name for case in cases for each in case.planted})
            raise RefusalError(f"the suite has no class or effect {word!r}, but {', '.join((*CLASSES, *names))}")
    kept = [case for case in cases if not words or case.chosen(words)]
    order = np.random.default_rng([seed, 1]).permutation(len(kept))
    return {f"c{count:03d}": kept[place] for count, place in enumerate(order)}
