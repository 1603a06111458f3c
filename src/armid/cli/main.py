"""The command `armid`: its sub-commands, and how errors reach the user."""

import gc
import io
import sys
import warnings
from functools import partial
from importlib import import_module
from typing import Any

import click

from armid.cli.options import STUDIES, Heard, tell, while_read
from armid.errors import INTERRUPTED, ArmidError, on_a_line
from armid.progress import LOG

BAD_INPUT = 2
EPILOG = """\b
Examples:
  armid new campaign my_axis                          a folder to put your own records into
  armid identify my_axis --out out/axis               its parameters, with intervals
  armid close-loop my_axis --out out/loop             what its declared equations lack
  armid study studies/table1_short.toml --out out/t1  the paper's Table I, small

\b
Completion by the shell, for good with this line in ~/.bashrc (zsh: ~/.zshrc, and zsh_source):
  eval "$(_ARMID_COMPLETE=bash_source armid)"
"""
# Command -> its module in armid.cli and its name there: a command is imported when it is asked for.
COMMANDS = {
    "simulate": "campaign:simulate_command", "identify": "campaign:identify_command",
    "close-loop": "campaign:close_loop_command", "identifiability": "campaign:identifiability_command",
    "list": "listing:list_command", "check": "check:check_command", "doctor": "check:doctor_command",
    "bench": "check:bench_command", "study": "study:study_command", "tune": "study:tune_command",
    "report": "report:report_command", "import": "report:import_group", "export": "report:export_group",
    "new": "new:new_command", "schema": "new:schema_command",
}  # fmt: skip


# Commands whose programs lie in the repository; an installed package has neither programs nor commands.
BESIDE_SOURCE = ("bench", "import")


class Commands(Heard, click.Group):
    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        # click looks for the nearest name there
        self.commands: dict[str, Any] = {
            name: None for name in COMMANDS if name not in BESIDE_SOURCE or STUDIES.is_dir()
        }

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.commands:
            return None
        module, name = COMMANDS[cmd_name].split(":")
        command: click.Command = getattr(import_module(f"armid.cli.{module}"), name)
        return command


@click.group(
    "armid", cls=Commands, epilog=EPILOG,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)  # fmt: skip
@click.version_option(package_name="armid")
def app() -> None:
    """Identify the unknown parameters of a motor-driven machine from its measured motion.

    CAMPAIGN is a folder with campaign.toml and one CSV file a record, or that campaign.toml. Numbers are SI unless a
    name says otherwise. Every command takes --json (one object on the standard output) and --quiet.

    Exit codes: 0 done, whatever was found; 1 a point of a contract does not hold (`armid check`, `armid doctor`); 2 bad
    input, explained in one sentence, nothing half-written; 130 interrupted by Ctrl-C or SIGTERM, what was
    found so far is kept.
    """


def show_warning(seen: set[str], message: Warning | str, *_: Any, **__: Any) -> None:
    """Tell a warning, each once."""
    if str(message) not in seen:
        seen.add(str(message))
        tell(f"armid: warning: {message}")


def main(arguments: list[str] | None = None) -> None:
    """Run a command; bad input gives one sentence and exit code 2."""
    warnings.showwarning = partial(show_warning, set())
    # imports and figures make many objects that stay: looking through them every 700 is a tenth of a short command
    gc.set_threshold(20_000)
    LOG.setLevel("INFO")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # a path that is not UTF-8 is shown, not a reason to fail
            stream.reconfigure(errors="backslashreplace")
    try:
        code = carried_out(arguments)
    except ArmidError as error:
        stop(str(error), BAD_INPUT)
    except (click.Abort, KeyboardInterrupt):
        stop("interrupted", INTERRUPTED)
    except click.ClickException as error:
        stop(f"{error.format_message()} (see --help)", BAD_INPUT)
    except OSError as error:
        stop(f"{error.filename or 'a file'} cannot be used: {error.strerror or error}", BAD_INPUT)
    except UnicodeEncodeError as error:
        # alone, or between the quotes of what was to be written
        name = error.object[: error.end].rpartition('"')[2] + error.object[error.end :].partition('"')[0]
        stop(f"{name!a} is not a name in UTF-8, such a one is expected", BAD_INPUT)
    except MemoryError as error:
        stop(f"not enough memory: {error}; a smaller population, fewer records or shorter ones are expected", BAD_INPUT)
    except (Exception, SystemExit) as error:
        if isinstance(error.__cause__, KeyboardInterrupt):
            # that is how Ctrl-C comes out of a compiled function
            stop("interrupted", INTERRUPTED)
        from armid.registry import place_in_plugin

        place = place_in_plugin(error)
        if place is None:
            raise
        stop(f"plug-in {place}, fails: {type(error).__name__}: {error}", BAD_INPUT)
    sys.exit(code if isinstance(code, int) else 0)


def carried_out(arguments: list[str] | None) -> Any:
    """Run a command and return its exit code; without any the help is shown."""
    try:
        return app.main(arguments, prog_name="armid", standalone_mode=False, obj=arguments or sys.argv[1:])
    except click.exceptions.NoArgsIsHelpError as error:
        with while_read(sys.stdout):
            print(error.format_message(), flush=True)
        return BAD_INPUT


def stop(sentence: str, code: int) -> None:
    tell(f"armid: {on_a_line(sentence)}")
    sys.exit(code)
