"""`armid identifiability`: how well the records of a campaign pin down the parameters."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np
from numpy.typing import NDArray

from armid.cli.options import (
    accuracy_of,
    accuracy_option,
    assignments,
    examples,
    number,
    opened,
    out_option,
    problem_options,
)
from armid.cli.report import IDENTIFIABILITY, refuse_unwritable, show_and_write
from armid.errors import ArmidError, nearest

if TYPE_CHECKING:
    from armid.problem.space import Space


Array = NDArray[np.float64]
# The rounding of a speed is larger.
LEAST_NOISE = 1e-15


@click.command("identifiability", short_help="Say how well the records pin down the parameters.", epilog=examples(
    "armid identifiability studies/campaigns/paper_arm --window 0:0.7 --out results/identifiability",
    "armid identifiability CAMPAIGN --from results/paper_arm/result.json --rank worst",
))  # fmt: skip
@problem_options
@click.option(
    "--at", default="", metavar="NAME=VALUE,...", help="Examine this point, SI, instead of the least-squares estimate."
)
@click.option(
    "--from", "source", type=click.Path(path_type=Path), metavar="RESULT.json",
    help="Examine the point that `armid identify` found.",
)  # fmt: skip
@click.option(
    "--noise", type=float, metavar="RMS",
    help="White noise to assume for every record, rad/s or m/s, in place of what was measured.",
)  # fmt: skip
@click.option(
    "--rank", default="volume", show_default=True, metavar="volume|worst|shrinkage",
    help="What the next manoeuvre is chosen by: all parameters together, the worst, or the largest change.",
)  # fmt: skip
@out_option("Folder for identifiability.html, identifiability.json and the figures.")
@accuracy_option
def identifiability_command(
    campaign: Path, effects: str, bounds: tuple[str, ...], fix: tuple[str, ...], at: str, source: Path | None,
    window: str, noise: float | None, rank: str, out: Path | None, accuracy: str, plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """Say what the train records tell about the parameters, and what one more manoeuvre would buy.

    Cramer-Rao intervals, parameters that move together, the profile likelihood of each parameter. Holdout records are
    not looked at.
    """
    from armid.estimation.design import SHRINKAGE, VOLUME, WORST
    from armid.estimation.examine import examine
    from armid.estimation.identifiability_document import figures_of, result_of

    if rank not in (VOLUME, WORST, SHRINKAGE):
        raise ArmidError(f"--rank '{rank}': {nearest(rank, (VOLUME, WORST, SHRINKAGE))}")
    if noise is not None and not LEAST_NOISE <= noise <= 1.0 / LEAST_NOISE:
        expected = f"a finite number above 0 is expected, {LEAST_NOISE:g} to {1.0 / LEAST_NOISE:g}"
        raise ArmidError(f"--noise is {noise:g}, {expected}")
    if at and source is not None:
        raise ArmidError("--at and --from are both given: one point is expected")
    given = opened(campaign, effects, plugins, window, bounds, fix)
    space = given.space()
    point = point_of(space, at, source)
    refuse_unwritable(out)
    found = examine(given.campaign, given.model, space, point, noise, rank, accuracy_of(accuracy))
    show_and_write(IDENTIFIABILITY, result_of(found), {}, out, figures_of(found))


def point_of(space: "Space", at: str, source: Path | None) -> Array | None:
    """Return the point that was asked for, SI, shape (n_free,); None where none was."""
    if at:
        given = {n: number(v, f"--at {n}") for n, v in assignments(at.split(","), "--at").items()}
        return free_values(space, given, "--at")
    return None if source is None else free_values(space, read_point(source), f"--from {source}")


def read_point(path: Path) -> dict[str, float]:
    """Return name -> value of the result of an identification.

    Raises ArmidError for a file that is none.
    """
    try:
        parameters = json.loads(path.read_text(encoding="utf-8"))["parameters"]
        return {str(name): float(entry["value"]) for name, entry in parameters.items()}
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise ArmidError(f"--from {path} holds no parameters with values: a result.json of `armid identify` is "
                         "expected") from error  # fmt: skip


def free_values(space: "Space", given: dict[str, float], where: str) -> Array:
    """Return the values of the free parameters in order; a fixed one may be named, its value stays as it is fixed."""
    for name in given:
        if name not in space.names:
            raise ArmidError(f"{where}: parameter '{name}' is not in the model: {nearest(name, space.names)}")
    missing = [name for name in space.free_names if name not in given]
    if missing:
        raise ArmidError(f"{where}: parameter '{missing[0]}' is free and has no value there: one is expected")
    return np.array([given[name] for name in space.free_names])
