"""The command lines that make the campaigns of the proof of advice: first few strokes, then one record more."""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from stand.advice.first import First, make_first
from stand.advice.pairs import Proof, read_proof
from stand.advice.second import CHOICES, Asked, asked_in, make_second
from stand.blind.write import check_suite_place, key_path, write_campaigns
from stand.command import Parser
from stand.refusal import RefusalError

PROOF = Path(__file__).parents[2] / "advice.toml"


def make_base(words: Sequence[str]) -> int:
    """Make campaigns of few strokes as the command line says; give the exit code."""
    return _told(_make_base, words, _parser("advice", "Make campaigns of few strokes, each with one effect of a pair."))


def make_more(words: Sequence[str]) -> int:
    """Add the advised record, and a random one, as the command line says; give the exit code."""
    parser = _parser("advised", "Add the record that was advised to campaigns in doubt, and a random one in its place.")
    parser.add_argument("--base", type=Path, required=True, help="the campaigns that `advice` made")
    parser.add_argument("--reports", type=Path, required=True, help="holds CAMPAIGN/report.json for each of them")
    return _told(_make_more, words, parser)


def _told(make: Callable[[argparse.Namespace], str], words: Sequence[str], parser: Parser) -> int:
    try:
        options = parser.parse_args(words)
        if options.processes < 1:
            raise RefusalError(f"the number of processes must be 1 or more, not {options.processes}")
        check_suite_place(options.folder, options.force)
        print(make(options))
    except RefusalError as refusal:
        print(f"test_stand: {refusal}", file=sys.stderr)
        return 2
    return 0


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
    key = _read(key_path(options.base))
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
        asked = asked_in(_read(reports / first.name / "report.json"), first.pair.names)
        if asked:
            found.append((first, asked))
    return found


def _taken(proof: Proof, doubts: list[tuple[First, Asked]]) -> list[tuple[First, Asked]]:
    """Keep the first so many of each pair."""
    letters = [first.pair.letter for first, _ in doubts]
    return [each for place, each in enumerate(doubts) if letters[:place].count(letters[place]) < proof.taken]


def _read(file: Path) -> Any:
    try:
        return json.loads(file.read_text())
    except OSError as error:
        raise RefusalError(f"{file} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise RefusalError(f"{file} is no JSON: {error}") from error


def _parser(name: str, said: str) -> Parser:
    parser = Parser(prog=f"test_stand.py {name}", description=f"{said} SYNTHETIC.", allow_abbrev=False)
    parser.add_argument("folder", type=Path, metavar="OUT_FOLDER", help="where the campaign folders go")
    parser.add_argument("--seed", type=int, required=True, help="seed of all that is drawn")
    parser.add_argument("--suite", type=Path, default=PROOF, help="what describes it (default studies/advice.toml)")
    parser.add_argument("--processes", type=int, default=1, help="default 1")
    parser.add_argument("--force", action="store_true", help="replace earlier campaigns and their key")
    return parser
