"""Options that several commands share, how their texts become values, and how a command speaks."""

import json
import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from armid.errors import ArmidError, printable, refuse_unless_known
from armid.progress import LOG

if TYPE_CHECKING:
    from armid.report.document import Document


# Programs of the repository that the package does not ship.
STUDIES = Path(__file__).parents[3] / "studies"


def of_studies(module: str) -> Any:
    """Return a module of the repository's `studies`, such as "bench.run"."""
    sys.path.insert(0, str(STUDIES))
    return import_module(module)


def kept(context: click.Context, option: click.Parameter, value: bool) -> None:
    context.meta[f"armid.{option.name}"] = value


# Options of every command. They do not change a result.
OUTPUT = (
    (("--json", "json"), "Print the result as one JSON object on the standard output, and nothing else there."),
    (("--quiet", "quiet"), "Print nothing but errors and warnings; `list` prints names alone."),
)


class Heard(click.Command):
    """A command whose help may be cut off by its reader, as `| head -1` does."""

    def make_context(self, *given: Any, **named: Any) -> click.Context:
        """Read the options; those that print and end do it here."""
        with while_read(sys.stdout):
            return super().make_context(*given, **named)
        raise click.exceptions.Exit(0)


class Command(Heard):
    """A command with --json and --quiet; it prints by `say`, `present`, `give` and `tell` alone."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; it tells on the error stream that a model is being compiled."""
        # asked here, as what is announced comes from another thread
        if not wants("quiet"):
            handler = logging.Handler()
            handler.emit = lambda record: tell(f"armid: {record.getMessage()}")  # type: ignore[method-assign]
            LOG.addHandler(handler)
            ctx.call_on_close(partial(LOG.removeHandler, handler))
        return super().invoke(ctx)

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.params += [click.Option(names, is_flag=True, expose_value=False, callback=kept, help=text)
                        for names, text in OUTPUT]  # fmt: skip


class CommandGroup(Heard, click.Group):
    command_class = Command


command = partial(click.command, cls=Command)


def wants(what: str) -> bool:
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(f"armid.{what}"))


def speaks() -> bool:
    return not (wants("json") or wants("quiet"))


@contextmanager
def while_read(stream: TextIO) -> Iterator[None]:
    """Print for as long as someone reads: the work goes on after `| head -1`, and further lines go nowhere."""
    try:
        yield
    except OSError as error:
        # Python, too, writes what is left when it ends
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), stream.fileno())
        if stream is sys.stdout and not isinstance(error, BrokenPipeError):
            raise ArmidError(f"the standard output cannot be written: {error.strerror or error}") from error


def say(*lines: str) -> None:
    """Print lines at once, unless --json or --quiet was given."""
    if speaks():
        put(*lines)


def put(*lines: str) -> None:
    """Print lines; what names from files and plug-ins hold neither ends a line nor steers the terminal."""
    with while_read(sys.stdout):
        print(*map(printable, lines), sep="\n", flush=True)


def present(document: "Document") -> None:
    """Print answer and main tables of a document, unless --json or --quiet was given."""
    from armid.report.terminal import show

    if speaks():
        with while_read(sys.stdout):
            show(document)


def give(**entries: Any) -> None:
    """Print the result as one JSON object if --json is given. Each command calls this once."""
    if wants("json"):
        with while_read(sys.stdout):
            print(json.dumps(entries, allow_nan=False, default=str), flush=True)


def tell(text: str) -> None:
    """Print a line on stderr: the first line of the output is the answer."""
    with while_read(sys.stderr):
        print(printable(text), file=sys.stderr, flush=True)


