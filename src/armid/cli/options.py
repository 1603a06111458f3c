"""Options that several commands share, and how their texts become values."""

import warnings
from collections.abc import Callable, Iterable, Mapping
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from armid.errors import ArmidError, nearest
from armid.model import Effect, Model
from armid.registry import Registry, load_registry

if TYPE_CHECKING:
    from armid.problem.space import Space
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


bounds_option = click.option(
    "--bounds", multiple=True, metavar="NAME=LOW:HIGH", help="Free a parameter between bounds, SI. Repeatable."
)
fix_option = click.option("--fix", multiple=True, metavar="NAME=VALUE", help="Fix a parameter, SI. Repeatable.")
seed_option = click.option(
    "--seed", default=1, show_default=True, type=click.IntRange(0),
    help="Seed of everything random; the same gives the same result.",
)  # fmt: skip
window_option = click.option("--window", default="", metavar="A:B", help="What is seen of every record, s.")


def out_option(text: str, required: bool = False) -> Callable[[Any], Any]:
    """Return --out DIR with its help."""
    return click.option("--out", required=required, type=click.Path(path_type=Path), metavar="DIR", help=text)


def problem_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command CAMPAIGN and the options that say which model is fitted to what of it, see `opened`."""
    options = (campaign_argument, effects_option, bounds_option, fix_option, window_option, plugin_option)
    for option in reversed(options):
        command = option(command)
    return command


class Opened(NamedTuple):
    """What a command on a campaign works with: all that is registered, the records, the declared model, overrides.

    bounds, fixed: name -> (low, high) of --bounds, and value of --fix, SI.
    """

    registry: Registry
    campaign: "Campaign"
    model: Model
    bounds: dict[str, tuple[float, float]]
    fixed: dict[str, float]

    def space(self) -> "Space":
        """Return the space that is searched."""
        from armid.problem.space import space_of

        return space_of(self.model, self.campaign.parameters, self.bounds, self.fixed)


def opened(
    campaign: Path, effects: str, plugins: Iterable[str], window: str = "", bounds: Iterable[str] = (),
    fix: Iterable[str] = (),
) -> Opened:  # fmt: skip
    """Return what CAMPAIGN, --effects, --plugin, --window, --bounds and --fix stand for; plug-ins run their code.

    Raises ArmidError for whatever of them cannot be used.
    """
    from armid.record import read_campaign

    registry = load_registry(plugins)
    read = read_campaign(campaign, registry.plants, registry.effects)
    if window:
        read = read.with_window(*interval(window, "--window"))
    model = read.model(registry.effects)
    for text in (name.strip() for name in effects.split(",") if name.strip()):
        name, _, form = text.partition(":")
        effect: Effect = chosen(name, registry.effects, "effect")
        model = model + (effect.in_form(form) if form else effect)
    return Opened(registry, read, model, intervals(bounds, "--bounds"), fixed_values(fix, model))


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


def chosen(name: str, known: Mapping[str, object], what: str) -> Any:
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
