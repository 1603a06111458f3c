"""The proof of advice: few strokes that leave two effects in doubt, then one record more, advised or random."""

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from stand import RefusalError
from stand.arm import TRAVEL_DEG, Manoeuvre
from stand.blind.campaign import (
    Measured,
    campaign_text,
    key_path,
    make_as_told,
    measure_stroke,
    suite_parser,
    write_campaigns,
)
from stand.blind.draw import FASTEST, TOLERANCE, Drawn, Strokes, draw, six_strokes
from stand.blind.suite import Case, Kind, Planted, Suite, made_of_table, make_suite
from stand.campaign import record_text
from stand.motion import SAMPLES_PER_SECOND, Motion, Trajectory, simulate
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

    def make(table: Mapping[str, Any]) -> Proof:
        return Proof(make_suite(table), _pairs(table["pairs"]), int(table["tried"]), int(table["taken"]))

    proof = made_of_table(path, make, "proof of advice")
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


Entry = dict[str, Any]


@dataclass(frozen=True)
class First:
    """Hold a campaign to be: its pair, and which one of its seeds from 1."""

    pair: Pair
    place: int
    seed: int

    @property
    def name(self) -> str:
        """Give the name of the campaign."""
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


def drawn_of(proof: Proof, first: First) -> Drawn:
    """Draw arm, manoeuvres and noise of a campaign, the same ones each time."""
    return draw(proof.suite, first.case(), np.random.default_rng([*first.key, 1]), _chosen(first.pair))


def _chosen(pair: Pair) -> Strokes:
    """Give what draws the strokes of a pair, all of them to train on."""

    def strokes(rng: np.random.Generator) -> Any:
        return tuple((manoeuvre, "train") for manoeuvre, _ in six_strokes(rng) if manoeuvre.name in pair.strokes)

    return strokes


def make_first(proof: Proof, first: First) -> tuple[dict[str, bytes], Entry]:
    """Make the files of a campaign, which tell nothing of its truth, and its entry in the key."""
    drawn, rng = drawn_of(proof, first), np.random.default_rng([*first.key, 2])
    rest = round(proof.suite.rest_s * SAMPLES_PER_SECOND)
    effects = first.case().effects()
    measured = [measure_stroke(drawn, place, effects, rest, rng) for place in range(len(drawn.strokes))]
    return files_of(first.name, drawn, measured), entry_of(first, drawn)


def files_of(name: str, drawn: Drawn, measured: list[Measured]) -> dict[str, bytes]:
    """Write the records of a campaign and its campaign.toml."""
    texts = {each.record.file: record_text(each.record, drawn.gyro.decimals) for each in measured}
    texts["campaign.toml"] = campaign_text(name, drawn, measured)
    return {file: text.encode() for file, text in texts.items()}


def entry_of(first: First, drawn: Drawn) -> Entry:
    """Give the truth of a campaign."""
    (planted,), gyro = first.case().planted, drawn.gyro
    return {
        "class": "pair",
        "pair": list(first.pair.names),
        "place": first.place,
        "parameters": {name: getattr(drawn.arm, name) for name in ("p0", "k", "eta3", "n")},
        "effects": [_planted_entry(planted)],
        "noise": {"kind": "coloured" if gyro.noise_bandwidth_hz else "white", "rms_deg_s": gyro.noise_deg_s},
        "floor": {"train": None, "holdout": None},
        "declared_fit": None,
    }


def _planted_entry(planted: Planted) -> Entry:
    kind = planted.kind
    return {
        "name": kind.name,
        "port": kind.port,
        "form": kind.form,
        "matching": True,
        "listed": True,
        "strength": 1,
        "sizes": dict(planted.sizes),
    }


CHOICES = ("advised", "random")
TRIES = 200
APART_DEG, SUPPLY = 15.0, (24.0, 28.0)


@dataclass(frozen=True)
class Asked:
    """Hold what was advised: manoeuvres, the best first, each with the power that was promised."""

    manoeuvres: Sequence[Mapping[str, Any]]
    powers: Sequence[float]


def asked_in(report: Mapping[str, Any], pair: Sequence[str]) -> Asked | None:
    """Give what a report advises to tell a pair apart; None where it is not in doubt about it."""
    advice = [each for each in report["advice"] if set(pair) <= set(each["separates"])]
    if report["verdict"] != "cannot_tell_apart" or not advice:
        return None
    return Asked([each["manoeuvre"] for each in advice], [each["power"] for each in advice])


def make_second(proof: Proof, first: First, asked: Asked, choice: str) -> tuple[dict[str, bytes], Entry]:
    """Make a campaign with one record more, and its entry in the key; the noise of both choices is the same.

    `rank` tells which advice the arm could make, counted from 1, and is None where it could make none of them: then
    the campaign is the first one again.
    """
    drawn, effects = drawn_of(proof, first), first.case().effects()
    found = _advised(drawn, first, asked) if choice == "advised" else _random(drawn, first)
    longer = _with(drawn, found) if found else drawn
    rest = round(proof.suite.rest_s * SAMPLES_PER_SECOND)
    streams = [np.random.default_rng([*first.key, 2]), np.random.default_rng([*first.key, 3])]
    measured = [
        measure_stroke(longer, place, effects, rest, streams[place >= len(drawn.strokes)])
        for place in range(len(longer.strokes))
    ]
    name = f"{first.name}_{choice}"
    told = {"choice": choice, "base": first.name, "rank": found.rank if found else None, "power": asked.powers[0]}
    return files_of(name, longer, measured), entry_of(first, drawn) | told | {"next": found.told if found else None}


