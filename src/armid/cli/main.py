"""The command `armid`: its sub-commands, and how errors reach the user."""

import sys
import warnings
from typing import Any

import typer

from armid.cli import simulate as simulate_command
from armid.cli.bench import bench
from armid.cli.check import check
from armid.cli.identify import identify
from armid.cli.importing import import_app
from armid.cli.listing import list_command
from armid.model import ArmidError

BAD_INPUT, INTERRUPTED = 2, 130
# Typer brings its own copy of click or uses the installed one, depending on its version: ask it for the class.
USAGE_ERROR: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")

app = typer.Typer(
    help="Identify the unknown parameters of a driven arm from its measured motion.\n\nCAMPAIGN is a folder with "
    "campaign.toml and one CSV file a record, or that campaign.toml. Numbers are SI unless a name says otherwise.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("simulate")(simulate_command.simulate_command)
app.command("identify")(identify)
app.command("list")(list_command)
app.command("check")(check)
app.command("bench")(bench)
app.add_typer(import_app, name="import")


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Print a warning as one line."""
    print(f"armid: warning: {message}", file=sys.stderr)


def main(arguments: list[str] | None = None) -> None:
    """Run a command; bad input gives one sentence and exit code 2."""
    warnings.showwarning = show_warning
    try:
        code = app(arguments, prog_name="armid", standalone_mode=False)
    except ArmidError as error:
        stop(str(error), BAD_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        stop("interrupted", INTERRUPTED)
    except USAGE_ERROR as error:
        stop(f"{error.format_message()} (see --help)", BAD_INPUT)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except OSError as error:
        stop(f"{error.filename or 'a file'} cannot be used: {error.strerror or error}", BAD_INPUT)
    sys.exit(code if isinstance(code, int) else 0)


def stop(sentence: str, code: int) -> None:
    """Print a sentence to the error stream and leave."""
    print(f"armid: {sentence}", file=sys.stderr)
    sys.exit(code)
