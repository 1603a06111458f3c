"""Make blind campaigns and apart from them what the scorer must know; write a suite; its command line."""

import argparse
import json
import os
import re
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from stand import RefusalError
from stand.blind.draw import Drawn, Weight, brief, draw, weigh, weigh_alone
from stand.blind.suite import LARGEST, Case, Planted, Suite, cases_of, read_suite, shuffled
from stand.campaign import EXACT, Record, record_lines, record_text, short
from stand.command import Parser
from stand.effects import Effects
from stand.gyro import measure, record_times
from stand.motion import SAMPLES_PER_SECOND

Entry = dict[str, Any]
SAID = "SYNTHETIC and blind: a simulated shell transfer arm; no machine was measured, and the truth is not told here."


@dataclass(frozen=True)
class Measured:
    """Hold a record as written, and the rms of its noise from t = 0 on [rad/s]."""

    record: Record
    noise: float


def make_campaign(name: str, suite: Suite, case: Case, seed: int) -> tuple[dict[str, bytes], Entry]:
    """Make the files of a campaign, which tell nothing of its truth, and its entry in the key."""
    drawn = draw(suite, case, np.random.default_rng([seed, 2, case.index]))
    rng = np.random.default_rng([seed, 3, case.index])
    rest = round(suite.rest_s * SAMPLES_PER_SECOND)
    measured = [measure_stroke(drawn, place, case.effects(), rest, rng) for place in range(len(drawn.strokes))]
    texts = {each.record.file: record_text(each.record, drawn.gyro.decimals) for each in measured}
    texts |= {"campaign.toml": campaign_text(name, drawn, measured), "README.md": f"# {name}\n\n{SAID}\n"}
    return {file: text.encode() for file, text in texts.items()}, _entry(suite, case, drawn, measured)


def measure_stroke(drawn: Drawn, place: int, effects: Effects, rest: int, rng: np.random.Generator) -> Measured:
    """Measure one stroke; what is written departs from the truth by noise and rounding."""
    (manoeuvre, role), trajectory = drawn.strokes[place], drawn.trajectories[place]
    speed = measure(trajectory, drawn.gyro, effects.gyro_bias_deg_s, rng, rest)
    departure = np.radians(speed[rest:]) - trajectory.gyro
    repeated = "lower.csv" if manoeuvre.name == "again" else None
    record = Record(f"{manoeuvre.name}.csv", manoeuvre, role, record_times(trajectory, rest), speed, repeated)
    return Measured(record, float(np.sqrt(np.mean(departure**2))))


def campaign_text(name: str, drawn: Drawn, measured: list[Measured], constants: tuple[str, ...] = EXACT) -> str:
    """Write campaign.toml without a word about the truth; `constants` tells how well they are known."""
    lines = [f"# {SAID}", "", f'name = "{name}"', 'plant = "shell_transfer_arm"']
    lines.append(f"gyro_range_deg_s = {short(drawn.gyro.range_deg_s)}")
    for each in measured:
        lines += ["", "[[records]]", *record_lines(each.record)]
    return "\n".join([*lines, *constants, ""])


def _entry(suite: Suite, case: Case, drawn: Drawn, measured: list[Measured]) -> Entry:
    """Give the truth of a campaign, the noise in its records, and what its effects do to the held-out error.

    Speeds in rad/s; `declared_fit` is the stand's own fit of the declared model to the strokes without their noise.
    """
    floor = {role: _pooled([m.noise for m in measured if m.record.role == role]) for role in ("train", "holdout")}
    speeds = np.array([each.gyro for each in drawn.trajectories])
    joint = weigh(drawn, speeds, suite.ranges) if case.planted else None
    alone = [joint] if len(case.planted) == 1 else [_alone(suite, drawn, each) for each in case.planted]
    effects = [_told(*pair, floor["holdout"]) for pair in zip(case.planted, alone, strict=True)]
    raw = joint.raw if joint else (0.0,) * len(measured)
    return {
        "class": case.label,
        "index": case.index,
        "parameters": {name: getattr(drawn.arm, name) for name in suite.ranges},
        "effects": effects,
        "noise": {
            "kind": "coloured" if case.coloured else "white",
            "rms_deg_s": drawn.gyro.noise_deg_s,
            "bandwidth_hz": drawn.gyro.noise_bandwidth_hz or None,
        },
        "floor": floor,
        "records": [_record(*pair) for pair in zip(measured, raw, strict=True)],
        "declared_fit": _fitted(joint, drawn, floor["holdout"]) if joint else None,
    }


def _alone(suite: Suite, drawn: Drawn, planted: Planted) -> Weight | None:
    return weigh_alone(drawn, Effects(**planted.sizes), suite.ranges)


