"""Make blind campaigns of eight machines, and the key that holds their truth.

    python studies/machines/make.py FOLDER --seed 1 --count 40 [--only cart,motor_disc]

FOLDER/c000, FOLDER/c001, ... are campaigns of machines in turn; FOLDER.key.json holds the truth. The same seed, count
and machines give the same files. A command that was cut goes on where it stopped.
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from machines.campaign import files_of
from machines.catalogue import MACHINES
from machines.draw import drawn, plan
from stand import RefusalError
from stand.blind.many import LARGEST
from stand.campaign import write_files
from stand.command import Parser, carry_out


def main(words: Sequence[str]) -> int:
    """Make the campaigns of the command line; return the exit code, 2 with a sentence on stderr where refused."""
    parser = Parser(
        prog="make.py", description="Make blind campaigns of eight machines. SYNTHETIC.", allow_abbrev=False
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where the campaigns go; FOLDER.key.json: the key")
    parser.add_argument("--seed", type=int, required=True, help="seed of all that is drawn")
    parser.add_argument("--count", type=int, required=True, help="number of campaigns")
    parser.add_argument("--only", default="", metavar="MACHINE,...", help=f"of {', '.join(MACHINES)}; default: all")
    return carry_out(make, words, parser)


def make(options: argparse.Namespace) -> str:
    """Make campaigns and key, and return the sentence that says what was made."""
    names = options.only.split(",") if options.only else list(MACHINES)
    for name in names:
        if name not in MACHINES:
            raise RefusalError(f"machine {name!r} is unknown: one of {', '.join(MACHINES)} is expected")
    if not 0 <= options.seed < LARGEST:
        raise RefusalError(f"the seed is {options.seed}: a whole number from 0 to below 2^32 is expected")
    if not 1 <= options.count <= 10_000:
        raise RefusalError(f"the count is {options.count}: 1 to 10000 campaigns are expected")
    folder = options.folder.resolve()
    key, part = (folder.with_name(f"{folder.name}.key{end}") for end in (".json", ".part.json"))
    head = {"made_by": "studies/machines/make.py", "seed": options.seed, "count": options.count, "machines": names}
    if key.exists() or (folder.exists() and not part.exists()):
        raise RefusalError(f"{key if key.exists() else folder} exists already: a new folder is expected")
    entries = {}
    if part.exists():
        kept = json.loads(part.read_text())
        if {name: kept.get(name) for name in head} != head:
            raise RefusalError(f"{part} belongs to another seed, count or choice of machines: a new folder is expected")
        entries = kept["campaigns"]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for index in range(options.count):
            name = f"c{index:03d}"
            if name not in entries:
                entries[name] = write_campaign(folder / name, options.seed, index, names)
                replaced(part, json.dumps({**head, "campaigns": entries}, indent=1) + "\n")
        part.rename(key)
    except OSError as error:
        raise RefusalError(f"{error.filename} cannot be written: {error.strerror}") from error
    n_effects = sum(len(entry["effects"]) for entry in entries.values())
    n_unlisted = sum(not effect["listed"] for entry in entries.values() for effect in entry["effects"])
    return (f"{options.folder}: {options.count} campaigns, SYNTHETIC, with {n_effects} effects, {n_unlisted} in forms "
            f"that armid's library does not hold; key: {key.name}")  # fmt: skip


def write_campaign(folder: Path, seed: int, index: int, names: Sequence[str]) -> dict[str, object]:
    """Write one campaign and return its entry in the key."""
    planned, rng = plan(seed, index, names)
    files, entry = files_of(folder.name, drawn(planned, rng), rng)
    write_files(folder, files)
    return {"index": index, **entry}


def replaced(path: Path, content: str) -> None:
    """Write a file whole or not at all."""
    fresh = path.with_name(f".{path.name}.new")
    fresh.write_text(content)
    os.replace(fresh, path)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
