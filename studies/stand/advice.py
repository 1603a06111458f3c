"""The proof of advice: few strokes that leave two effects in doubt, then one record more, advised or random."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import numpy as np

from stand import RefusalError
from stand.arm import TRAVEL_DEG, Manoeuvre
from stand.blind.campaign import campaign_files, entry_of, measure_strokes
from stand.blind.draw import Drawn, draw, run, six_strokes
from stand.blind.many import Entry, key_path, make_as_told, suite_parser, write_campaigns
from stand.blind.suite import Case, Kind, Suite, kind_of, made_of_table, make_suite
from stand.gyro import Record
from stand.motion import Motion
from stand.score.judge import read_json

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
        return (self.kinds[0].name, self.kinds[1].name)


@dataclass(frozen=True)
class Proof:
    """Hold the pairs, the ranges of all that is drawn, and how many campaigns each pair is tried on and told from."""

    suite: Suite
    pairs: tuple[Pair, ...]
    tried: int
    taken: int


def read_proof(path: Path) -> Proof:
    """Read the [suite] table of a proof. Raises RefusalError with one sentence when that is none."""

    def make(table: Mapping[str, Any]) -> Proof:
        pairs = []
        for letter, entry in zip(ascii_lowercase, table["pairs"], strict=False):
            both = (entry["first"], entry["second"])
            first, second = (kind_of({"form": "the library's", "sizes": [each["size"]], **each}) for each in both)
            pairs.append(Pair(letter, (first, second), tuple(entry["strokes"])))
        return Proof(make_suite(table), tuple(pairs), int(table["tried"]), int(table["taken"]))

    proof = made_of_table(path, make, "proof of advice")
    if not 1 <= proof.taken <= proof.tried <= MOST:
        raise RefusalError(f"{path}: taken and tried must be whole numbers with 1 <= taken <= tried <= {MOST}")
    return proof


@dataclass(frozen=True)
class First:
    """Hold a campaign to be: its pair, and which one of its seeds from 1."""

    pair: Pair
    place: int
    seed: int

    @property
    def name(self) -> str:
        return f"{self.pair.letter}{self.place:02d}"

    @property
    def key(self) -> tuple[int, int, int]:
        """Give what all its draws are seeded with."""
        return (self.seed, ord(self.pair.letter), self.place)

    def case(self) -> Case:
        """Plant the one effect and the other in turn; noise is white, since coloured noise asks for larger effects."""
        kind = self.pair.kinds[self.place % 2]
        sign = 1.0 if np.random.default_rng([*self.key, 0]).random() < 0.5 else -1.0
        return Case(self.place, "single", (kind.planted(1, sign),), coloured=False)


def started(proof: Proof, first: First) -> tuple[Drawn, list[Record], Entry]:
    """Draw and measure a campaign of few strokes, the same one each time; give its entry in the key as well."""

    def strokes(rng: np.random.Generator) -> Any:
        return tuple((manoeuvre, "train") for manoeuvre, _ in six_strokes(rng) if manoeuvre.name in first.pair.strokes)

    case = first.case()
    drawn = draw(proof.suite, case, np.random.default_rng([*first.key, 1]), strokes)
    records = measure_strokes(proof.suite, drawn, case.effects(), np.random.default_rng([*first.key, 2]))
    entry = entry_of(case, drawn, records) | {"class": "pair", "pair": list(first.pair.names), "place": first.place}
    return drawn, records, entry


def make_first(proof: Proof, first: First) -> tuple[dict[str, str], Entry]:
    """Make the files of a campaign, which tell nothing of its truth, and its entry in the key."""
    drawn, records, entry = started(proof, first)
    return campaign_files(first.name, drawn.gyro, records), entry


CHOICES = ("advised", "random")
TRIES = 200
APART_DEG, SUPPLY = 15.0, (24.0, 28.0)
Advice = Sequence[Mapping[str, Any]]
"""What a report advises, the best first, each with its manoeuvre and the power that is promised."""


def make_second(
    proof: Proof, counts: Mapping[str, int], named: tuple[First, Advice, str]
) -> tuple[dict[str, str], Entry]:
    """Make a campaign with one record more, and its entry in the key; the noise of both choices is the same.

    `counts` are the campaigns in doubt, by the letter of their pair. `rank` tells which of the manoeuvres the arm could
    make, counted from 1, and is None where it could make none of them: then the campaign is the first one again.
    """
    first, asked, choice = named
    (drawn, records, entry), effects = started(proof, first), first.case().effects()
    found = added = None
    for rank, manoeuvre in _advised(asked) if choice == "advised" else _random(first):
        trajectory = run(Motion(drawn.arm, manoeuvre, effects), drawn.duration_s, must_close=False)
        if trajectory:
            found, added = rank, manoeuvre.told()
            more = replace(drawn, strokes=((manoeuvre, "train"),), trajectories=(trajectory,))
            records += measure_strokes(proof.suite, more, effects, np.random.default_rng([*first.key, 3]))
            break
    entry |= {
        "choice": choice, "base": first.name, "rank": found, "power": asked[0]["power"], "next": added,
        "tried": proof.tried, "in_doubt": counts[first.pair.letter],
    }  # fmt: skip
    return campaign_files(f"{first.name}_{choice}", drawn.gyro, records), entry


def _advised(asked: Advice) -> Iterator[tuple[int, Manoeuvre]]:
    for rank, each in enumerate(asked, 1):
        keys = each["manoeuvre"]
        told = (float(keys["start_angle_deg"]), float(keys["target_angle_deg"]), bool(keys["shell"]))
        yield rank, Manoeuvre("next", *told, float(keys["supply_V"]))


def _random(first: First) -> Iterator[tuple[int, Manoeuvre]]:
    """Draw manoeuvres over the travel, both loads and the supply."""
    rng = np.random.default_rng([*first.key, 4])
    for rank in range(1, 1 + TRIES):
        start, target = (round(float(angle), 1) for angle in rng.uniform(*TRAVEL_DEG, 2))
        shell, supply = bool(rng.random() < 0.5), round(float(rng.uniform(*SUPPLY)), 1)
        if abs(target - start) >= APART_DEG:
            yield rank, Manoeuvre("next", start, target, shell, supply)


PROOF = Path(__file__).parents[1] / "advice.toml"


def make_base(words: Sequence[str]) -> int:
    """Make campaigns of few strokes as the command line says; give the exit code."""
    said = "Make campaigns of few strokes, each with one effect of a pair."
    return make_as_told(_make_base, words, suite_parser("test_stand.py advice", said, PROOF))


def make_more(words: Sequence[str]) -> int:
    """Add the advised record, and a random one, as the command line says; give the exit code."""
    said = "Add the record that was advised to campaigns in doubt, and a random one in its place."
    parser = suite_parser("test_stand.py advised", said, PROOF)
    parser.add_argument("--base", type=Path, required=True, help="the campaigns that `advice` made")
    parser.add_argument("--reports", type=Path, required=True, help="holds CAMPAIGN/report.json for each of them")
    return make_as_told(_make_more, words, parser)


def _make_base(options: argparse.Namespace) -> str:
    proof = read_proof(options.suite)
    firsts = {each.name: each for each in _firsts(proof, options.seed)}
    write_campaigns(options, firsts, partial(make_first, proof))
    return f"{options.folder}: {len(firsts)} campaigns of few strokes, SYNTHETIC; key: {key_path(options.folder)}"


def _firsts(proof: Proof, seed: int) -> list[First]:
    return [First(pair, place, seed) for pair in proof.pairs for place in range(1, 1 + proof.tried)]


def _make_more(options: argparse.Namespace) -> str:
    proof = read_proof(options.suite)
    key = read_json(key_path(options.base))
    if key["seed"] != options.seed:
        raise RefusalError(f"{options.base} was made with seed {key['seed']}, not {options.seed}")
    doubts: dict[str, list[tuple[First, Advice]]] = {pair.letter: [] for pair in proof.pairs}
    for first in _firsts(proof, options.seed):
        report, pair = read_json(options.reports / first.name / "report.json"), {*first.pair.names}
        told = report["advice"] if report["verdict"] == "cannot_tell_apart" else []
        asked = [each for each in told if pair <= {*each["separates"]}]
        if asked:
            doubts[first.pair.letter].append((first, asked))
    named = {
        f"{first.name}_{choice}": (first, asked, choice)
        for some in doubts.values() for first, asked in some[: proof.taken] for choice in CHOICES
    }  # fmt: skip
    counts = {letter: len(some) for letter, some in doubts.items()}
    write_campaigns(options, named, partial(make_second, proof, counts))
    doubted = ", ".join(f"{' and '.join(p.names)} {counts[p.letter]} of {proof.tried}" for p in proof.pairs)
    return f"{options.folder}: {len(named)} campaigns with one record more, SYNTHETIC; in doubt were {doubted}"