def completes(*catalogues: str, words: Iterable[str] = (), commas: bool = False) -> Callable[..., list[str]]:
    """Return what completes the value of an option: names of catalogues, and words; commas: the last of several."""

    def complete(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
        from armid.registry import load_registry

        before, comma, begun = incomplete.rpartition(",") if commas else ("", "", incomplete)
        registry = load_registry() if catalogues else None
        known = [*words, *(name for kind in catalogues for name in getattr(registry, kind))]
        return [f"{before}{comma}{name}" for name in known if name.startswith(begun)]

    return complete


ACCURACIES = ("standard", "fine", "auto")
campaign_argument = click.argument("campaign", type=click.Path(path_type=Path))
plugin_option = click.option(
    "--plugin", "plugins", multiple=True, metavar="FILE.py:attribute",
    help="Register your own plant, effect, fitness, identifier or analysis. This runs the Python code of the file, so "
    "name only files that you trust; campaigns and studies never run code. Repeatable.",
)  # fmt: skip
effects_option = click.option(
    "--effects",
    default="",
    metavar="NAME,NAME[:FORM]",
    shell_complete=completes("effects", commas=True),
    help="Effects to add to those that the campaign declares.",
)
accuracy_option = click.option(
    "--accuracy", default="auto", show_default=True, metavar="|".join(ACCURACIES),
    shell_complete=completes(words=ACCURACIES),
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
threads_option = click.option(
    "--threads", default=2, show_default=True, type=click.IntRange(1), help="Threads of the simulations."
)
units_option = click.option(
    "--units", metavar="deg|rad|rpm", help="Show angles and turning speeds in this unit. [default: as recorded]"
)
window_option = click.option("--window", default="", metavar="A:B", help="What is seen of every record, s.")


def out_option(text: str, required: bool = False) -> Callable[[Any], Any]:
    return click.option("--out", required=required, type=click.Path(path_type=Path), metavar="DIR", help=text)


def problem_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command CAMPAIGN and the options that say which model is fitted to what of it, see `given`."""
    options = (campaign_argument, effects_option, bounds_option, fix_option, window_option, units_option,
               plugin_option)  # fmt: skip
    for option in reversed(options):
        function = option(function)
    return function


def given(
    effects: str, plugins: Iterable[str], window: str = "", bounds: Iterable[str] = (), fix: Iterable[str] = (),
    units: str | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return --effects, --plugin, --window, --bounds, --fix and --units as `armid.api.opened` takes them."""
    return {
        "effects": [name for name in effects.split(",") if name.strip()], "plugins": tuple(plugins),
        "window": interval(window, "--window") if window else None, "bounds": intervals(bounds, "--bounds"),
        "fix": numbers(fix, "--fix"), "units": units,
    }  # fmt: skip


def examples(*lines: str) -> str:
    # \b keeps click from joining the lines
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def number(text: str, option: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise ArmidError(f"{option}: '{text}' is not a number: one is expected, SI") from error


def assignments(texts: Iterable[str], option: str, form: str = "NAME=VALUE") -> dict[str, str]:
    """Return NAME -> text of options of the form NAME=TEXT; `form` is how messages write it."""
    values: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name or not value:
            raise ArmidError(f"{option} '{text}' is not of the form {form}")
        if name in values:
            raise ArmidError(f"{option}: '{name}' is given twice")
        values[name] = value
    return values


def value_of(text: str) -> float | int | bool | str:
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def numbers(texts: Iterable[str], option: str) -> dict[str, float]:
    return {name: number(value, f"{option} {name}") for name, value in assignments(texts, option).items()}


def interval(text: str, option: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    if not colon:
        raise ArmidError(f"{option} '{text}' is not of the form LOW:HIGH")
    return number(low, option), number(high, option)


def intervals(texts: Iterable[str], option: str) -> dict[str, tuple[float, float]]:
    values = assignments(texts, option, "NAME=LOW:HIGH")
    return {name: interval(value, f"{option} {name}") for name, value in values.items()}


def accuracy_of(text: str) -> str | None:
    refuse_unless_known(text, ACCURACIES, f"--accuracy '{text}'")
    return None if text == "auto" else text