@dataclass(frozen=True)
class _Found:
    """Hold a manoeuvre that the arm can make, its trajectory, and which of those it was that were looked at."""

    manoeuvre: Manoeuvre
    trajectory: Trajectory
    rank: int

    @property
    def told(self) -> Entry:
        told = self.manoeuvre
        return {
            "start_angle_deg": told.start_deg,
            "target_angle_deg": told.target_deg,
            "shell": told.shell,
            "supply_V": told.supply_volt,
        }


def _advised(drawn: Drawn, first: First, asked: Asked) -> _Found | None:
    for rank, keys in enumerate(asked.manoeuvres, 1):
        told = (float(keys["start_angle_deg"]), float(keys["target_angle_deg"]), bool(keys["shell"]))
        manoeuvre = Manoeuvre("next", *told, float(keys["supply_V"]))
        trajectory = _made(drawn, first, manoeuvre)
        if trajectory:
            return _Found(manoeuvre, trajectory, rank)
    return None


def _random(drawn: Drawn, first: First) -> _Found | None:
    """Draw manoeuvres over the travel, both loads and the supply until the arm can make one."""
    rng = np.random.default_rng([*first.key, 4])
    for rank in range(1, 1 + TRIES):
        start, target = (round(float(angle), 1) for angle in rng.uniform(*TRAVEL_DEG, 2))
        shell, supply = bool(rng.random() < 0.5), round(float(rng.uniform(*SUPPLY)), 1)
        if abs(target - start) < APART_DEG:
            continue
        manoeuvre = Manoeuvre("next", start, target, shell, supply)
        trajectory = _made(drawn, first, manoeuvre)
        if trajectory:
            return _Found(manoeuvre, trajectory, rank)
    return None


def _made(drawn: Drawn, first: First, manoeuvre: Manoeuvre) -> Trajectory | None:
    """Simulate a stroke; None where the arm would leave its travel or outrun the gyro."""
    try:
        found = simulate(Motion(drawn.arm, manoeuvre, first.case().effects()), drawn.duration_s, TOLERANCE)
    except RefusalError:
        return None
    return found if float(np.abs(found.gyro).max()) < FASTEST else None


def _with(drawn: Drawn, found: _Found) -> Drawn:
    """Add a stroke to train on."""
    strokes = (*drawn.strokes, (found.manoeuvre, "train"))
    return replace(drawn, strokes=strokes, trajectories=(*drawn.trajectories, found.trajectory))


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
    head = {"seed": options.seed}
    write_campaigns(options.folder, firsts, partial(make_first, proof), head, options.processes)
    return f"{options.folder}: {len(firsts)} campaigns of few strokes, SYNTHETIC; key: {key_path(options.folder)}"


def _firsts(proof: Proof, seed: int) -> list[First]:
    return [First(pair, place, seed) for pair in proof.pairs for place in range(1, 1 + proof.tried)]


def _make_more(options: argparse.Namespace) -> str:
    proof = read_proof(options.suite)
    key = read_json(key_path(options.base))
    if key["seed"] != options.seed:
        raise RefusalError(f"{options.base} was made with seed {key['seed']}, not {options.seed}")
    doubts = _in_doubt(proof, options.seed, options.reports)
    taken = _taken(proof, doubts)
    named = {f"{first.name}_{choice}": (first, asked, choice) for first, asked in taken for choice in CHOICES}
    counts = Counter(first.pair.letter for first, _ in doubts)
    of = {pair.letter: {"tried": proof.tried, "in_doubt": counts[pair.letter]} for pair in proof.pairs}
    write_campaigns(options.folder, named, partial(_second, proof, of), {"seed": options.seed}, options.processes)
    told = ", ".join(f"{' and '.join(p.names)} {counts[p.letter]} of {proof.tried}" for p in proof.pairs)
    return f"{options.folder}: {len(named)} campaigns with one record more, SYNTHETIC; in doubt were {told}"


def _second(proof: Proof, of: Mapping[str, Any], named: tuple[First, Asked, str]) -> Any:
    first, asked, choice = named
    files, entry = make_second(proof, first, asked, choice)
    return files, entry | of[first.pair.letter]


def _in_doubt(proof: Proof, seed: int, reports: Path) -> list[tuple[First, Asked]]:
    """Give the campaigns whose report leaves the pair in doubt, with what it advises."""
    found = []
    for first in _firsts(proof, seed):
        asked = asked_in(read_json(reports / first.name / "report.json"), first.pair.names)
        if asked:
            found.append((first, asked))
    return found


def _taken(proof: Proof, doubts: list[tuple[First, Asked]]) -> list[tuple[First, Asked]]:
    """Keep the first so many of each pair."""
    letters = [first.pair.letter for first, _ in doubts]
    return [each for place, each in enumerate(doubts) if letters[:place].count(letters[place]) < proof.taken]
