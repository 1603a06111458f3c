"""The pages of the site that are made: references from the code, the gallery, figures of results.

MkDocs calls `on_files` and `on_page_markdown`. A page that lies elsewhere in the repository is shown from there.
"""

import json
import re
import runpy
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import click
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import armid
from armid.cli.main import app
from armid.record.schema import CampaignSheet, Known, Override, RecordSheet, default_of, is_required
from armid.study.spec import CaseSpec, EntrySpec, LoopSpec, ManoeuvreSpec, RandomCasesSpec, StudySpec, SuiteSpec

ROOT = Path(__file__).parents[2]
# A link to a file of the repository; an image keeps its place on the site, a file is named.
OUTSIDE = re.compile(r"(!?)\[([^\]]*)\]\((?:\.\./)+((?:results|studies|src|tests|\.github)/[^)#]*|\.github[^)#]*)\)")
# A place of a page where a file of the repository, or the table of ports, is inserted.
INSERTED = re.compile(r"<!-- (ports|file)(?: (\S+))? -->")
FIGURE = r"!\[([^\]]*)\]\({name}\.png\)\n*([^#!|\n].*)?"
KEYS = ("Made from the definitions that armid reads the files with. `armid schema campaign` and `armid schema study` "
        "print the same as JSON Schema, for editors.")  # fmt: skip
# Heading and sheet of each table of a file.
CAMPAIGN = (("The file", CampaignSheet), ("`[[records]]`", RecordSheet), ("`[parameters.NAME]`", Override),
            ("`[priors]`, of a parameter or constant", Known))  # fmt: skip
STUDY = (("The file", StudySpec), ("`[[identifiers]]`", EntrySpec), ("`[[cases]]`", CaseSpec),
         ("`manoeuvres` of a case", ManoeuvreSpec), ("`[random_cases]`", RandomCasesSpec), ("`[suite]`", SuiteSpec),
         ('A study with `kind = "close_loop"`', LoopSpec))  # fmt: skip


def on_files(files: Files, config: MkDocsConfig) -> Files:
    made = {"reference/keys.md": keys_page(), "reference/commands.md": commands_page(), "gallery.md": gallery_page(),
            "reference/python.md": python_page(), "inside.md": elsewhere("src/armid/README.md"),
            "changes.md": elsewhere("CHANGELOG.md")}  # fmt: skip
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    for path in (ROOT / "results").rglob("*.png"):
        files.append(File.generated(config, path.relative_to(ROOT).as_posix(), abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    up = "../" * page.file.src_uri.count("/")
    markdown = INSERTED.sub(
        lambda m: ports_table() if m[1] == "ports" else f"```python\n{elsewhere(m[2])}```", markdown
    )
    return OUTSIDE.sub(lambda m: f"![{m[2]}]({up}{m[3]})" if m[1] else f"{m[2]} (`{m[3]}`)", markdown)


def elsewhere(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def ports_table() -> str:
    """Return which effects of the library act at which port."""
    names: dict[str, set[str]] = {}
    for effect in armid.EFFECTS.values():
        for form in effect.every_form:
            for port in form.adds:
                names.setdefault(port, set()).add(effect.name)
    rows = [f"| `{port}` | {', '.join(f'`{n}`' for n in sorted(own))} |" for port, own in sorted(names.items())]
    return "\n".join(["| port | effects |", "|---|---|", *rows])


def keys_page() -> str:
    lines = ["# Keys of campaign.toml and of a study", "", KEYS]
    for file, sheets in (("campaign.toml", CAMPAIGN), ("A study", STUDY)):
        lines += ["", f"## {file}"]
        for heading, sheet in sheets:
            lines += ["", f"### {heading}", "", "| key | value | default | meaning |", "|---|---|---|---|"]
            lines += [key_row(f) for f in fields(sheet) if f.metadata]
    keys = [(p.name, k) for p in armid.PLANTS.values() for k in p.keys]
    lines += ["", "## Keys of plants", "", "In each entry of `[[records]]`, and in each manoeuvre of a study.", "",
              "| plant | key | value | sets the constant |", "|---|---|---|---|"]  # fmt: skip
    for plant, k in keys:
        value = "true or false" if k.boolean else f"a number from {k.low:g} to {k.high:g}" if k.low is not None else ""
        lines.append(f"| {plant} | `{k.key}`{', required' if k.required else ''} | {value} | {k.constant} |")
    return "\n".join(lines) + "\n"


def key_row(f: Any) -> str:
    default = default_of(f)
    shown = "required" if is_required(f) else "" if default is None else f"`{json.dumps(default)}`"
    cells = (f"`{f.name}`", f.metadata["expected"], shown, f.metadata["meaning"])
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def commands() -> Iterator[tuple[str, click.Command]]:
    context = click.Context(app, info_name="armid")
    for name in app.list_commands(context):
        command = app.get_command(context, name)
        if isinstance(command, click.Group):
            yield from ((f"{name} {inner}", each) for inner, each in command.commands.items())
        elif command is not None:
            yield name, command


def commands_page() -> str:
    parts = ["# Commands\n"]
    for name, command in commands():
        text = command.get_help(click.Context(command, info_name=f"armid {name}", max_content_width=100))
        parts.append(f"## armid {name}\n\n```text\n{text.rstrip()}\n```\n")
    return "\n".join(parts)


def python_page() -> str:
    lines = ["# Python", "", "Every name is imported from `armid`."]
    for module, names in armid.WHERE.items():
        lines += ["", f"## {module}", *(f"\n::: {module}.{name}" for name in names)]
    return "\n".join(lines) + "\n"


def gallery_page() -> str:
    recipes = runpy.run_path(str(ROOT / "studies" / "make_results.py"))["RECIPES"]
    parts = ["# Gallery\n", "Each figure with the commands that make it, run from the root of the repository.\n"]
    for name, recipe in recipes.items():
        report = ROOT / "results" / name / "report.md"
        text = report.read_text(encoding="utf-8") if recipe.figures and report.is_file() else ""
        for figure in recipe.figures:
            found = re.search(FIGURE.format(name=re.escape(figure)), text)
            title, caption = (found[1] or figure, found[2] or "") if found else (figure.replace("_", " "), "")
            lines = "\n".join([*(command for _, command in recipe.before), *recipe.commands])
            parts.append(f"## {name}: {title}\n\n![{title}](results/{name}/{figure}.png)\n\n{caption}\n\n"
                         f"```\n{lines}\n```\n")  # fmt: skip
    return "\n".join(parts)
