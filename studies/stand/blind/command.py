"""The command line that makes a blind suite."""

import argparse
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from stand.blind.case import cases_of, shuffled
from stand.blind.suite import read_suite
from stand.blind.write import check_suite_place, key_path, write_suite
from stand.command import Parser
from stand.refusal import RefusalError

SUITE = Path(__file__).parents[2] / "blind.toml"


def main(words: Sequence[str]) -> int:
    """Make a suite as the command line says; give the exit code, 2 with a sentence on stderr when refused."""
    try:
        options = _parser().parse_args(words)
        suite = read_suite(options.suite)
        only = tuple(word.strip() for word in options.only.split(",") if word.strip())
        cases = shuffled(cases_of(suite, options.seed), options.seed, only)
        if options.processes < 1:
            raise RefusalError(f"the number of processes must be 1 or more, not {options.processes}")
        check_suite_place(options.folder, options.force)
        write_suite(options.folder, suite, cases, options.seed, options.processes)
    except RefusalError as refusal:
        print(f"test_stand: {refusal}", file=sys.stderr)
        return 2
    counts = ", ".join(f"{count} {label}" for label, count in Counter(each.label for each in cases.values()).items())
    print(f"{options.folder}: {len(cases)} blind campaigns ({counts}), SYNTHETIC; key: {key_path(options.folder)}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="test_stand.py blind",
        description="Make a suite of blind SYNTHETIC campaigns; the truth goes to OUT_FOLDER.key.json beside it.",
        allow_abbrev=False,
    )
    parser.add_argument("folder", type=Path, metavar="OUT_FOLDER", help="where the campaign folders c000 ... go")
    parser.add_argument("--seed", type=int, required=True, help="seed of all that is drawn")
    only = "classes (control, single, two, unlisted, one_stroke) or effects to keep (default: all)"
    parser.add_argument("--only", default="", metavar="A,B", help=only)
    parser.add_argument("--suite", type=Path, default=SUITE, help="file that describes it (default studies/blind.toml)")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="default: one for each core")
    parser.add_argument("--force", action="store_true", help="replace an earlier suite and its key")
    return parser
