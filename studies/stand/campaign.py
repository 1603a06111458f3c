"""A campaign: what decides it, what it holds, its figure, and how it is put in its place."""

import math
import os
import shlex
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from stand import RefusalError
from stand.arm import KNOWN, NAME, Arm, Manoeuvre, write_manoeuvre
from stand.effects import Effects
from stand.gyro import REST_SAMPLES, Gyro, measure, record_times
from stand.motion import SAMPLES_PER_SECOND, Motion, simulate


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
    window_s: tuple[float, float] | None
    seed: int
    figure: str | None

    def __post_init__(self) -> None:
        names = [each.name for each in self.manoeuvres]
        if not NAME.fullmatch(self.name):
            raise RefusalError(f"the campaign name {self.name!r} must be letters, digits, '_', '-' or '.' (see --name)")
        if not names or len(set(names)) < len(names):
            raise RefusalError("the campaign needs at least one manoeuvre and each of them once")
        if set(names) & {f"{names[0]}_{count}" for count in range(2, self.repeats + 1)}:
            raise RefusalError(f"a manoeuvre has the name that a repeat of {names[0]} needs for its file")
        strangers = [name for name in self.holdout if name not in names]
        if strangers:
            raise RefusalError(f"the holdout {strangers[0]!r} is none of the campaign's manoeuvres: {', '.join(names)}")
        if len(set(self.holdout)) == len(names):
            raise RefusalError("every manoeuvre is held out, so there is nothing to train on")
        self._check_numbers()
        self._check_figure()

    def _check_numbers(self) -> None:
        if self.repeats < 1:
            raise RefusalError(f"the number of repeats must be 1 or more, not {self.repeats}")
        if self.seed < 0:
            raise RefusalError(f"the seed must be 0 or more, not {self.seed}")
        if not (math.isfinite(self.duration_s) and 0.01 <= self.duration_s <= 10.0):
            raise RefusalError(f"the duration must lie between 0.01 and 10 s, not {self.duration_s}")
        if not (math.isfinite(self.rest_s) and 0.1 <= self.rest_s <= 10.0):
            raise RefusalError(f"the rest must last between 0.1 and 10 s, not {self.rest_s}")
        if self.window_s and not -0.1 <= self.window_s[0] < self.window_s[1] <= self.duration_s:
            raise RefusalError(
                f"the window must rise and lie between -0.1 and {self.duration_s} s, not {self.window_s}"
            )

    def _check_figure(self) -> None:
        if self.figure is None:
            return
        if Path(self.figure).name != self.figure or Path(self.figure).suffix not in (".png", ".svg", ".pdf"):
            raise RefusalError(f"the figure {self.figure!r} must be a mere file name that ends in .png, .svg or .pdf")
        if self.repeats < 2:
            raise RefusalError("the figure compares repeats, so --repeats must be 2 or more")

    @property
    def rest_samples(self) -> int:
        """Give the samples of rest before t = 0."""
        return round(self.rest_s * SAMPLES_PER_SECOND)

    def command(self) -> str:
        """Give the full command that makes this campaign again, defaults written out and no absolute path."""
        folder = Path(self.folder.name) if self.folder.is_absolute() else self.folder
        told = [each.name if KNOWN.get(each.name) == each else write_manoeuvre(each) for each in self.manoeuvres]
        words = ["python", "studies/test_stand.py", folder.as_posix(), "--name", self.name]
        for option in ("p0", "k", "eta3", "n"):
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


def short(value: float) -> str:
    """Write a number with as many digits as it has and no more."""
    return repr(float(value)).removesuffix(".0")


FloatArray = npt.NDArray[np.float64]

# The simulated arm has the declared constants to the last digit.
EXACT = ("", "[tolerances]", "default = 0.0")


@dataclass(frozen=True)
class Record:
    """Hold one record: file name, manoeuvre, role, times [s], speeds [deg/s], and the file it repeats.

    `noise` is the rms of its noise from t = 0 on [rad/s], where that was reckoned.
    """

    file: str
    manoeuvre: Manoeuvre
    role: str
    time_s: FloatArray
    speed_deg_s: FloatArray
    repeat_of: str | None = None
    noise: float = math.nan


