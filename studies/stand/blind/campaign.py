"""Make blind campaigns, each with what the scorer must know of it; the command line of a suite."""

import argparse
import os
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from stand.arm import PARAMETERS
from stand.blind.draw import Drawn, brief, draw, one_stroke, six_strokes, weigh
from stand.blind.many import Entry, key_path, make_as_told, suite_parser, write_campaigns
from stand.blind.suite import Case, Planted, Suite, cases_of, read_suite, shuffled
from stand.campaign import EXACT, campaign_text, record_text
from stand.command import split
from stand.effects import Effects
from stand.gyro import Gyro, Record, recorded
from stand.motion import SAMPLES_PER_SECOND

SAID = "SYNTHETIC and blind: a simulated shell transfer arm; no machine was measured, and the truth is not told here."


def make_campaign(suite: Suite, seed: int, named: tuple[str, Case]) -> tuple[dict[str, str], Entry]:
    """Make the files of a campaign, which tell nothing of its truth, and its entry in the key."""
    name, case = named
    strokes_of = one_stroke if case.label == "one_stroke" else six_strokes
    drawn = draw(suite, case, np.random.default_rng([seed, 2, case.index]), strokes_of)
    records = measure_strokes(suite, drawn, case.effects(), np.random.default_rng([seed, 3, case.index]))
    files = {**campaign_files(name, drawn.gyro, records), "README.md": f"# {name}\n\n{SAID}\n"}
    entry = entry_of(case, drawn, records)
    if case.planted:
        # what the stand's own fit of the declared model leaves of the strokes without their noise [rad/s]
        entry["declared_fit"] = weigh(drawn, suite.ranges, entry["floor"]["holdout"])
    return files, entry


def measure_strokes(suite: Suite, drawn: Drawn, effects: Effects, rng: np.random.Generator) -> list[Record]:
    """Measure every stroke; what is written departs from the truth by noise and rounding."""
    rest, bias, records = round(suite.rest_s * SAMPLES_PER_SECOND), effects.gyro_bias_deg_s, []
    for (manoeuvre, role), trajectory in zip(drawn.strokes, drawn.trajectories, strict=True):
        told = (f"{manoeuvre.name}.csv", manoeuvre, role, "lower.csv" if manoeuvre.name == "again" else None)
        records.append(recorded(trajectory, drawn.gyro, bias, rng, rest, told))
    return records


def campaign_files(name: str, gyro: Gyro, records: list[Record], constants: tuple[str, ...] = EXACT) -> dict[str, str]:
    """Write records and campaign.toml without a word about the truth; `constants` tells how well they are known."""
    files = {each.file: record_text(each, gyro.decimals) for each in records}
    return files | {"campaign.toml": campaign_text([SAID], name, gyro, records, constants=constants)}


def entry_of(case: Case, drawn: Drawn, records: list[Record]) -> Entry:
    """Give what the key tells of a campaign: its truth, and the noise in its records [rad/s]."""
    return {
        "class": case.label,
        "index": case.index,
        "parameters": {name: getattr(drawn.arm, name) for name in PARAMETERS},
        "effects": [planted_entry(each) for each in case.planted],
        "noise": {"kind": "coloured" if case.coloured else "white", "rms_deg_s": drawn.gyro.noise_deg_s},
        "floor": noise_floor(records),
        "records": [record_entry(each) for each in records],
        "declared_fit": None,
    }


def planted_entry(planted: Planted) -> Entry:
    kind = planted.kind
    told = {name: getattr(kind, name) for name in ("name", "port", "form", "matching", "listed")}
    return {**told, "strength": planted.strength, "sizes": dict(planted.sizes)}


def record_entry(record: Record) -> Entry:
    """Tell of a record and its noise [rad/s]."""
    return {"file": record.file, "role": record.role, **record.manoeuvre.told(), "noise": brief(record.noise)}


def noise_floor(records: list[Record]) -> dict[str, float | None]:
    """Give the rms of the noise of each role [rad/s], over records of equal length; None over none."""
    of = {role: [each.noise for each in records if each.role == role] for role in ("train", "holdout")}
    return {role: brief(float(np.sqrt(np.mean(np.square(some))))) if some else None for role, some in of.items()}


SUITE = Path(__file__).parents[2] / "blind.toml"


def main(words: Sequence[str]) -> int:
    """Make a suite as the command line says; give the exit code, 2 with a sentence on stderr when refused."""
    said = "Make a suite of blind campaigns; the truth goes to OUT_FOLDER.key.json beside it."
    parser = suite_parser("test_stand.py blind", said, SUITE, os.cpu_count() or 1)
    only = "classes (control, single, two, unlisted, one_stroke) or effects to keep (default: all)"
    parser.add_argument("--only", default="", metavar="A,B", help=only)
    return make_as_told(_make_suite, words, parser)


def _make_suite(options: argparse.Namespace) -> str:
    suite = read_suite(options.suite)
    cases = shuffled(cases_of(suite, options.seed), options.seed, split(options.only))
    named = {name: (name, case) for name, case in cases.items()}
    write_campaigns(options, named, partial(make_campaign, suite, options.seed))
    counts = ", ".join(f"{count} {label}" for label, count in Counter(each.label for each in cases.values()).items())
    return f"{options.folder}: {len(cases)} blind campaigns ({counts}), SYNTHETIC; key: {key_path(options.folder)}"
