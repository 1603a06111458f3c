"""The command line of the test stand, and the campaign that it makes: what decides it, what it says, its figure."""

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from io import BytesIO
from pathlib import Path
from typing import NoReturn

import numpy as np

from stand import RefusalError
from stand.arm import KNOWN, NAME, PARAMETERS, Arm, Manoeuvre, read_manoeuvre, write_manoeuvre
from stand.campaign import EXACT, campaign_text, check_place, record_text, replacing, short
from stand.effects import Effects, read_effects
from stand.gyro import REST_SAMPLES, Gyro, Record, recorded
from stand.motion import SAMPLES_PER_SECOND, Motion, simulate


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
    check_place(settings.folder, options.force, lambda there: "" if "campaign.toml" in there else "no campaign.toml")
    records = make_records(settings, np.random.default_rng(settings.seed))
    texts = {each.file: record_text(each, settings.gyro.decimals) for each in records}
    # the campaign says that it is synthetic and how it was made
    said = ["SYNTHETIC: a simulated shell transfer arm. No machine was measured.", f"Made by: {settings.command()}"]
    said += truth_lines(settings, records)
    truth = ("", "[truth]", *(f"{name} = {float(getattr(settings.arm, name))!r}" for name in PARAMETERS))
    texts["campaign.toml"] = campaign_text(said, settings.name, settings.gyro, records, window_s=settings.window_s,
                                           constants=(*truth, *EXACT))  # fmt: skip
    texts["README.md"] = readme_text(settings, records)
    # all of it in memory, so that nothing is written before all is there
    files = {name: text.encode() for name, text in texts.items()}
    if settings.figure:
        files[settings.figure] = repeats_figure(records, Path(settings.figure).suffix)
    with replacing(settings.folder) as fresh:
        for name, content in files.items():
            (fresh / name).write_bytes(content)
    return f"{settings.folder}: {len(files)} files, {sum(map(len, files.values())) / 1000:.0f} kB, SYNTHETIC"


@dataclass(frozen=True)
class Settings:
    """Hold one campaign's settings: the truth, what is told to the arm, how it is measured, where it is written.

    `repeats` records are made of the first manoeuvre and one of each other. `window_s` [s] is what a record asks to be
    compared in; None leaves the whole record.
    """

    folder: Path
    name: str
    arm: Arm
    effects: Effects
    gyro: Gyro
    manoeuvres: tuple[Manoeuvre, ...]
    holdout: tuple[str, ...]
    repeats: int
    duration_s: float
    rest_s: float
    window_s: Sequence[float] | None
    seed: int
    figure: str | None

    def __post_init__(self) -> None:
        names = [each.name for each in self.manoeuvres]
        first = names[0] if names else ""
        repeats = {f"{first}_{count}" for count in range(2, self.repeats + 1)}
        stranger = next((name for name in self.holdout if name not in names), None)
        figure, (begin, end) = Path(self.figure or "none.png"), self.window_s or (0.0, self.duration_s)
        refused = {
            f"the campaign name {self.name!r} must be letters, digits, '_', '-' or '.' (see --name)":
                not NAME.fullmatch(self.name),
            "the campaign needs at least one manoeuvre and each of them once": not names or len({*names}) < len(names),
            f"a manoeuvre has the name that a repeat of {first} needs for its file": repeats & {*names},
            f"the holdout {stranger!r} is none of the campaign's manoeuvres: {', '.join(names)}": stranger is not None,
            "every manoeuvre is held out, so there is nothing to train on": len({*self.holdout}) == len(names),
            f"the number of repeats must be 1 or more, not {self.repeats}": self.repeats < 1,
            f"the seed must be 0 or more, not {self.seed}": self.seed < 0,
            f"the duration must lie between 0.01 and 10 s, not {self.duration_s}": not 0.01 <= self.duration_s <= 10.0,
            f"the rest must last between 0.1 and 10 s, not {self.rest_s}": not 0.1 <= self.rest_s <= 10.0,
            f"the window must rise and lie between -0.1 and {self.duration_s} s, not {self.window_s}":
                not -0.1 <= begin < end <= self.duration_s,
            f"the figure {self.figure!r} must be a mere file name that ends in .png, .svg or .pdf":
                self.figure not in (None, figure.name) or figure.suffix not in (".png", ".svg", ".pdf"),
            "the figure compares repeats, so --repeats must be 2 or more": self.figure is not None and self.repeats < 2,
        }  # fmt: skip
        for words, holds in refused.items():
            if holds:
                raise RefusalError(words)

    @property
    def rest_samples(self) -> int:
        """Give the samples of rest before t = 0."""
        return round(self.rest_s * SAMPLES_PER_SECOND)

    def command(self) -> str:
        """Give the full command that makes this campaign again, defaults written out and no absolute path."""
        folder = Path(self.folder.name) if self.folder.is_absolute() else self.folder
        told = [each.name if KNOWN.get(each.name) == each else write_manoeuvre(each) for each in self.manoeuvres]
        words = ["python", "studies/test_stand.py", folder.as_posix(), "--name", self.name]
        for option in PARAMETERS:
            words += [f"--{option}", short(getattr(self.arm, option))]
        words += ["--manoeuvres", ",".join(told), "--holdout", ",".join(self.holdout), "--repeats", str(self.repeats)]
        for each in fields(self.gyro):
            option = each.name.replace("range", "gyro_range").replace("_", "-")
            words += [f"--{option}", short(getattr(self.gyro, each.name))]
        words += ["--duration", short(self.duration_s), "--seed", str(self.seed)]
        words += ["--rest", short(self.rest_s)] if self.rest_samples != REST_SAMPLES else []
        if self.window_s:
            words += ["--window-s", *(short(edge) for edge in self.window_s)]
        on = self.effects.switched_on()
        words += ["--effect", *(f"{name}={short(size)}" for name, size in on.items())] if on else []
        words += ["--figure", self.figure] if self.figure else []
        return shlex.join(words)


