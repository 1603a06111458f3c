"""Many campaigns at once: their command line, their place, and the key beside them with what the scorer must know."""

import argparse
import json
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from stand import RefusalError
from stand.campaign import check_place, replacing, write_files
from stand.command import Parser, carry_out

Entry = dict[str, Any]
LARGEST = 2**32
"""Seeds lie below this, so that they fit any generator."""
CAMPAIGN = re.compile(r"c\d{3,}|[a-z]\d\d(_advised|_random)?")
Make = Callable[[Any], tuple[dict[str, str], Entry]]
"""Makes the files of a campaign, and its entry in the key."""


def key_path(folder: Path) -> Path:
    """Give where the key of a suite lies: beside its folder, FOLDER.key.json."""
    return folder.with_name(f"{folder.name}.key.json")


def write_campaigns(options: argparse.Namespace, named: Mapping[str, Any], make: Make) -> None:
    """Make every campaign, and put folder and key in place when all are there.

    `options` are those of `suite_parser`, `named` what `make` is given for each campaign. What is written does not
    depend on the number of processes. Raises RefusalError when the disk does not allow it.
    """
    with replacing(options.folder) as fresh, ProcessPoolExecutor(options.processes) as pool:
        run = map if options.processes == 1 else pool.map
        entries = dict(zip(named, run(partial(_write_campaign, fresh, make), named.items()), strict=True))
        head = {"made_by": options.program, "unit": "rad/s", "seed": options.seed}
        text = json.dumps({**head, "campaigns": entries}, indent=1) + "\n"
        key_path(options.folder.resolve()).write_text(text)


def _write_campaign(fresh: Path, make: Make, named: tuple[str, Any]) -> Entry:
    """Make one campaign, write its files, and give its entry in the key."""
    name, case = named
    files, entry = make(case)
    write_files(fresh / name, files)
    return entry


def suite_parser(program: str, said: str, suite: Path, processes: int = 1) -> Parser:
    """Give the parser of a command that makes many campaigns; suite, processes: what it takes unless told."""
    parser = Parser(prog=program, description=f"{said} SYNTHETIC.", allow_abbrev=False)
    parser.set_defaults(program=f"studies/{program}")
    parser.add_argument("folder", type=Path, metavar="OUT_FOLDER", help="where the campaign folders go")
    parser.add_argument("--seed", type=int, required=True, help="seed of all that is drawn")
    parser.add_argument("--suite", type=Path, default=suite, help=f"what describes it (default studies/{suite.name})")
    parser.add_argument("--processes", type=int, default=processes, help=f"default here {processes}")
    parser.add_argument("--force", action="store_true", help="replace earlier campaigns and their key")
    return parser


def make_as_told(make: Callable[[argparse.Namespace], str], words: Sequence[str], parser: Parser) -> int:
    """Make campaigns as the command line says and print what was made; give the exit code, 2 when refused."""

    def stranger(there: list[str]) -> str:
        return next((f"{name}, which is not a blind campaign" for name in there if not CAMPAIGN.fullmatch(name)), "")

    def checked(options: argparse.Namespace) -> str:
        if not 0 <= options.seed < LARGEST:
            raise RefusalError(f"the seed must be 0 or more and below 2^32, not {options.seed}")
        if options.processes < 1:
            raise RefusalError(f"the number of processes must be 1 or more, not {options.processes}")
        if not options.folder.name:
            raise RefusalError(f"{options.folder} names no folder that a suite could have")
        check_place(options.folder, options.force, stranger, key_path(options.folder))
        return make(options)

    return carry_out(checked, words, parser)
