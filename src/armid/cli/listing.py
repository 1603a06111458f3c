"""`armid list`: what there is to choose from."""

import textwrap
from collections.abc import Callable, Iterable, Sequence
from inspect import signature
from shutil import get_terminal_size
from typing import Any

import click

from armid.cli.options import command, completes, examples, give, plugin_option, present, put, say, wants
from armid.errors import quoted, refuse_unless_known
from armid.model import Effect, Parameter, Plant, refusal_of
from armid.model.effects.sensor import sensor_effects
from armid.model.graph import returned_text
from armid.registry import KINDS, Registry, load_registry
from armid.report.document import Document, table

# Columns of a terminal that equations are broken to.
WIDTH = 110

COMPOSED = """\
multistart:LOCAL: a local one from ever new starts until the budget is used
GLOBAL+LOCAL[+LOCAL]: a chain, each phase from the best so far; options share=0.5 (0.5:0.3), NAME.OPTION=VALUE"""


def complete_name(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Complete the name of a thing of the catalogue that stands before it."""
    what = str(context.params.get("what"))
    known = things_of(what, load_registry()) if what in KINDS else {}
    return [name for name in known if name.startswith(incomplete)]


@command("list", short_help="List what is registered.",
         epilog=examples("armid list plants", "armid list effects coulomb --long", "armid list identifiers --long",
                         "armid list effects --plugin mine.py:my_drag"))  # fmt: skip
@click.argument("what", metavar="effects|plants|fitness|identifiers|analyses", shell_complete=completes(words=KINDS))
@click.argument("names", nargs=-1, metavar="[NAME]...", shell_complete=complete_name)
@click.option("--long", "is_long", is_flag=True, help="Everything: equations, and the options of identifiers.")
@plugin_option
def list_command(what: str, names: tuple[str, ...], is_long: bool, plugins: tuple[str, ...]) -> None:
    """List what is registered: names and what they are; of each NAME the parameters, units, ports and source.

    --long shows that of all, and adds equations. Of an identifier it is the name, default, unit and meaning of each
    option. analyses: sections of the report of a study.
    """
    refuse_unless_known(what, KINDS, f"list '{what}' is not known")
    registry = load_registry(plugins)
    catalogue = things_of(what, registry)
    if what == "effects" and names:
        catalogue = {n: e for plant in registry.plants.values() for n, e in sensor_effects(plant).items()} | catalogue
    for name in names:
        refuse_unless_known(name, catalogue, f"{what}: '{name}' is not known")
    things = {name: catalogue[name] for name in names or catalogue}
    if wants("quiet"):
        put(*things)
    elif wants("json"):
        give(**{what: {name: entry(thing) for name, thing in things.items()}})
    elif names or is_long:
        for i, (name, thing) in enumerate(things.items()):
            lines = DETAILS_OF[what](name, thing, registry, is_long)
            say(*[""] * (i > 0), *(part for line in lines for part in folded(line) or [""]))
    else:
        columns, row = SHORT_TABLES[what]
        hint = f"; `armid list {what} NAME` says more"
        rows = [(name, *row(thing)) for name, thing in things.items()]
        main = table(what, columns, rows)
        present(Document(what, "List", "", (f"{len(rows)} {what}{hint}.",), (), main=(main,)))
    if what == "identifiers" and not names:
        say("", *COMPOSED.splitlines())


def things_of(what: str, registry: Registry) -> dict[str, Any]:
    """Return name -> thing of a catalogue, analyses of armid included."""
    own: dict[str, Any] = dict(getattr(registry, what))
    if what != "analyses":
        return own
    from armid.study.document import ANALYSES

    return {a.name: a for a in ANALYSES} | own


def note_of(thing: Any) -> str:
    note = getattr(thing, "note", "") or (getattr(thing, "__doc__", "") or "").strip()
    return str(note).splitlines()[0] if note else "no note"


def kinds_of(identifier: Any) -> str:
    seed = "stochastic" if identifier.is_global else "random start"
    kinds = {"gradient": identifier.uses_gradient, seed: identifier.is_stochastic,
             "rmse or likelihood": identifier.needs_residuals}  # fmt: skip
    return ", ".join(["global" if identifier.is_global else "local", *(word for word, on in kinds.items() if on)])


def forms_of(effect: Effect) -> str:
    words = ", ".join(e.form for e in effect.every_form if e.form)
    return f"{note_of(effect)} (forms: {words})" if words else note_of(effect)


def plain_lines(name: str, thing: Any, registry: Registry, is_long: bool) -> list[str]:
    return [f"{name}: {note_of(thing)}{f' (records join by {thing.join})' if hasattr(thing, 'join') else ''}"]


def entry(thing: Any) -> dict[str, Any]:
    fields: dict[str, Any] = {"note": getattr(thing, "note", "") or (getattr(thing, "__doc__", "") or "").strip()}
    if isinstance(thing, Plant | Effect):
        keys = ("unit", "low", "high", "null", "fixed", "note")
        fields["parameters"] = {p.name: {key: getattr(p, key) for key in keys} for p in thing.parameters}
        ports = thing.ports if isinstance(thing, Plant) else {port: returned_text(f) for port, f in thing.adds.items()}
        fields["ports"] = dict(ports)
    if hasattr(thing, "build"):
        from armid.identifiers import options_of
        from armid.identifiers.identifier import TRAITS

        fields |= {flag: getattr(thing, flag) for flag in TRAITS} | {"options": options_of(thing)}
    return fields | ({"unit": thing.unit, "join": thing.join} if hasattr(thing, "join") else {})


def identifier_lines(name: str, identifier: Any, registry: Registry, is_long: bool) -> list[str]:
    from armid.identifiers import options_of

    lines = [f"{name}: {note_of(identifier)} ({kinds_of(identifier)})"]
    for option, declared in options_of(identifier).items():
        default = declared["default"]
        value = "its own" if default is None or callable(default) else quoted(default).strip("'")
        unit = f" [{declared['unit']}]" if declared["unit"] else ""
        lines.append(f"  --option {option}={value}{unit} {declared['meaning']}")
    return lines


def effect_lines(name: str, effect: Effect, registry: Registry, is_long: bool) -> list[str]:
    lines = [f"{name}: {note_of(effect)}"]
    for form in effect.every_form:
        lines += [f"  in the form {form.form}"] if len(effect.every_form) > 1 else []
        lines += [*form_lines(form, is_long), *([f"  source: {form.source}"] if form.source else [])]
    return [*lines, f"  on {places(effect, registry.plants.values())}"]


def form_lines(effect: Effect, is_long: bool) -> list[str]:
    def text(function: Callable[..., Any]) -> str:
        """The expression, with the names that arguments stand for here."""
        return returned_text(function, {a: effect.binds.get(a, a) for a in signature(function).parameters})

    lines = [f"  port {port}{f' += {text(f)}' if is_long else ''}" for port, f in effect.adds.items()]
    if is_long:
        lines += [f"  state {s.name} [{s.unit}], d {s.name}/dt = {text(s.rate)}" for s in effect.states]
        lines += [f"  {d.name}: {text(d.of)} at t - {d.by}" for d in effect.delays]
        lines += [f"  switch {g.name} where {text(g.function)} is 0" for g in effect.guards]
    lines += [f"  approximates the form {effect.exact.form}"] if effect.exact is not None else []
    return [*lines, *(f"  {parameter_text(p)}" for p in effect.parameters)]


def places(effect: Effect, plants: Iterable[Plant]) -> str:
    """Return the plants that offer the ports and names of an effect, siblings by what they record."""
    texts = []
    for plant in plants:
        siblings = (plant, *plant.variants)
        units = [p.output_unit for p in siblings if any(not refusal_of(e, p) for e in effect.every_form)]
        if units:
            texts.append(plant.name if len(units) == len(siblings) else f"{plant.name} in {', '.join(units)}")
    return ", ".join(texts) or "no plant"


def folded(line: str) -> list[str]:
    width = min(get_terminal_size().columns, WIDTH)
    return textwrap.wrap(line, width, subsequent_indent="      ", break_long_words=False, break_on_hyphens=False)


def parameter_text(parameter: Parameter) -> str:
    text = f"{parameter.name} [{parameter.unit}] from {parameter.low:g} to {parameter.high:g}"
    if parameter.null is not None:
        text += f", null {parameter.null:g}"
    if parameter.fixed is not None:
        text += f", fixed at {parameter.fixed:g} unless bounds free it"
    return f"{text}: {parameter.note}" if parameter.note else text


def plant_lines(name: str, plant: Plant, registry: Registry, is_long: bool) -> list[str]:
    lines = sibling_lines(plant, is_long)
    for variant in plant.variants:
        lines += ["", *sibling_lines(variant, is_long)]
    return lines


def sibling_lines(plant: Plant, is_long: bool) -> list[str]:
    lines = [f"{plant.name} (recorded in {', '.join(o.unit for o in plant.outputs)}): {plant.note}"]
    if not plant.records_one_speed:
        lines += [f"  output {o.name} [{o.unit}] = {o.signal} from {' or '.join(o.factors)}" for o in plant.outputs]
        lines += [f"  effect of a sensor {name}: {e.note}" for name, e in sensor_effects(plant).items()]
    lines += [f"  parameter {parameter_text(p)}" for p in plant.parameters]
    lines += [f"  state {s.name} [{s.unit}]" for s in plant.states]
    lines += [f"  quantity {name}{f' = {returned_text(f)}' if is_long else ''}" for name, f in plant.quantities.items()]
    lines += [f"  port {name} [{unit}]" for name, unit in plant.ports.items()]
    lines += [
        f"  input {i.name} [{i.unit}] from {' or '.join(i.columns) or 'a column that you name'}" for i in plant.inputs
    ]
    lines += [f"  constant {c.name} = {c.value:g} {c.unit}{f' ({c.note})' if c.note else ''}" for c in plant.constants]
    lines += [f"  key {k.key} sets {k.constant}" for k in plant.keys]
    return [*lines, *(f"  {alias} is another name for {name}" for alias, name in plant.aliases.items())]


# Columns of the table of each catalogue, and the cells of one name after the name itself.
SHORT_TABLES: dict[str, tuple[tuple[str, ...], Callable[[Any], Sequence[str]]]] = {
    "plants": (
        ("plant", "recorded in", "what it is"),
        lambda p: (", ".join(dict.fromkeys(o.unit for each in (p, *p.variants) for o in each.outputs)), note_of(p)),
    ),
    "effects": (("effect", "at", "what it is"), lambda e: (", ".join(e.adds), forms_of(e))),
    "fitness": (("fitness", "records join by", "what it is"), lambda f: (f.join, note_of(f))),
    "analyses": (("analysis", "what it is"), lambda a: (note_of(a),)),
    "identifiers": (("identifier", "what it is", "kind"), lambda i: (note_of(i), kinds_of(i))),
}
DETAILS_OF: dict[str, Callable[..., list[str]]] = {
    "plants": plant_lines, "effects": effect_lines, "fitness": plain_lines, "analyses": plain_lines,
    "identifiers": identifier_lines,
}  # fmt: skip
