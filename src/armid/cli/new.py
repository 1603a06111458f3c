"""`armid new`: a commented starting file; `armid schema`: what such a file of TOML may hold, for editors."""

import ast
import json
import os.path
import re
import sys
import sysconfig
from collections.abc import Collection
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from string import Template

import click
import numpy as np
from numpy.typing import NDArray

from armid.cli.options import command, completes, examples, give, plugin_option, say
from armid.errors import ArmidError, nearest, quoted
from armid.model.effect import RESERVED
from armid.model.parameter import check_name
from armid.registry import load_registry
from armid.report.result import NewFiles

CATALOGUES = {"effect": "effects", "fitness": "fitness", "identifier": "identifiers", "plant": "plants",
              "analysis": "analyses"}  # fmt: skip
# Kind and --style -> the template that replaces the kind's own.
STYLES = {("identifier", "function"): "identifier_function"}
CAMPAIGN, STUDY = "campaign", "study"
KINDS = (*CATALOGUES, CAMPAIGN, STUDY)
# What the kinds that are no Python file become, and the command that tries them.
FILES = {CAMPAIGN: ("{}", "armid check {}"), STUDY: ("{}.toml", "armid study {}")}
TRYING = {"analysis": "armid report out/STUDY --plugin {}"}
FOLDER_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
Array = NDArray[np.float64]
# The made-up axis: inertia [kg m2], viscous friction [N m s/rad], noise of the speed [rad/s].
INERTIA, FRICTION, NOISE = 0.05, 0.03, 0.01
INTERVAL, N_SAMPLES = 0.005, 401
# File -> size [N m] and frequency [Hz] of the drive, seed of the noise.
RECORDS = {"synthetic_train.csv": (1.0, 0.8, 1), "synthetic_holdout.csv": (0.7, 1.3, 2)}
FIRST_STEP = 0.1
DIGITS = 6


@command("new", short_help="Write a starting file of your own.", epilog=examples(
    "armid new effect my_drag", "armid check my_drag.py:my_drag", "armid new campaign my_axis --out studies/campaigns",
    "armid new campaign my_motor --from first.csv second.csv",
))  # fmt: skip
@click.argument("kind", metavar="|".join(KINDS), shell_complete=completes(words=KINDS))
@click.argument("name", metavar="NAME")
@click.option(
    "--style", default="", metavar="function",
    help="Of an identifier: function, for any optimiser that is not an algorithm of pymoo (scipy, nevergrad).",
)  # fmt: skip
@click.option(
    "--from", "files", multiple=True, type=click.Path(path_type=Path), metavar="FILE",
    help="Of a campaign: your CSV files, all after one --from. The meaning of each column is guessed.",
)  # fmt: skip
@click.option(
    "--out", default=".", show_default="this folder", type=click.Path(path_type=Path), metavar="FOLDER",
    help="Folder to write to.",
)  # fmt: skip
@click.argument("more", nargs=-1, type=click.Path(path_type=Path), metavar="[FILE]...")
def new_command(kind: str, name: str, style: str, files: tuple[Path, ...], out: Path, more: tuple[Path, ...]) -> None:
    """Write a commented starting file of your own that works as it stands.

    An effect, a fitness, an identifier, a plant or an analysis becomes FOLDER/NAME.py, a Python file that declares
    NAME. `armid check` tries it, `armid report` an analysis. A study becomes FOLDER/NAME.toml, which `armid study`
    runs. A campaign becomes the folder FOLDER/NAME with campaign.toml and two small records, which are synthetic and
    say so; with --from FILE... it has copies of your records, and a comment at each guess. Nothing that exists is
    overwritten.
    """
    from armid.record import write_campaign

    if kind not in KINDS:
        raise ArmidError(f"kind '{kind}' is not known: {nearest(kind, KINDS)}")
    if style and (kind, style) not in STYLES:
        raise ArmidError(f"--style '{style}' of kind '{kind}': an identifier has the style 'function'")
    if (files or more) and kind != CAMPAIGN:
        raise ArmidError(f"--from of kind '{kind}': records are expected of a campaign alone")
    if more and not files:
        raise ArmidError(f"{quoted(str(more[0]))} stands behind the name: --from before the files of a campaign is "
                         "expected")  # fmt: skip
    template = STYLES.get((kind, style), kind)
    taken = set(getattr(load_registry(), CATALOGUES[kind]) if kind in CATALOGUES else ())
    if kind == "analysis":
        from armid.study.analyses.catalogue import ANALYSES

        taken |= {a.name for a in ANALYSES}
    check_new_name(kind, name, taken, template)
    file, trying = FILES.get(kind, ("{}.py", f"{TRYING.get(kind, 'armid check {}')}:{name}"))
    target = out / file.format(name)
    if os.path.lexists(target):
        raise ArmidError(f"{target} exists already: another name, or another folder by --out, is expected")
    if kind == CAMPAIGN:
        from armid.cli.guess import guessed_campaign

        records = [*files, *more]
        text, tables = guessed_campaign(name, records) if records else (campaign_text(name), synthetic_records())
        write_campaign(target, text, tables)
    else:
        with NewFiles(out) as new_files:
            text = filled("study.toml.txt", name=name) if kind == STUDY else python_file(template, name)
            new_files.path(target.name).write_text(text, encoding="utf-8")
    check = trying.format(target)
    say(f"wrote {target}; try: {check}")
    give(wrote=target, check=check)


