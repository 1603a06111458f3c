"""The commands on a campaign: `armid simulate`, `identify`, `identifiability` and `close-loop`."""

import json
import sys
from pathlib import Path
from typing import Any

import click

from armid.cli.options import (
    accuracy_of,
    accuracy_option,
    assignments,
    campaign_argument,
    command,
    completes,
    effects_option,
    examples,
    give,
    given,
    numbers,
    out_option,
    plugin_option,
    problem_options,
    say,
    seed_option,
    speaks,
    tell,
    threads_option,
    value_of,
)
from armid.cli.report import show_and_save
from armid.errors import INTERRUPTED, ArmidError, refuse_unless_known
from armid.progress import status_line
from armid.report.result import IDENTIFIABILITY, IDENTIFICATION, LOOP, refuse_unwritable


@command("simulate", epilog=examples(
    "armid simulate studies/campaigns/paper_arm --set p0=3.1e6 --out out/simulated",
    "armid simulate CAMPAIGN --effects coulomb --set coulomb.level=40 --out DIR",
))  # fmt: skip
@campaign_argument
@out_option("Folder to write to.", required=True)
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Value of a parameter, SI. Repeatable.")
@effects_option
@accuracy_option
@plugin_option
def simulate_command(
    campaign: Path, out: Path, settings: tuple[str, ...], effects: str, accuracy: str, plugins: tuple[str, ...]
) -> None:
    """Simulate every record of a campaign.

    Writes DIR/<record's file name>. Columns: time_s (the record's times from 0 on; the even grid of a record whose
    times are irregular), the states, and all outputs of the plant, SI. A parameter that is not set takes the value
    that the campaign fixes, else its nominal one.
    """
    from armid.api import simulate

    known = given(effects, plugins)
    simulated = simulate(campaign, parameters=numbers(settings, "--set"), accuracy=accuracy_of(accuracy),
                         effects=known["effects"], plugins=known["plugins"])  # fmt: skip
    files = simulated.save(out)
    units = {name: p.unit for name, p in simulated.model.parameters.items()}
    say(*(f"{name} = {value:.9g} {units[name]}".removesuffix(" 1") for name, value in simulated.parameters.items()))
    for record in simulated.campaign.records:
        if record.irregularity is not None:
            say(f"{record.file}: on its even grid of {record.manoeuvre.interval:.6g} s, as its times are irregular")
    say(f"wrote {len(files)} files to {out}")
    give(parameters=simulated.parameters, folder=out, files=files)


DEFAULT_IDENTIFIER = (
    "pso+least_squares: no other of 20 identifiers and chains ends nearer to the truth in results/benchmark, and its "
    "swarm looks at the whole box; cmaes for a fitness that is not a sum of squares"
)


@command("identify", epilog=examples(
    "armid identify studies/campaigns/paper_arm --out out/paper_arm",
    "armid identify studies/campaigns/paper_arm --paper",
    "armid identify CAMPAIGN --identifier least_squares --fitness likelihood",
    "armid identify CAMPAIGN --effects coulomb --bounds coulomb.level=0:80 --fix n=1.4",
))  # fmt: skip
@problem_options
@click.option(
    "--identifier", show_default=DEFAULT_IDENTIFIER, shell_complete=completes("identifiers"),
    help="Who searches: see `armid list identifiers`; multistart:LOCAL; or a chain such as pso+bobyqa.",
)  # fmt: skip
@click.option(
    "--option", "options", multiple=True, metavar="NAME=VALUE",
    help="Option of the identifier, such as velocity_limit=0.2 of pso; of a chain: share=0.5 (of the budget, "
    "0.5:0.3 for three phases), pso.velocity_limit=0.2; `armid list identifiers --long`. Repeatable.",
)  # fmt: skip
@click.option("--fitness", show_default="rmse", shell_complete=completes("fitness"),
              help="What is minimised: see `armid list fitness`; rmse:OUTPUT for one output.")  # fmt: skip
@click.option(
    "--budget", type=int, show_default="3,000; 12,000 with --paper or --identifier",
    help="Simulations: one candidate through all train records counts as one.",
)  # fmt: skip
@click.option(
    "--target", type=float,
    help="Stop when reached: the similarity degree for a similarity, else the value of the fitness.",
)  # fmt: skip
@click.option(
    "--paper", is_flag=True,
    help="As the paper does, where no other option is given: pso, similarity, 12,000 simulations, --window 0:0.7.",
)  # fmt: skip
@click.option(
    "--no-interval",
    is_flag=True,
    help="Give no intervals: skip the bootstrap of a fitness that is not a sum of squares.",
)
@seed_option
@threads_option
@out_option("Folder for report.html, report.md, result.json and the figures.")
@accuracy_option
def identify_command(
    campaign: Path, identifier: str | None, options: tuple[str, ...], fitness: str | None, budget: int | None,
    target: float | None, paper: bool, no_interval: bool, seed: int, threads: int, out: Path | None, accuracy: str,
    **problem: Any,
) -> None:  # fmt: skip
    """Identify parameters from the train records.

    The result is judged on train and holdout. Prints parameters with 95 % intervals (from sensitivities and measured
    noise; for a fitness that is not a sum of squares from 100 to 400 draws of the noise, each minimised again; an
    interval not to rely on is struck through), warnings in words, and errors. Without --out nothing is written. Ctrl-C
    ends the search, judges the best so far, and exits with 130.
    """
    from armid.api import PAPER_FITNESS, USUAL_FITNESS
    from armid.api import identify as run
    from armid.estimation.identify import WAS_INTERRUPTED
    from armid.problem.fitness import SIMILARITIES

    minimised = fitness or (PAPER_FITNESS if paper else USUAL_FITNESS)
    goal = 1.0 - target if target is not None and minimised.partition(":")[0] in SIMILARITIES else target
    named = {name: value_of(value) for name, value in assignments(options, "--option").items()}
    refuse_unwritable(out, IDENTIFICATION.file)
    identification = run(campaign, None, None, minimised, identifier, budget, seed, goal, accuracy_of(accuracy),
                         speaks(), options=named, paper=paper, interval=not no_interval, threads=threads,
                         **given(**problem))  # fmt: skip
    show_and_save(identification, out)
    if identification.stopped == WAS_INTERRUPTED:
        sys.exit(INTERRUPTED)


