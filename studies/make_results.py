"""Make the folders of `results/`; nothing else writes there.

    python studies/make_results.py NAME ...           run the commands of each NAME into out/NAME, then copy
    python studies/make_results.py --copy NAME ...    run nothing: copy what out/NAME holds
    python studies/make_results.py                    show the names and their commands

`out/NAME` holds all that the commands write; it is not committed. `results/NAME` gets what can be read without running
anything: tables (CSV), pages (Markdown), report.json or result.json, and the figures that README.md or a guide shows,
as PNG of 90 dpi in 256 colours. A page loses its other figures and says once which command makes them.

Run it with the Python that armid is installed in. An interrupted study goes on where it was. `armid import` has to
bring the records of `emps` and `dfki` into out/campaigns first.
"""

import argparse
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
DPI = 90
COPIED = ("*.csv", "*.md", "report.json", "result.json")
# A figure on a page; that of a study has a heading above and its words below.
FIGURE = re.compile(r"(?:^### .*\n\n)?^!\[.*\]\((\S+)\)\n+(?:^[^#|!\n].*\n+)?", re.MULTILINE)


@dataclass(frozen=True)
class Recipe:
    """What makes a folder: commands, run in turn from the root, and the names of the figures that are committed.

    before: path -> the command that makes it, which is run first where the path is not there.
    """

    commands: tuple[str, ...]
    figures: tuple[str, ...] = ()
    before: tuple[tuple[str, str], ...] = ()


def study(name: str, *figures: str, file: str = "", before: tuple[tuple[str, str], ...] = ()) -> Recipe:
    """Return the recipe of a study: run it, then report it; file: of the study, where it is not a NAME.toml."""
    run, tell = f"armid study studies/{file or name}.toml --out out/{name}", f"armid report out/{name}"
    return Recipe((run, tell), figures, before)


def scored(name: str, *figures: str, before: tuple[tuple[str, str], ...]) -> Recipe:
    """Return the recipe of a study of blind campaigns: run it, then score it against their key."""
    campaigns = before[-1][0]
    score = f"python studies/blind/score.py out/{name} --key {campaigns}.key.json --out out/{name}"
    return Recipe((f"armid study studies/{name}.toml --out out/{name}", score), figures, before)


def loop(name: str, *figures: str, campaign: str = "", more: tuple[str, ...] = ()) -> Recipe:
    """Return the recipe of a closed loop; campaign: its folder (studies/campaigns/NAME where none is given)."""
    return Recipe((f"armid close-loop {campaign or f'studies/campaigns/{name}'} --out out/{name}", *more), figures)


EMPS = "armid identify out/campaigns/emps --effects coulomb,viscous,torque_offset"
STAND, BLIND, FAMILIES = "python studies/test_stand.py", "studies/campaigns/blind", "studies/campaigns/families"
ADVICE, ADVISED = f"{BLIND}_advice", f"{BLIND}_advised"
RECIPES = {
    "advised": scored("advised", "advice", before=(
        (ADVICE, f"{STAND} advice {ADVICE} --seed 7"),
        ("out/advice/reports", "armid study studies/advice.toml --out out/advice"),
        ("out/advice/reports", "armid export reports out/advice out/advice/reports"),
        (ADVISED, f"{STAND} advised {ADVISED} --seed 7 --base {ADVICE} --reports out/advice/reports"),
    )),
    "benchmark": study("benchmark", "ecdf", "critical_difference_0_3_deg_s"), "best_chain": study("best_chain"),
    "coverage": Recipe(("python studies/interval_coverage.py --out out/coverage",)),
    "blind": scored("blind", "held_out", before=((BLIND, f"{STAND} blind {BLIND} --seed 179"),)),
    "cramer_rao": study("cramer_rao", "cramer_rao"), "fitness": study("fitness", "fitness"),
    "dfki_pendulum": loop("dfki_pendulum", "residuals", campaign="out/campaigns/dfki"),
    "emps": loop("emps", "residuals", campaign="out/campaigns/emps", more=(
        "python studies/measured/emps/inverse_model.py out/campaigns/emps out/emps/inverse_model.md",
    )),
    "emps_identified": Recipe((f"{EMPS} --fitness rmse --out out/emps_identified",)),
    "families": scored("families", before=((FAMILIES, f"python studies/stand/families.py {FAMILIES} --seed 181 "
                                            "fault=200 constant=100 constants=100 two=100 three=100 control=200"),)),
    "four_strokes": loop("four_strokes", "parameters"), "one_stroke": loop("one_stroke", "parameters"),
    "landscape": Recipe(("python studies/suite/landscape.py --out out/landscape",), ("landscape",)),
    "measured": Recipe(("python studies/measured/run.py --data out/data --out out/measured",)),
    "paper_arm": Recipe(("armid identify studies/campaigns/paper_arm --out out/paper_arm",), ("fit",)),
    "rocking_shell": loop("rocking_shell", "motion", "probabilities"),
    "suite": study("suite", "attained", file="suite/suite"), "suite_long": study("suite_long", file="suite/long"),
    "suite_tuned": study("suite_tuned", file="../out/tuned/tuned", before=(
        ("out/tuned/tuned.toml", "armid tune studies/suite/suite.toml --configurations 10 --out out/tuned"),)),
    "table1": study("table1", "table1", "valley_noise_free"), "table1_short": study("table1_short"),
    "table2": study("table2", "table2"),
}  # fmt: skip


