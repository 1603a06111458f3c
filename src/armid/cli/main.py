"""The command `armid`: its sub-commands, and how errors reach the user."""

import sys
import warnings
from typing import Any

import click

from armid.cli.check import bench_command, check_command
from armid.cli.close_loop import close_loop_command
from armid.cli.identifiability import identifiability_command
from armid.cli.identify import identify_command
from armid.cli.listing import list_command
from armid.cli.new import new_command
from armid.cli.options import examples
from armid.cli.report import report_command
from armid.cli.simulate import simulate_command
from armid.cli.study import study_command
from armid.cli.transfer import export_group, import_group
from armid.errors import ArmidError
from armid.registry import place_in_plugin

BAD_INPUT, INTERRUPTED = 2, 130


EPILOG = examples(
    "armid new campaign my_axis                   a folder to put your own records into",
    "armid identify my_axis --out results/axis    its parameters, with intervals",
    "armid close-loop my_axis --out results/loop  what its declared equations lack",
    "armid study studies/table1_short.toml        the paper's Table I, small",
)


@click.group("armid", epilog=EPILOG, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="armid")
def app() -> None:
    """Identify the unknown parameters of a driven arm from its measured motion.

    CAMPAIGN is a folder with campaign.toml and one CSV file a record, or that campaign.toml. Numbers are SI unless a
    name says otherwise.

    Exit codes: 0 done, whatever was found; 1 a point of a contract does not hold (`armid check`); 2 bad input, told in
    one sentence, nothing half-written; 130 interrupted by Ctrl-C, what was found so far is kept.
    """


for command in (
    simulate_command, identify_command, close_loop_command, identifiability_command, list_command, check_command,
    bench_command, study_command, report_command, import_group, export_group, new_command,
):  # fmt: skip
    app.add_command(command)


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Print a warning as one line."""
    print(f"armid: warning: {message}", file=sys.stderr)


def main(arguments: list[str] | None = None) -> None:
    """Run a command; bad input gives one sentence and exit code 2."""
    warnings.showwarning = show_warning
    try:
        code = app.main(arguments, prog_name="armid", standalone_mode=False, obj=arguments or sys.argv[1:])
    except ArmidError as error:
        stop(str(error), BAD_INPUT)
    except (click.Abort, KeyboardInterrupt):
        stop("interrupted", INTERRUPTED)
    except click.exceptions.NoArgsIsHelpError as error:
        print(error.format_message())
        sys.exit(BAD_INPUT)
    except click.ClickException as error:
        stop(f"{error.format_message()} (see --help)", BAD_INPUT)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except OSError as error:
        stop(f"{error.filename or 'a file'} cannot be used: {error.strerror or error}", BAD_INPUT)
    except MemoryError as error:
        stop(f"not enough memory: {error}; a smaller population, fewer records or shorter ones are expected", BAD_INPUT)
    except Exception as error:
        if isinstance(error.__cause__, KeyboardInterrupt):
            # that is how Ctrl-C comes out of a compiled function
            stop("interrupted", INTERRUPTED)
        place = place_in_plugin(error)
        if place is None:
            raise
        stop(f"plug-in {place}, fails: {type(error).__name__}: {error}", BAD_INPUT)
    sys.exit(code if isinstance(code, int) else 0)


def stop(sentence: str, code: int) -> None:
    """Print a sentence to the error stream and leave."""
    print(f"armid: {sentence}", file=sys.stderr)
    sys.exit(code)
