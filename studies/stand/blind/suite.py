"""What a blind suite consists of, as its TOML file says."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stand.effects import Effects
from stand.refusal import RefusalError

Sizes = Mapping[str, float]


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
    try:
        table = tomllib.loads(path.read_text())["suite"]
        return make_suite(table)
    except OSError as error:
        raise RefusalError(f"{path} cannot be read: {error.strerror or error}") from error
    except KeyError as error:
        raise RefusalError(f"{path} lacks the key {error} that a suite needs") from error
    except (tomllib.TOMLDecodeError, TypeError, ValueError) as error:
        raise RefusalError(f"{path} describes no suite: {error}") from error


def make_suite(table: Mapping[str, Any]) -> Suite:
    """Give the settings that a [suite] table holds."""
    return Suite(
        effects=tuple(_kind(each, True) for each in table.get("effects", [])),
        unlisted=tuple(_kind(each, False) for each in table.get("unlisted", [])),
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


def _kind(entry: Mapping[str, Any], listed: bool) -> Kind:
    """Read one effect and let the stand refuse sizes that mean nothing to it."""
    sizes = tuple({**entry.get("shape", {}), **size} for size in entry["sizes"])
    for size in sizes:
        Effects(**size)
    told = {name: entry[name] for name in ("matching", "signed") if name in entry}
    return Kind(entry["name"], entry["port"], entry["form"], sizes, listed=listed, **told)


def _range(edges: Any) -> tuple[float, float]:
    low, high = map(float, edges)
    return low, high