def _told(planted: Planted, alone: Weight | None, floor: float | None) -> Entry:
    """Tell of one effect: what it is, and what it alone does to the best fit of the declared model."""
    kind = planted.kind
    return {
        "name": kind.name,
        "port": kind.port,
        "form": kind.form,
        "matching": kind.matching,
        "listed": kind.listed,
        "strength": planted.strength,
        "sizes": dict(planted.sizes),
        "alone": alone.told(floor) if alone else None,
    }


def _fitted(weight: Weight, drawn: Drawn, floor: float | None) -> Entry:
    """Tell of the declared model's fit, with the relative error of each parameter."""
    found = {name: getattr(weight.arm, name) for name in ("p0", "k", "eta3", "n")}
    off = {name: value / getattr(drawn.arm, name) - 1.0 for name, value in found.items()}
    return {
        "parameters": {name: brief(value) for name, value in found.items()},
        "bias": {name: brief(value) for name, value in off.items()},
        **weight.told(floor),
    }


def _record(measured: Measured, raw: float) -> Entry:
    record, told = measured.record, measured.record.manoeuvre
    return {
        "file": record.file,
        "role": record.role,
        "start_angle_deg": told.start_deg,
        "target_angle_deg": told.target_deg,
        "shell": told.shell,
        "supply_V": told.supply_volt,
        "noise": brief(measured.noise),
        "raw_change": brief(raw),
    }


def _pooled(values: list[float]) -> float | None:
    """Give the rms over records of equal length, None over none."""
    return brief(float(np.sqrt(np.mean(np.square(values))))) if values else None


CAMPAIGN = re.compile(r"c\d{3,}|[a-z]\d\d(_advised|_random)?")
Make = Callable[[Any], tuple[dict[str, bytes], Entry]]
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


def write_suite(folder: Path, suite: Suite, cases: Mapping[str, Case], seed: int, processes: int) -> None:
    """Make every campaign of a suite, as `write_campaigns` does."""
    named = {name: (name, case) for name, case in cases.items()}
    write_campaigns(folder, named, partial(_make_blind, suite, seed), {"seed": seed}, processes)


def _make_blind(suite: Suite, seed: int, named: tuple[str, Case]) -> tuple[dict[str, bytes], Entry]:
    name, case = named
    return make_campaign(name, suite, case, seed)


def write_campaigns(
    folder: Path, named: Mapping[str, Any], make: Make, head: Mapping[str, Any], processes: int
) -> None:
    """Make every campaign, in `processes` processes, and put folder and key in place when all are there.

    `named` is what `make` is given for each campaign, `head` what the key tells of all of them. What is written does
    not depend on the number of processes. Raises RefusalError when the disk does not allow it.
    """
    place = folder.resolve()
    fresh = place.with_name(f".{place.name}.new-{os.getpid()}")
    try:
        fresh.mkdir(parents=True)
        entries = _make_all(fresh, named, make, processes)
        shutil.rmtree(place, ignore_errors=True)
        fresh.rename(place)
        key = {"made_by": "studies/test_stand.py blind", "unit": "rad/s", **head, "campaigns": entries}
        key_path(place).write_text(json.dumps(key, indent=1) + "\n")
    except OSError as error:
        raise RefusalError(f"{folder} cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _make_all(fresh: Path, named: Mapping[str, Any], make: Make, processes: int) -> dict[str, Entry]:
    with _mapper(processes) as run:
        return dict(zip(named, run(partial(_make, fresh, make), named.items()), strict=True))


def _make(fresh: Path, make: Make, named: tuple[str, Any]) -> Entry:
    """Make one campaign, write its files, and give its entry in the key."""
    name, case = named
    files, entry = make(case)
    (fresh / name).mkdir()
    for file, content in files.items():
        (fresh / name / file).write_bytes(content)
    return entry


@contextmanager
def _mapper(processes: int) -> Iterator[Any]:
    """Give a map over processes, or the plain one for a single process."""
    if processes == 1:
        yield map
        return
    with ProcessPoolExecutor(processes) as pool:
        yield pool.map


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
    try:
        options = parser.parse_args(words)
        if not 0 <= options.seed < LARGEST:
            raise RefusalError(f"the seed must be 0 or more and below 2^32, not {options.seed}")
        if options.processes < 1:
            raise RefusalError(f"the number of processes must be 1 or more, not {options.processes}")
        check_suite_place(options.folder, options.force)
        print(make(options))
    except RefusalError as refusal:
        print(f"{parser.prog.partition('.')[0]}: {refusal}", file=sys.stderr)
        return 2
    return 0


def _make_suite(options: argparse.Namespace) -> str:
    suite = read_suite(options.suite)
    only = tuple(word.strip() for word in options.only.split(",") if word.strip())
    cases = shuffled(cases_of(suite, options.seed), options.seed, only)
    write_suite(options.folder, suite, cases, options.seed, options.processes)
    counts = ", ".join(f"{count} {label}" for label, count in Counter(each.label for each in cases.values()).items())
    return f"{options.folder}: {len(cases)} blind campaigns ({counts}), SYNTHETIC; key: {key_path(options.folder)}"