def run(recipe: Recipe) -> None:
    """Run what makes a folder; the first command that fails ends the program."""
    absent = {path for path, _ in recipe.before if not (ROOT / path).exists()}
    for command in (*(command for path, command in recipe.before if path in absent), *recipe.commands):
        print(f"$ {command}", flush=True)
        program, *words = shlex.split(command)
        subprocess.run([sys.executable, *(["-m", "armid"] if program == "armid" else []), *words], cwd=ROOT, check=True)


def copy(name: str, recipe: Recipe) -> None:
    """Replace results/NAME by what of out/NAME is committed."""
    made, target = ROOT / "out" / name, ROOT / "results" / name
    files = [path for pattern in COPIED for path in sorted(made.glob(pattern))]
    if not files:
        sys.exit(f"make_results: out/{name} holds no result")
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    kept = {f"{figure}.png" for figure in recipe.figures}
    for path in files:
        text = path.read_text(encoding="utf-8")
        (target / path.name).write_text(page(text, name, kept) if path.name == "report.md" else text, encoding="utf-8")
    for figure in recipe.figures:
        shrink(made / f"{figure}.png", target / f"{figure}.png")
    print(f"results/{name}: {sum(path.stat().st_size for path in target.iterdir()) / 1e6:.2f} MB", flush=True)


def page(text: str, name: str, kept: set[str]) -> str:
    """Return a page without the figures that are not kept, with one line on the command that makes them."""
    told = f"Made by `python studies/make_results.py {name}`; figures and the page report.html are then in out/{name}."
    text = re.sub(r"(?<=[ `])results/", "out/", text)
    shown = FIGURE.sub(lambda found: found[0] if found[1] in kept else "", text)
    less = re.sub(r"^## .*\n+(?=## |\Z)", "", shown, flags=re.MULTILINE).rstrip() + "\n"
    told_here = re.sub(r"^Made from the stored results by .*", told, less, flags=re.MULTILINE)
    return told_here if told_here != less else f"{less}\n{told}\n"


def shrink(path: Path, target: Path) -> None:
    """Write a figure at 90 dpi in 256 colours, none of them far from the one that was drawn."""
    drawn = Image.open(path)
    size = tuple(round(side * DPI / drawn.info["dpi"][0]) for side in drawn.size)
    small = drawn.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    few = small.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(target, optimize=True, dpi=(DPI, DPI))


def main(words: Sequence[str]) -> None:
    """Make the folders that the command line names."""
    parser = argparse.ArgumentParser(description="Make the folders of results/.", allow_abbrev=False)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(RECIPES))
    parser.add_argument("--copy", action="store_true", help="run nothing: copy what out/NAME holds")
    options = parser.parse_args(words)
    for name in set(options.names) - set(RECIPES):
        parser.error(f"{name}: one of {', '.join(RECIPES)} is expected")
    for name in options.names:
        if not options.copy:
            run(RECIPES[name])
        copy(name, RECIPES[name])
    for name, recipe in RECIPES.items() if not options.names else ():
        print(name, *(command for _, command in recipe.before), *recipe.commands, sep="\n    ")


if __name__ == "__main__":
    main(sys.argv[1:])
