"""Options that several commands share, and how their texts become values."""

import os
import shlex
import warnings
from collections.abc import Iterable
from contextlib import suppress
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from armid.errors import ArmidError, nearest
from armid.model import Model
from armid.registry import Registry, load_registry

if TYPE_CHECKING:
    from armid.record import Campaign


# By such a factor a value misses its declared range that was told in another unit.
FAR = 100.0
campaign_argument = click.argument("campaign", type=click.Path(path_type=Path))
plugin_option = click.option(
    "--plugin", "plugins", multiple=True, metavar="FILE.py:attribute",
    help="Register your own plant, effect, fitness or identifier. This runs the Python code of the file, so name only "
    "files that you trust; campaigns and studies never run code. Repeatable.",
)  # fmt: skip
effects_option = click.option(
    "--effects", default="", metavar="NAME,NAME[:FORM]", help="Effects to add to those that the campaign declares."
)
accuracy_option = click.option(
    "--accuracy", default="auto", show_default=True, metavar="standard|fine|auto",
    help="Error of the engine: standard 1e-5 rad/s, fine 2e-7 rad/s (shares of the plant's speed scale); auto: fine "
    "where the noise would not hide the standard error.",
)  # fmt: skip


class Opened(NamedTuple):
    """What a command on a campaign works with: all that is registered, the records, the declared model."""

    registry: Registry
    campaign: "Campaign"
    model: Model


def opened(campaign: Path, effects: str, plugins: Iterable[str], window: str = "") -> Opened:
    """Return what CAMPAIGN, --effects, --plugin and --window stand for; plug-ins run their code.

    Raises ArmidError for whatever of them cannot be used.
    """
    from armid.record import read_campaign

    registry = load_registry(plugins)
    read = read_campaign(campaign, registry.plants, registry.effects)
    if window:
        read = read.with_window(*interval(window, "--window"))
    return Opened(registry, read, model_of(read, effects, registry))


def examples(*lines: str) -> str:
    """Return what stands below the options of a command's help."""
    # \b keeps click from joining the lines
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def number(text: str, option: str) -> float:
    """Return a number; refuse anything else with one sentence."""
    try:
        return float(text)
    except ValueError as error:
        raise ArmidError(f"{option}: '{text}' is no number") from error


def assignments(texts: Iterable[str], option: str, form: str = "NAME=VALUE") -> dict[str, str]:
    """Return NAME -> text of options of the form NAME=TEXT; `form` is how messages write it.

    Raises ArmidError for another form and for a name given twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name or not value:
            raise ArmidError(f"{option} '{text}' is not of the form {form}")
        if name in found:
            raise ArmidError(f"{option}: '{name}' is given twice")
        found[name] = value
    return found


def value_of(text: str) -> float | int | bool | str:
    """Return true or false, a whole number, a number, or the word itself."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def numbers(texts: Iterable[str], option: str) -> dict[str, float]:
    """Return NAME -> number."""
    return {name: number(value, f"{option} {name}") for name, value in assignments(texts, option).items()}


def fixed_values(texts: Iterable[str], model: Model) -> dict[str, float]:
    """Return NAME -> number of --fix, SI; warn of one far outside the declared range, as a forgotten factor gives."""
    found = numbers(texts, "--fix")
    for name, value in found.items():
        p = model.parameters.get(name)
        if p is None or not isfinite(value):
            continue
        if abs(value) > FAR * max(abs(p.low), abs(p.high)) or FAR * value < p.low:
            text = f"--fix {name}={value:g} is far outside the declared range, {p.low:g} to {p.high:g} {p.unit}"
            warnings.warn(f"{text}; it is taken as it is", stacklevel=2)
    return found


def interval(text: str, option: str) -> tuple[float, float]:
    """Return the two numbers of LOW:HIGH."""
    low, colon, high = text.partition(":")
    if not colon:
        raise ArmidError(f"{option} '{text}' is not of the form LOW:HIGH")
    return number(low, option), number(high, option)


def intervals(texts: Iterable[str], option: str) -> dict[str, tuple[float, float]]:
    """Return NAME -> (low, high)."""
    found = assignments(texts, option, "NAME=LOW:HIGH")
    return {name: interval(value, f"{option} {name}") for name, value in found.items()}


def chosen(name: str, known: dict[str, object], what: str) -> object:
    """Return what is registered under a name.

    Raises ArmidError with the nearest valid name.
    """
    if name not in known:
        raise ArmidError(f"{what} '{name}' is not known: {nearest(name, known)}")
    return known[name]


def accuracy_of(text: str) -> str | None:
    """Return the engine's accuracy, None for auto."""
    if text not in ("standard", "fine", "auto"):
        raise ArmidError(f"--accuracy '{text}': {nearest(text, ('standard', 'fine', 'auto'))}")
    return None if text == "auto" else text


def model_of(campaign: "Campaign", effects: str, registry: Registry) -> Model:
    """Return the campaign's model with further effects added."""
    model = Model(campaign.plant)
    wanted = [*campaign.effects, *(name.strip() for name in effects.split(",") if name.strip())]
    for text in wanted:
        name, _, form = text.partition(":")
        effect = registry.effects.get(name)
        if effect is None:
            raise ArmidError(f"effect '{name}' is not known: {nearest(name, registry.effects)}")
        model = model + (effect.in_form(form) if form else effect)
    return model


def made_by() -> dict[str, Any]:
    """Return the command that is running, as a shell takes it, and the value of each of its options."""
    context = click.get_current_context()
    words = [str(word) for word in context.find_root().obj or ()]
    return {
        "command": shlex.join(["armid", *words]),
        "settings": {name: plain(value) for name, value in context.params.items()},
    }


def plain(value: Any) -> Any:
    """Return an option as JSON can hold it."""
    if isinstance(value, tuple | list):
        return [plain(v) for v in value]
    return str(value) if isinstance(value, Path) else value


class NewFiles:
    """Write files beside a folder and move them in when all are there, so that nothing half-written is found.

    names: the files so far. A folder that is made for them goes again when nothing comes into it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: list[str] = []

    def __enter__(self) -> "NewFiles":
        if self.folder.exists() and not self.folder.is_dir():
            raise ArmidError(f"--out {self.folder} is a file: a folder is expected")
        self._is_new = not self.folder.exists()
        self.folder.mkdir(parents=True, exist_ok=True)
        self._beside = TemporaryDirectory(dir=self.folder, prefix=".armid-")
        return self

    @property
    def place(self) -> Path:
        """Where the files are until all are there."""
        return Path(self._beside.name)

    def path(self, name: str) -> Path:
        """Return where to write a file for now.

        Raises ArmidError when a folder has its name.
        """
        if (self.folder / name).is_dir():
            raise ArmidError(f"--out {self.folder} holds a folder {name}: a place for a file of that name is expected")
        self.names.append(name)
        path = self.place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            for name in self.names:
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(self.place / name, self.folder / name)
        self._beside.cleanup()
        if self._is_new:
            with suppress(OSError):
                self.folder.rmdir()


def refuse_unwritable(folder: Path) -> None:
    """Refuse a folder before the work, not after it.

    Raises ArmidError for a file, OSError for a place where nothing can be written.
    """
    with NewFiles(folder):
        pass
