"""Make blind campaigns and apart from them what the scorer must know; write a suite; its command line."""

import argparse
import json
import os
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from stand import RefusalError
from stand.arm import Manoeuvre
from stand.blind.draw import Drawn, brief, draw, rms, weigh, weigh_alone
from stand.blind.suite import LARGEST, Case, Planted, Suite, cases_of, read_suite, shuffled
from stand.campaign import EXACT, Record, campaign_text, record_text, replacing
from stand.command import Parser, carry_out, split
from stand.effects import Effects
from stand.gyro import Gyro, measure, record_times
from stand.motion import SAMPLES_PER_SECOND

Entry = dict[str, Any]
SAID = "SYNTHETIC and blind: a simulated shell transfer arm; no machine was measured, and the truth is not told here."


def make_campaign(suite: Suite, seed: int, named: tuple[str, Case]) -> tuple[dict[str, str], Entry]:
    """Make the files of a campaign, which tell nothing of its truth, and its entry in the key."""
    name, case = named
    drawn = draw(suite, case, np.random.default_rng([seed, 2, case.index]))
    records = measure_strokes(suite, drawn, case.effects(), np.random.default_rng([seed, 3, case.index]))
    files = {**campaign_files(name, drawn.gyro, records), "README.md": f"# {name}\n\n{SAID}\n"}
    return files, _entry(suite, case, drawn, records)


def measure_strokes(suite: Suite, drawn: Drawn, effects: Effects, rng: np.random.Generator) -> list[Record]:
    """Measure every stroke; what is written departs from the truth by noise and rounding."""
    rest, records = round(suite.rest_s * SAMPLES_PER_SECOND), []
    for (manoeuvre, role), trajectory in zip(drawn.strokes, drawn.trajectories, strict=True):
        speed = measure(trajectory, drawn.gyro, effects.gyro_bias_deg_s, rng, rest)
        noise = rms(np.radians(speed[rest:]) - trajectory.gyro)
        repeated = "lower.csv" if manoeuvre.name == "again" else None
        times = record_times(trajectory, rest)
        records.append(Record(f"{manoeuvre.name}.csv", manoeuvre, role, times, speed, repeated, noise))
    return records


def campaign_files(name: str, gyro: Gyro, records: list[Record], constants: tuple[str, ...] = EXACT) -> dict[str, str]:
    """Write records and campaign.toml without a word about the truth; `constants` tells how well they are known."""
    files = {each.file: record_text(each, gyro.decimals) for each in records}
    return files | {"campaign.toml": campaign_text([SAID], name, gyro, records, constants=constants)}


def _entry(suite: Suite, case: Case, drawn: Drawn, records: list[Record]) -> Entry:
    """Give the truth of a campaign, the noise in its records, and what its effects do to the held-out error.

    Speeds in rad/s; `declared_fit` is the stand's own fit of the declared model to the strokes without their noise.
    """
    floor, truth = noise_floor(records), drawn.arm
    joint = weigh(drawn, np.array([each.gyro for each in drawn.trajectories]), suite.ranges) if case.planted else None
    effects = []
    for each in case.planted:
        # what it alone does to the best fit of the declared model
        alone = joint if len(case.planted) == 1 else weigh_alone(drawn, Effects(**each.sizes), suite.ranges)
        effects.append(planted_entry(each) | {"alone": alone.told(floor["holdout"]) if alone else None})
    fit = None
    if joint:
        found = {name: getattr(joint.arm, name) for name in ("p0", "k", "eta3", "n")}
        fit = {
            "parameters": {name: brief(value) for name, value in found.items()},
            "bias": {name: brief(value / getattr(truth, name) - 1.0) for name, value in found.items()},
            **joint.told(floor["holdout"]),
        }
    raw = joint.raw if joint else (0.0,) * len(records)
    return {
        "class": case.label,
        "index": case.index,
        "parameters": {name: getattr(truth, name) for name in suite.ranges},
        "effects": effects,
        "noise": {
            "kind": "coloured" if case.coloured else "white",
            "rms_deg_s": drawn.gyro.noise_deg_s,
            "bandwidth_hz": drawn.gyro.noise_bandwidth_hz or None,
        },
        "floor": floor,
        "records": [record_entry(*pair) for pair in zip(records, raw, strict=True)],
        "declared_fit": fit,
    }


def planted_entry(planted: Planted) -> Entry:
    kind = planted.kind
    told = {name: getattr(kind, name) for name in ("name", "port", "form", "matching", "listed")}
    return {**told, "strength": planted.strength, "sizes": dict(planted.sizes)}


def manoeuvre_entry(manoeuvre: Manoeuvre) -> Entry:
    """Tell what a manoeuvre is, by the keys of campaign.toml."""
    return {
        "start_angle_deg": manoeuvre.start_deg,
        "target_angle_deg": manoeuvre.target_deg,
        "shell": manoeuvre.shell,
        "supply_V": manoeuvre.supply_volt,
    }


def record_entry(record: Record, raw: float) -> Entry:
    """Tell of a record, its noise and what the effects change in it at the true parameters [rad/s]."""
    told = {"file": record.file, "role": record.role, **manoeuvre_entry(record.manoeuvre)}
    return told | {"noise": brief(record.noise), "raw_change": brief(raw)}