def read_settings(options: argparse.Namespace) -> Settings:
    """Turn parsed options into settings. Raises RefusalError when they make no campaign."""
    told = {name: value for name, value in vars(options).items() if name != "force"}
    if told["name"] is None:
        told["name"] = options.folder.resolve().name
    told["effects"] = read_effects(told.pop("effect"))
    told["arm"] = Arm(*(told.pop(name) for name in PARAMETERS))
    told["gyro"] = Gyro(**{each.name: told.pop(each.name.replace("range", "gyro_range")) for each in fields(Gyro)})
    told |= {"duration_s": told.pop("duration"), "rest_s": told.pop("rest")}
    told["manoeuvres"] = tuple(map(read_manoeuvre, split(options.manoeuvres)))
    usual = {"empty"} & {each.name for each in told["manoeuvres"]}
    told["holdout"] = tuple(usual) if options.holdout is None else split(options.holdout)
    return Settings(**told)


def make_records(settings: Settings, rng: np.random.Generator) -> list[Record]:
    """Simulate each manoeuvre once and measure it as often as asked; repeats differ by their noise alone."""
    records, bias = [], settings.effects.gyro_bias_deg_s
    for index, manoeuvre in enumerate(settings.manoeuvres):
        trajectory = simulate(Motion(settings.arm, manoeuvre, settings.effects), settings.duration_s)
        role = "holdout" if manoeuvre.name in settings.holdout else "train"
        for count in range(1, 1 + (settings.repeats if index == 0 else 1)):
            original = f"{manoeuvre.name}.csv" if count > 1 else None
            told = (f"{manoeuvre.name}_{count}.csv" if original else f"{manoeuvre.name}.csv", manoeuvre, role, original)
            records.append(recorded(trajectory, settings.gyro, bias, rng, settings.rest_samples, told))
    return records


def truth_lines(settings: Settings, records: list[Record]) -> list[str]:
    """Say in words what the records are made of."""
    arm, gyro, effects = settings.arm, settings.gyro, settings.effects.switched_on()
    colour = f"coloured by a {short(gyro.noise_bandwidth_hz)} Hz gyro" if gyro.noise_bandwidth_hz else "white"
    step = f"steps of {short(gyro.quantisation_deg_s)} deg/s" if gyro.quantisation_deg_s else "no quantisation"
    truth = f"p0 = {short(arm.p0)} Pa, k = {short(arm.k)}, eta3 = {short(arm.eta3)}, n = {short(arm.n)}"
    listed = ", ".join(f"{name} = {short(size)}" for name, size in effects.items()) or "none"
    limit = settings.gyro.range_deg_s - settings.gyro.quantisation_deg_s
    clipped = ", ".join(each.file for each in records if np.abs(each.speed_deg_s).max() > limit) or "none"
    return [
        f"True parameters: {truth}.",
        f"Undeclared effects: {listed}.",
        f"Noise: {short(gyro.noise_deg_s)} deg/s rms, {colour}; {step}; both are estimates.",
        f"Records that reach the gyro's range of {short(gyro.range_deg_s)} deg/s, and are cut there: {clipped}.",
        f"Seed of numpy.random.default_rng: {settings.seed}.",
        "Every other constant of the arm is an engineering estimate; the paper prints none.",
    ]


