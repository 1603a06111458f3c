"""`armid new`: a commented starting file."""

import os.path
from pathlib import Path

import click

from armid.cli.new_files import NewFiles
from armid.cli.options import chosen, examples
from armid.model import ArmidError
from armid.registry import load_registry

CATALOGUES = {"effect": "effects", "fitness": "fitness", "identifier": "identifiers", "plant": "plants"}


@click.command("new", short_help="Write a starting file of your own.", epilog=examples(
    "armid new effect my_drag", "armid check my_drag.py:my_drag", "armid new campaign my_axis --out studies/campaigns",
))  # fmt: skip
@click.argument("kind", metavar="effect|fitness|identifier|plant|campaign")
@click.argument("name", metavar="NAME")
@click.option("--out", default=".", show_default="this folder", type=click.Path(path_type=Path), metavar="FOLDER",
              help="Folder to write to.")
def new_command(kind: str, name: str, out: Path) -> None:
    """Write a commented starting file of your own that passes `armid check`.

    An effect, a fitness, an identifier or a plant becomes FOLDER/NAME.py, a Python file that declares NAME. A campaign
    becomes the folder FOLDER/NAME with campaign.toml and two small records, which are synthetic and say so. Nothing
    that exists is overwritten.
    """
    from armid.new import KINDS, check_new_name  # noqa: PLC0415 - other commands do not need it

    chosen(kind, dict.fromkeys(KINDS), "kind")
    taken = getattr(load_registry(), CATALOGUES[kind]) if kind in CATALOGUES else {}
    check_new_name(kind, name, taken)
    target = out / (f"{name}.py" if kind in CATALOGUES else name)
    if os.path.lexists(target):
        raise ArmidError(f"{target} exists already: another name, or another folder by --out, is expected")
    write(kind, name, target)
    print(f"wrote {target}; try: armid check {target}{f':{name}' if kind in CATALOGUES else ''}")


def write(kind: str, name: str, target: Path) -> None:
    """Write the file or the folder, whole or not at all."""
    from armid.new import campaign_text, python_file, synthetic_records  # noqa: PLC0415 - as above
    from armid.record import write_campaign  # noqa: PLC0415

    if kind not in CATALOGUES:
        write_campaign(target, campaign_text(name), synthetic_records())
        return
    with NewFiles(target.parent) as files:
        files.path(target.name).write_text(python_file(kind, name), encoding="utf-8")