def make_records(settings: Settings, rng: np.random.Generator) -> list[Record]:
    """Simulate each manoeuvre once and measure it as often as asked; repeats differ by their noise alone."""
    records = []
    for index, manoeuvre in enumerate(settings.manoeuvres):
        trajectory = simulate(Motion(settings.arm, manoeuvre, settings.effects), settings.duration_s)
        role = "holdout" if manoeuvre.name in settings.holdout else "train"
        for count in range(1, 1 + (settings.repeats if index == 0 else 1)):
            original = f"{manoeuvre.name}.csv" if count > 1 else None
            file = f"{manoeuvre.name}_{count}.csv" if original else f"{manoeuvre.name}.csv"
            speed = measure(trajectory, settings.gyro, settings.effects.gyro_bias_deg_s, rng, settings.rest_samples)
            times = record_times(trajectory, settings.rest_samples)
            records.append(Record(file, manoeuvre, role, times, speed, original))
    return records


def record_text(record: Record, decimals: int, time_decimals: int = 3) -> str:
    """Write a record as CSV: time to the millisecond unless told, speed with the decimals of its quantisation."""
    # a rounded -0 is written as 0
    speeds = [round(speed, decimals) + 0.0 for speed in record.speed_deg_s.tolist()]
    lines = [f"{t:.{time_decimals}f},{v:.{decimals}f}" for t, v in zip(record.time_s, speeds, strict=True)]
    return "\n".join(["time_s,angular_velocity_deg_s", *lines, ""])


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


def campaign_text(
    said: list[str],
    name: str,
    gyro: Gyro,
    records: list[Record],
    window_s: tuple[float, float] | None = None,
    constants: tuple[str, ...] = EXACT,
) -> str:
    """Write campaign.toml: comments, the records, and how well the constants are known."""
    lines = [*(f"# {line}" for line in said), "", f'name = "{name}"', 'plant = "shell_transfer_arm"']
    lines.append(f"gyro_range_deg_s = {short(gyro.range_deg_s)}")
    for record in records:
        told = record.manoeuvre
        lines += ["", "[[records]]", f'file = "{record.file}"', f'role = "{record.role}"']
        lines += [f"start_angle_deg = {float(told.start_deg)}", f"target_angle_deg = {float(told.target_deg)}"]
        lines += [f"shell = {str(told.shell).lower()}", f"supply_V = {float(told.supply_volt)}"]
        lines += [f"window_s = [{window_s[0]}, {window_s[1]}]"] if window_s else []
        lines += [f'repeat_of = "{record.repeat_of}"'] if record.repeat_of else []
    return "\n".join([*lines, *constants, ""])


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


def check_place(folder: Path, force: bool) -> None:
    """Refuse a place that holds something else; with `force` an earlier campaign may be replaced."""
    try:
        if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
            return
    except OSError as error:
        raise RefusalError(f"{folder} cannot be read: {error.strerror or error}") from error
    if not folder.is_dir():
        raise RefusalError(f"{folder} is a file, so no campaign folder can stand there")
    if not force:
        raise RefusalError(f"{folder} is not empty; give --force to replace the campaign in it")
    if not (folder / "campaign.toml").is_file():
        raise RefusalError(f"{folder} holds no campaign.toml, so --force will not replace what is in it")


@contextmanager
def replacing(folder: Path) -> Iterator[Path]:
    """Give a new folder beside, and move it into place in the end; an earlier folder goes only when that is done.

    Raises RefusalError when the disk or the rights do not allow it, and leaves then what was there before.
    """
    place = folder.resolve()
    fresh, old = (place.with_name(f".{place.name}.{word}-{os.getpid()}") for word in ("new", "old"))
    try:
        fresh.mkdir(parents=True)
        yield fresh
        if place.exists():
            place.rename(old)
        fresh.rename(place)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise RefusalError(f"{folder} cannot be written: {error.strerror or error}") from error
    finally:
        if old.exists() and not place.exists():
            old.rename(place)
        shutil.rmtree(fresh, ignore_errors=True)
