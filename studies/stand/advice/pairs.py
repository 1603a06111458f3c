"""Which pairs of effects few strokes confuse, as the TOML file of the proof says."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stand.blind.suite import Kind, Suite, make_suite
from stand.refusal import RefusalError

MOST = 99


@dataclass(frozen=True)
class Pair:
    """Hold two effects, each once in some campaigns, and the strokes that leave them in doubt.

    `letter` begins the names of its campaigns.
    """

    letter: str
    kinds: tuple[Kind, Kind]
    strokes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, str]:
        """Give the names of both."""
        return (self.kinds[0].name, self.kinds[1].name)


@dataclass(frozen=True)
class Proof:
    """Hold the pairs, the ranges of all that is drawn, and how many campaigns each pair is tried on and told from."""

    suite: Suite
    pairs: tuple[Pair, ...]
    tried: int
    taken: int

    def pair(self, campaign: str) -> Pair:
        """Give the pair of a campaign."""
        return next(each for each in self.pairs if campaign.startswith(each.letter))


def read_proof(path: Path) -> Proof:
    """Read the [suite] table of a proof. Raises RefusalError with one sentence when that is none."""
    try:
        table = tomllib.loads(path.read_text())["suite"]
        proof = Proof(make_suite(table), _pairs(table["pairs"]), int(table["tried"]), int(table["taken"]))
    except OSError as error:
        raise RefusalError(f"{path} cannot be read: {error.strerror or error}") from error
    except KeyError as error:
        raise RefusalError(f"{path} lacks the key {error} that a proof of advice needs") from error
    except (tomllib.TOMLDecodeError, TypeError, ValueError) as error:
        raise RefusalError(f"{path} describes no proof of advice: {error}") from error
    if not 1 <= proof.taken <= proof.tried <= MOST:
        raise RefusalError(f"{path}: taken and tried must be whole numbers with 1 <= taken <= tried <= {MOST}")
    return proof


def _pairs(entries: Sequence[Mapping[str, Any]]) -> tuple[Pair, ...]:
    return tuple(
        Pair(letter, (_kind(entry["first"]), _kind(entry["second"])), tuple(entry["strokes"]))
        for letter, entry in zip("abcdefghijklmnopqrstuvwxyz", entries, strict=False)
    )


def _kind(entry: Mapping[str, Any]) -> Kind:
    return Kind(entry["name"], entry["port"], "the library's", (entry["size"],), signed=entry.get("signed", False))