@command("schema", short_help="Print the JSON Schema of a campaign or a study.", epilog=examples(
    "armid schema study > study.schema.json", "armid schema campaign --plugin mine.py:my_plant",
))  # fmt: skip
@click.argument("what", metavar="campaign|study", shell_complete=completes(words=(CAMPAIGN, STUDY)))
@plugin_option
def schema_command(what: str, plugins: tuple[str, ...]) -> None:
    """Print the JSON Schema of campaign.toml or of a study's file.

    An editor that knows it completes keys and names, and marks what is wrong. It is made of the definitions that armid
    reads these files with, and offers what is registered. With taplo or Even Better TOML the first line of the file is
    `#:schema ./study.schema.json`.
    """
    from armid.record.schema import CampaignSheet, json_schema, key_schema, sheet_schema
    from armid.study.spec import study_schema

    if what not in (CAMPAIGN, STUDY):
        raise ArmidError(f"schema '{what}' is not known: {nearest(what, (CAMPAIGN, STUDY))}")
    registry = load_registry(plugins)
    registered = {kind: getattr(registry, kind) for kind in ("plants", "effects", "identifiers")}
    keys = {key.key: key_schema(key) for plant in registry.plants.values() for key in plant.keys}
    schema = json_schema(sheet_schema(CampaignSheet) if what == CAMPAIGN else study_schema(), registered, keys)
    say(*json.dumps(schema, indent=2).splitlines())
    give(**schema)


def filled(file: str, **values: object) -> str:
    """Return a file of templates with values in place of their `$name`."""
    return Template((files("armid.cli") / "templates" / file).read_text(encoding="utf-8")).substitute(values)


def python_file(template: str, name: str) -> str:
    """Return the text of a Python file that declares one thing; template: a kind, or what STYLES names."""
    return filled(f"{template}.py.txt", name=name)


def check_new_name(kind: str, name: str, taken: Collection[str], template: str) -> None:
    """Refuse a name that a starting file could not have; taken: names of the same kind that are registered."""
    if kind in FILES:
        if not FOLDER_NAME.fullmatch(name) or name.endswith("."):
            raise ArmidError(f"{kind} '{name}' is not a usable name: letters, digits, '_', '-' and '.' are expected")
        return
    check_name(name, kind)
    if name in taken or (kind == "effect" and name in RESERVED):
        raise ArmidError(f"{kind} '{name}' is there already: another name is expected")
    if name in names_in(python_file(template, "_")):
        raise ArmidError(f"{kind} '{name}' cannot have this name, which the file itself uses: another is expected")
    module = find_spec(name)
    installed = module is not None and str(module.origin).startswith(tuple(sysconfig.get_paths().values()))
    if installed or name == "armid" or name in sys.stdlib_module_names:
        raise ArmidError(f"{kind} '{name}' cannot have this name: {name}.py would hide the module '{name}'")


def names_in(text: str) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Name):
            names.add(node.id)
        elif isinstance(node, ast.FunctionDef | ast.alias):
            names.add(getattr(node, "asname", None) or node.name)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
    return names


def campaign_text(name: str) -> str:
    return filled("campaign.toml.txt", name=name, inertia=INERTIA, friction=FRICTION, noise=NOISE)


def synthetic_records() -> dict[str, dict[str, Array]]:
    return {file: record(*arguments) for file, arguments in RECORDS.items()}


def record(size: float, frequency: float, seed: int) -> dict[str, Array]:
    """Return header -> values of one record: a drive that steps to and fro, and the speed with noise.

    J dv/dt = u - c v with u constant between samples is solved exactly: v' = v exp(-c dt/J) + u/c (1 - exp(-c dt/J)).
    """
    times = INTERVAL * np.arange(N_SAMPLES)
    drive = np.where(times < FIRST_STEP, 0.0, size * np.sign(np.cos(2.0 * np.pi * frequency * (times - FIRST_STEP))))
    kept = np.exp(-FRICTION * INTERVAL / INERTIA)
    speed = np.zeros(N_SAMPLES)
    for i in range(N_SAMPLES - 1):
        speed[i + 1] = kept * speed[i] + drive[i] / FRICTION * (1.0 - kept)
    measured = speed + NOISE * np.random.default_rng(seed).standard_normal(N_SAMPLES)
    columns = {"time_s": times, "angular_velocity_rad_s": measured, "drive_N_m": drive}
    return {header: np.round(values, DIGITS) for header, values in columns.items()}
