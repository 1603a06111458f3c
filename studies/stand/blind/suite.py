"""What a blind suite consists of, as its TOML file says, and its campaigns before anything of them is drawn."""

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from stand import RefusalError
from stand.effects import Effects

Sizes = Mapping[str, float]
T = TypeVar("T")


@dataclass(frozen=True)
class Kind:
    """Hold one effect in one form: its name in a library, its port, and its sizes as the stand's own effects.

    `matching` tells whether the form is what a library would fit, `signed` whether a campaign draws the sign, `listed`
    whether a library can have the name at all.
    """

    name: str
    port: str
    form: str
    sizes: tuple[Sizes, ...]
    matching: bool = True
    signed: bool = False
    listed: bool = True

    def planted(self, strength: int, sign: float = 1.0) -> "Planted":
        """Give the effect at one of its sizes, counted from 1."""
        size = self.sizes[strength - 1]
        return Planted(self, strength, {name: sign * value for name, value in size.items()} if self.signed else size)


@dataclass(frozen=True)
class Planted:
    """Hold an effect as it is in a campaign: its kind, which of the sizes from 1, and the numbers."""

    kind: Kind
    strength: int
    sizes: Sizes


@dataclass(frozen=True)
class Suite:
    """Hold the settings of a suite: what is planted, and the ranges of all that is drawn (SI; noise in deg/s)."""

    effects: tuple[Kind, ...]
    unlisted: tuple[Kind, ...]
    pairs: tuple[tuple[str, str], ...]
    one_stroke: tuple[str, ...]
    controls: int
    ranges: Mapping[str, tuple[float, float]]
    margin: float
    bandwidth_hz: float
    noise_deg_s: tuple[float, float]
    duration_s: tuple[float, float]
    rest_s: float

    def kind(self, name: str) -> Kind:
        """Give the first form of a listed effect. Raises RefusalError when there is none."""
        for each in self.effects:
            if each.name == name:
                return each
        raise RefusalError(f"the suite names the effect {name!r}, which is none of its [[suite.effects]]")


def read_suite(path: Path) -> Suite:
    """Read the [suite] table of a TOML file. Raises RefusalError with one sentence when that is none."""
    return made_of_table(path, make_suite, "suite")


def made_of_table(path: Path, make: Callable[[Mapping[str, Any]], T], what: str) -> T:
    """Make something of the [suite] table of a TOML file. Raises RefusalError with one sentence when that cannot be."""
    try:
        return make(tomllib.loads(path.read_text())["suite"])
    except OSError as error:
        raise RefusalError(f"{path} cannot be read: {error.strerror or error}") from error
    except KeyError as error:
        raise RefusalError(f"{path} lacks the key {error} that a {what} needs") from error
    except (tomllib.TOMLDecodeError, TypeError, ValueError) as error:
        raise RefusalError(f"{path} describes no {what}: {error}") from error


def make_suite(table: Mapping[str, Any]) -> Suite:
    return Suite(
        effects=tuple(kind_of(each) for each in table.get("effects", [])),
        unlisted=tuple(kind_of(each, False) for each in table.get("unlisted", [])),
        pairs=tuple((first, second) for first, second in table.get("two", {}).get("pairs", [])),
        one_stroke=tuple(table.get("one_stroke", {}).get("effects", [])),
        controls=int(table.get("controls", 0)),
        ranges={name: _range(edges) for name, edges in table["ranges"].items()},
        margin=float(table["margin"]),
        bandwidth_hz=float(table["bandwidth_hz"]),
        noise_deg_s=_range(table["noise_deg_s"]),
        duration_s=_range(table["duration_s"]),
        rest_s=float(table["rest_s"]),
    )


def kind_of(entry: Mapping[str, Any], listed: bool = True) -> Kind:
    """Read one effect and let the stand refuse sizes that mean nothing to it."""
    sizes = tuple({**entry.get("shape", {}), **size} for size in entry["sizes"])
    for size in sizes:
        Effects(**size)
    told = {name: entry[name] for name in ("matching", "signed") if name in entry}
    return Kind(entry["name"], entry["port"], entry["form"], sizes, listed=listed, **told)


def _range(edges: Any) -> tuple[float, float]:
    low, high = map(float, edges)
    return low, high


CLASSES = ("control", "single", "two", "unlisted", "one_stroke")


@dataclass(frozen=True)
class Case:
    """Hold one campaign to be: its place in the whole suite, its class, what is planted, whether noise is coloured."""

    index: int
    label: str
    planted: tuple[Planted, ...]
    coloured: bool

    def effects(self) -> Effects:
        return Effects(**{name: size for each in self.planted for name, size in each.sizes.items()})

    def chosen(self, words: Iterable[str]) -> bool:
        """Tell whether the class or an effect of the case is among some words."""
        return bool({self.label, *(each.kind.name for each in self.planted)} & set(words))


def cases_of(suite: Suite, seed: int) -> list[Case]:
    """List every campaign of a suite; the seed draws the signs of effects, and colours alternate."""
    rng = np.random.default_rng([seed, 0])
    told: list[tuple[str, tuple[Planted, ...], bool]] = []
    told += [("control", (), bool(count % 2)) for count in range(suite.controls)]
    for kind in suite.effects:
        for strength in range(1, 1 + len(kind.sizes)):
            told += [("single", (signed(kind, strength, rng),), coloured) for coloured in (False, True)]
    for count, names in enumerate(suite.pairs):
        kinds = [suite.kind(name) for name in names]
        told.append(("two", tuple(signed(kind, len(kind.sizes), rng) for kind in kinds), bool(count % 2)))
    unlisted = [(kind, strength) for kind in suite.unlisted for strength in range(1, 1 + len(kind.sizes))]
    told += [("unlisted", (signed(*each, rng),), bool(count % 2)) for count, each in enumerate(unlisted)]
    for count, name in enumerate(suite.one_stroke):
        kinds = [] if name == "none" else [suite.kind(name)]
        middle = tuple(signed(kind, math.ceil(len(kind.sizes) / 2), rng) for kind in kinds)
        told.append(("one_stroke", middle, bool(count % 2)))
    return [Case(index, *each) for index, each in enumerate(told)]


def signed(kind: Kind, strength: int, rng: np.random.Generator) -> Planted:
    """Plant an effect; a sign is drawn for each, so that a change to one effect leaves the draws of the others."""
    return kind.planted(strength, float(rng.choice((-1.0, 1.0))))


def shuffled(cases: list[Case], seed: int, only: Iterable[str] = ()) -> Mapping[str, Case]:
    """Name the cases c000, c001 ... in random order; `only` keeps those of some classes or effects.

    What a case draws depends on its place in the whole suite and not on this order. Raises RefusalError for a word
    that is not a class and no effect.
    """
    words = tuple(only)
    for word in words:
        if not any(case.chosen((word,)) for case in cases):
            names = sorted({each.kind.name for case in cases for each in case.planted})
            raise RefusalError(f"the suite has no class or effect {word!r}, but {', '.join((*CLASSES, *names))}")
    kept = [case for case in cases if not words or case.chosen(words)]
    order = np.random.default_rng([seed, 1]).permutation(len(kept))
    return {f"c{count:03d}": kept[place] for count, place in enumerate(order)}
