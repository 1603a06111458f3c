"""Everything that decides a campaign."""

import math
import shlex
from dataclasses import dataclass, field, fields
from pathlib import Path

from stand.arm import Arm
from stand.effects import Effects
from stand.gyro import REST_SAMPLES, Gyro
from stand.manoeuvre import KNOWN, NAME, Manoeuvre, write_manoeuvre
from stand.refusal import RefusalError
from stand.trajectory import SAMPLES_PER_SECOND


@dataclass(frozen=True)
class Settings:
    """Hold one campaign's settings: the truth, what is told to the arm, how it is measured, where it is written.

    `repeats` records are made of the first manoeuvre and one of each other. `window_s` [s] is what a record asks to be
    compared in; None leaves the whole record.
    """

    folder: Path
    name: str
    arm: Arm = field(default_factory=Arm)
    effects: Effects = field(default_factory=Effects)
    gyro: Gyro = field(default_factory=Gyro)
    manoeuvres: tuple[Manoeuvre, ...] = (KNOWN["lower"], KNOWN["raise"], KNOWN["short"], KNOWN["empty"])
    holdout: tuple[str, ...] = ("empty",)
    repeats: int = 3
    duration_s: float = 1.2
    rest_s: float = REST_SAMPLES / SAMPLES_PER_SECOND
    window_s: tuple[float, float] | None = None
    seed: int = 1
    figure: str | None = None

    def __post_init__(self) -> None:
        """Refuse settings that make no campaign."""
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
