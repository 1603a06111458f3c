"""The command line of the test stand."""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import NoReturn

import numpy as np

from stand import RefusalError
from stand.arm import KNOWN, Arm, read_manoeuvre
from stand.campaign import (
    Settings,
    campaign_text,
    check_place,
    make_records,
    readme_text,
    record_text,
    repeats_figure,
    replacing,
    truth_lines,
)
from stand.effects import describe_effects, read_effects
from stand.gyro import Gyro


class Parser(argparse.ArgumentParser):
    """Refuse with one sentence, where argparse prints the usage as well."""

    def error(self, message: str) -> NoReturn:
        raise RefusalError(message)


def carry_out(make: Callable[[argparse.Namespace], str], words: Sequence[str], parser: Parser) -> int:
    """Do as the command line says and print what was made; give the exit code, 2 with a sentence when refused."""
    try:
        print(make(parser.parse_args(words)))
    except RefusalError as refusal:
        print(f"{parser.prog.partition('.')[0]}: {refusal}", file=sys.stderr)
        return 2
    return 0


def main(words: Sequence[str]) -> int:
    """Make a campaign as the command line says; give the exit code."""
    return carry_out(_make, words, _parser())


def _make(options: argparse.Namespace) -> str:
    settings = read_settings(options)
    check_place(settings.folder, options.force)
    records = make_records(settings, np.random.default_rng(settings.seed))
    texts = {each.file: record_text(each, settings.gyro.decimals) for each in records}
    # the campaign says that it is synthetic and how it was made
    said = ["SYNTHETIC: a simulated shell transfer arm. No machine was measured.", f"Made by: {settings.command()}"]
    said += truth_lines(settings, records)
    texts["campaign.toml"] = campaign_text(said, settings.name, settings.gyro, records, settings.window_s)
    texts["README.md"] = readme_text(settings, records)
    # all of it in memory, so that nothing is written before all is there
    files = {name: text.encode() for name, text in texts.items()}
    if settings.figure:
        files[settings.figure] = repeats_figure(records, Path(settings.figure).suffix)
    with replacing(settings.folder) as fresh:
        for name, content in files.items():
            (fresh / name).write_bytes(content)
    return f"{settings.folder}: {len(files)} files, {sum(map(len, files.values())) / 1000:.0f} kB, SYNTHETIC"


def read_settings(options: argparse.Namespace) -> Settings:
    """Turn parsed options into settings. Raises RefusalError when they make no campaign."""
    manoeuvres = tuple(map(read_manoeuvre, split(options.manoeuvres)))
    names = {each.name for each in manoeuvres}
    holdout = split(options.holdout) if options.holdout is not None else tuple({"empty"} & names)
    folder: Path = options.folder
    gyro = {each.name: getattr(options, each.name.replace("range", "gyro_range")) for each in fields(Gyro)}
    return Settings(
        folder=folder,
        name=options.name if options.name is not None else folder.resolve().name,
        arm=Arm(options.p0, options.k, options.eta3, options.n),
        effects=read_effects(options.effect),
        gyro=Gyro(**gyro),
        manoeuvres=manoeuvres,
        holdout=holdout,
        repeats=options.repeats,
        duration_s=options.duration,
        rest_s=options.rest,
        window_s=tuple(options.window_s) if options.window_s else None,
        seed=options.seed,
        figure=options.figure,
    )


def split(text: str) -> tuple[str, ...]:
    """Give the words of a list with commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def _parser() -> Parser:
    parser = Parser(
        prog="test_stand.py",
        description="Make a campaign of SYNTHETIC records of the shell transfer arm.",
        epilog=f"effects (0 = off; SI units unless the name says otherwise):\n{describe_effects()}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("folder", type=Path, metavar="OUT_FOLDER", help="where the campaign is written")
    parser.add_argument("--name", help="name of the campaign (default: the folder's)")
    parser.add_argument("--force", action="store_true", help="replace a campaign folder and all that is in it")
    parser.add_argument("--figure", metavar="FILE", help="draw the repeats together into this file of the campaign")
    arm, gyro = Arm(), Gyro()
    group = parser.add_argument_group("truth")
    group.add_argument("--p0", type=float, default=arm.p0, help="initial pressure of the accumulator, Pa")
    group.add_argument("--k", type=float, default=arm.k, help="relative sensitivity of the tachometer")
    group.add_argument("--eta3", type=float, default=arm.eta3, help="efficiency of worm and worm gear")
    group.add_argument("--n", type=float, default=arm.n, help="polytropic exponent of the gas")
    group.add_argument("--effect", nargs="+", action="extend", default=[], metavar="NAME=SIZE", help="listed below")
    known = ", ".join(KNOWN)
    group.add_argument(
        "--manoeuvres",
        default="lower,raise,short,empty",
        metavar="A,B",
        help=f"of {known}, or written out as NAME=START:TARGET:shell|empty:SUPPLY in deg, deg and V",
    )
    group.add_argument("--holdout", metavar="A,B", help="manoeuvres kept from training (default: empty, where made)")
    group = parser.add_argument_group("measurement")
    group.add_argument("--repeats", type=int, default=3, help="records of the first manoeuvre (default 3)")
    group.add_argument("--noise-deg-s", type=float, default=gyro.noise_deg_s, help="rms of the noise (default 0.25)")
    group.add_argument("--noise-bandwidth-hz", type=float, default=0.0, help="colour of the noise (default 0: white)")
    step = "step of the record, an estimate (default 0.1; 0 = none)"
    group.add_argument("--quantisation-deg-s", type=float, default=gyro.quantisation_deg_s, help=step)
    group.add_argument("--gyro-range-deg-s", type=float, default=gyro.range_deg_s, help="largest speed (default 200)")
    group.add_argument("--duration", type=float, default=1.2, help="seconds after the brake opens (default 1.2)")
    group.add_argument("--rest", type=float, default=0.1, help="seconds of rest before it (default 0.1)")
    group.add_argument("--window-s", type=float, nargs=2, metavar=("START", "END"), help="window asked of each record")
    group.add_argument("--seed", type=int, default=1, help="seed of the noise (default 1)")
    return parser