def readme_text(settings: Settings, records: list[Record]) -> str:
    """Write the campaign's README: synthetic, the truth, the records, the command that makes it again."""
    rows = []
    for each in records:
        told, load = each.manoeuvre, "with the shell" if each.manoeuvre.shell else "without the shell"
        stroke = f"{short(told.start_deg)} to {short(told.target_deg)} deg, {load}, {short(told.supply_volt)} V"
        rows.append(f"| {each.file} | {each.role} | {stroke} | {each.repeat_of or ''} |")
    lines = [
        f"# {settings.name}: SYNTHETIC records of the shell transfer arm",
        "",
        "No machine was measured: a simulated arm was, by a simulated gyro at 1 kHz. The brake opens at t = 0.",
        "",
        *(f"- {line}" for line in truth_lines(settings, records)),
        "",
        "| file | role | manoeuvre | repeats |",
        "|---|---|---|---|",
        *rows,
        "",
        "Made again, from the root of the project, by",
        "",
        "```",
        f"{settings.command()} --force",
        "```",
    ]
    return "\n".join([*lines, ""])


COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")
"""Okabe and Ito's palette, told apart by colour-blind eyes."""


def repeats_figure(records: list[Record], suffix: str) -> bytes:
    """Draw the repeats of the first record: above as measured, below what each departs from the mean of all.

    Gives the bytes of the file; `suffix` is .png, .svg or .pdf. Speeds in deg/s against time in s.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow to load and needed for nothing else

    repeats = [each for each in records if records[0].file in (each.file, each.repeat_of)]
    count, mean = len(repeats), np.mean([each.speed_deg_s for each in repeats], axis=0)
    largest = max(float(np.abs(each.speed_deg_s - mean).max()) for each in repeats)
    figure = Figure(figsize=(7.0, 4.4 + 0.9 * count), dpi=100, layout="constrained")
    above, *below = figure.subplots(1 + count, 1, sharex=True, height_ratios=(4.4, *[0.9] * count))
    for index, (axes, record) in enumerate(zip(below, repeats, strict=True)):
        colour, departure = COLOURS[index % len(COLOURS)], record.speed_deg_s - mean
        # each repeat over the one before in a thinner line, so that all are seen where they agree
        width = 0.8 + 3.2 * (1.0 - (index + 1) / count)
        above.plot(record.time_s, record.speed_deg_s, color=colour, linewidth=width, label=record.file)
        axes.plot(record.time_s, departure, color=colour, linewidth=0.6)
        axes.set(ylim=(-1.1 * largest - 1e-3, 1.1 * largest + 1e-3), ylabel="[deg/s]")
        words = f"{record.file} minus the mean of all repeats: rms {np.sqrt(np.mean(departure**2)):.2f} deg/s"
        axes.set_title(words, loc="left", fontsize="small")
    for axes in (above, *below):
        axes.grid(color="0.9", linewidth=0.8)
        axes.axvline(0.0, color="0.5", linewidth=0.8, linestyle=":")
        axes.margins(x=0.01)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    above.set_ylabel("Angular velocity\nof the arm [deg/s]")
    above.legend(frameon=False)
    above.set_title(f"SYNTHETIC records: {count} repeats of the manoeuvre '{repeats[0].manoeuvre.name}'")
    below[-1].set_xlabel("Time since the brake opened [s]")
    buffer = BytesIO()
    figure.savefig(buffer, format=suffix.removeprefix("."))
    return buffer.getvalue()


def split(text: str) -> tuple[str, ...]:
    """Give the words of a list with commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def _parser() -> Parser:
    effects = [f"  {each.name} [{each.metadata['unit']}]: {each.metadata['note']}" for each in fields(Effects)]
    parser = Parser(
        prog="test_stand.py",
        description="Make a campaign of SYNTHETIC records of the shell transfer arm.",
        epilog="\n".join(["effects (0 = off; SI units unless the name says otherwise):", *effects]),
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