def noise_floor(records: list[Record]) -> dict[str, float | None]:
    """Give the rms of the noise of each role [rad/s], over records of equal length; None over none."""
    of = {role: [each.noise for each in records if each.role == role] for role in ("train", "holdout")}
    return {role: brief(float(np.sqrt(np.mean(np.square(some))))) if some else None for role, some in of.items()}


CAMPAIGN = re.compile(r"c\d{3,}|[a-z]\d\d(_advised|_random)?")
Make = Callable[[Any], tuple[dict[str, str], Entry]]
"""Makes the files of a campaign, and its entry in the key."""


def key_path(folder: Path) -> Path:
    """Give where the key of a suite lies: beside its folder, FOLDER.key.json."""
    return folder.with_name(f"{folder.name}.key.json")


def check_suite_place(folder: Path, force: bool) -> None:
    """Refuse a place that holds something else; with `force` an earlier suite and its key may be replaced."""
    if not folder.name:
        raise RefusalError(f"{folder} names no folder that a suite could have")
    there = sorted(folder.iterdir()) if folder.is_dir() else []
    if folder.exists() and not folder.is_dir():
        raise RefusalError(f"{folder} is a file, so no suite can stand there")
    if not there and not key_path(folder).exists():
        return
    if not force:
        found = folder if there else key_path(folder)
        raise RefusalError(f"{found} is there already; give --force to replace the suite and its key")
    strangers = [each.name for each in there if not CAMPAIGN.fullmatch(each.name)]
    if strangers:
        raise RefusalError(f"{folder} holds {strangers[0]}, which is no blind campaign, so --force will not replace it")


def write_campaigns(options: argparse.Namespace, named: Mapping[str, Any], make: Make) -> None:
    """Make every campaign, and put folder and key in place when all are there.

    `options` are those of `suite_parser`, `named` what `make` is given for each campaign. What is written does not
    depend on the number of processes. Raises RefusalError when the disk does not allow it.
    """
    with replacing(options.folder) as fresh, ProcessPoolExecutor(options.processes) as pool:
        run = map if options.processes == 1 else pool.map
        entries = dict(zip(named, run(partial(_write_campaign, fresh, make), named.items()), strict=True))
        head = {"made_by": "studies/test_stand.py blind", "unit": "rad/s", "seed": options.seed}
        text = json.dumps({**head, "campaigns": entries}, indent=1) + "\n"
        key_path(options.folder.resolve()).write_text(text)


def _write_campaign(fresh: Path, make: Make, named: tuple[str, Any]) -> Entry:
    """Make one campaign, write its files, and give its entry in the key."""
    name, case = named
    files, entry = make(case)
    (fresh / name).mkdir()
    for file, text in files.items():
        (fresh / name / file).write_bytes(text.encode())
    return entry


SUITE = Path(__file__).parents[2] / "blind.toml"


def main(words: Sequence[str]) -> int:
    """Make a suite as the command line says; give the exit code, 2 with a sentence on stderr when refused."""
    said = "Make a suite of blind campaigns; the truth goes to OUT_FOLDER.key.json beside it."
    parser = suite_parser("test_stand.py blind", said, SUITE, os.cpu_count() or 1)
    only = "classes (control, single, two, unlisted, one_stroke) or effects to keep (default: all)"
    parser.add_argument("--only", default="", metavar="A,B", help=only)
    return make_as_told(_make_suite, words, parser)


def suite_parser(program: str, said: str, suite: Path, processes: int = 1) -> Parser:
    """Give the parser of a command that makes many campaigns; suite, processes: what it takes unless told."""
    parser = Parser(prog=program, description=f"{said} SYNTHETIC.", allow_abbrev=False)
    parser.add_argument("folder", type=Path, metavar="OUT_FOLDER", help="where the campaign folders go")
    parser.add_argument("--seed", type=int, required=True, help="seed of all that is drawn")
    parser.add_argument("--suite", type=Path, default=suite, help=f"what describes it (default studies/{suite.name})")
    parser.add_argument("--processes", type=int, default=processes, help=f"default here {processes}")
    parser.add_argument("--force", action="store_true", help="replace earlier campaigns and their key")
    return parser


def make_as_told(make: Callable[[argparse.Namespace], str], words: Sequence[str], parser: Parser) -> int:
    """Make campaigns as the command line says and print what was made; give the exit code, 2 when refused."""

    def checked(options: argparse.Namespace) -> str:
        if not 0 <= options.seed < LARGEST:
            raise RefusalError(f"the seed must be 0 or more and below 2^32, not {options.seed}")
        if options.processes < 1:
            raise RefusalError(f"the number of processes must be 1 or more, not {options.processes}")
        check_suite_place(options.folder, options.force)
        return make(options)

    return carry_out(checked, words, parser)


def _make_suite(options: argparse.Namespace) -> str:
    suite = read_suite(options.suite)
    cases = shuffled(cases_of(suite, options.seed), options.seed, split(options.only))
    named = {name: (name, case) for name, case in cases.items()}
    write_campaigns(options, named, partial(make_campaign, suite, options.seed))
    counts = ", ".join(f"{count} {label}" for label, count in Counter(each.label for each in cases.values()).items())
    return f"{options.folder}: {len(cases)} blind campaigns ({counts}), SYNTHETIC; key: {key_path(options.folder)}"