@command("identifiability", short_help="Say how well the records pin down the parameters.", epilog=examples(
    "armid identifiability studies/campaigns/paper_arm --window 0:0.7 --out out/identifiability",
    "armid identifiability CAMPAIGN --from out/paper_arm/result.json --rank worst",
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
    shell_complete=completes(words=("volume", "worst", "shrinkage")),
    help="What the next manoeuvre is chosen by: all parameters together, the worst, or the largest change.",
)  # fmt: skip
@out_option("Folder for identifiability.html, identifiability.json and the figures.")
@accuracy_option
def identifiability_command(
    campaign: Path, at: str, source: Path | None, noise: float | None, rank: str, out: Path | None, accuracy: str,
    **problem: Any,
) -> None:  # fmt: skip
    """Say what the train records tell about the parameters, and what one more manoeuvre would buy.

    Cramer-Rao intervals, parameters that move together, the profile likelihood of each parameter. Holdout records are
    not looked at.
    """
    from armid.api import examine
    from armid.estimation.examine import LEAST_EXAMINED, RANKINGS

    refuse_unless_known(rank, RANKINGS, f"--rank '{rank}'")
    if noise is not None and not LEAST_EXAMINED <= noise <= 1.0 / LEAST_EXAMINED:
        expected = f"a finite number above 0 is expected, {LEAST_EXAMINED:g} to {1.0 / LEAST_EXAMINED:g}"
        raise ArmidError(f"--noise is {noise:g}, {expected}")
    if at and source is not None:
        raise ArmidError("--at and --from are both given: one point is expected")
    refuse_unwritable(out, IDENTIFIABILITY.file)
    point, where = numbers(at.split(","), "--at") if at else None, "--at"
    if source is not None:
        point, where = read_point(source), f"--from {source}"
    examination = examine(campaign, None, None, point, noise, rank, accuracy_of(accuracy), speaks(), where=where,
                          **given(**problem))  # fmt: skip
    show_and_save(examination, out)


def read_point(path: Path) -> dict[str, float]:
    try:
        parameters = json.loads(path.read_text(encoding="utf-8"))["parameters"]
        return {str(name): float(entry["value"]) for name, entry in parameters.items()}
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise ArmidError(f"--from {path} holds no parameters with values: a result.json of `armid identify` is "
                         "expected") from error  # fmt: skip


PROGRESS = "progress.jsonl"


@command("close-loop", short_help="Find the effects that the declared model lacks.", epilog=examples(
    "armid close-loop studies/campaigns/four_strokes --out out/four_strokes",
    "armid close-loop CAMPAIGN --out DIR --candidates coulomb,viscous,stribeck",
    "armid close-loop CAMPAIGN --out DIR --plugin mine.py:my_drag",
))  # fmt: skip
@problem_options
@out_option("Folder for report.html, report.md, report.json and the figures.", required=True)
@click.option("--candidates", default="", metavar="NAME,NAME", help="Effects to look for. [default: all that apply]",
              shell_complete=completes("effects", commas=True))  # fmt: skip
@click.option("--without", default="", metavar="NAME,NAME", help="Effects not to look for.",
              shell_complete=completes("effects", commas=True))  # fmt: skip
@click.option("--no-curve", is_flag=True, help="Do not recover the missing signal where no effect will do.")
@click.option(
    "--within",
    type=float,
    default=0.05,
    show_default=True,
    metavar="SHARE",
    help="Trust a parameter whose 95 % interval is within this share of its value.",
)
@seed_option
@threads_option
def close_loop_command(
    campaign: Path, out: Path, candidates: str, without: str, no_curve: bool, within: float, seed: int, threads: int,
    **problem: Any,
) -> None:  # fmt: skip
    """Find the effects that the declared model lacks, and report the error before and after.

    Computes the probability of each missing effect, of each fault of a record and of something without a name from the
    train records. Takes the most probable model in which every part has a name. Simulates the held-out records after
    the last decision, and withdraws steps that increase their error. --bounds and --fix also take parameters of
    candidates. Searches start from evenly spread points, so nothing is random. Every verdict exits with 0. After an
    interruption the same command continues from the fits in DIR/progress.jsonl.
    """
    from armid.api import close_loop

    named = [name for name in candidates.split(",") if name.strip()] or None
    refuse_unwritable(out, LOOP.file)
    kept = out / PROGRESS
    try:
        with status_line(speaks()) as show_status:
            loop = close_loop(campaign, None, named, threads=threads, told=show_status,
                              without=without, curve=not no_curve, progress=kept, within=within,
                              **given(**problem))  # fmt: skip
        show_and_save(loop, out)
    except BaseException:
        if kept.exists():
            tell(f"armid: what was fitted is kept in {kept}: the same command goes on from there")
        raise
    kept.unlink(missing_ok=True)
