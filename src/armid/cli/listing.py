"""`armid list`: what there is to choose from."""

import textwrap
from collections.abc import Sequence
from typing import Any

import click

from armid.cli.options import command, examples, give, plugin_option, put, say, wants
from armid.errors import ArmidError, nearest, quoted
from armid.model import Effect, Parameter, Plant, refusal_of
from armid.model.effects.sensor import sensor_effects
from armid.model.graph import returned_text
from armid.registry import KINDS, Registry, load_registry

# Columns of a terminal that equations are broken to.
WIDTH = 110

COMPOSED = """\
multistart:LOCAL: a local one from ever new starts until the budget is used
GLOBAL+LOCAL[+LOCAL]: a chain, each phase from the best so far; options share=0.5 (0.5:0.3), NAME.OPTION=VALUE"""


@command("list", short_help="List what is registered.",
         epilog=examples("armid list plants", "armid list identifiers --long",
                         "armid list effects --plugin mine.py:my_drag"))  # fmt: skip
@click.argument("what", metavar="effects|plants|fitness|identifiers|analyses")
@click.option(
    "--long", "is_long", is_flag=True, help="Identifiers with the name, default, unit and meaning of options."
)
@plugin_option
def list_command(what: str, is_long: bool, plugins: tuple[str, ...]) -> None:
    """List what is registered: names, equations, parameters, units.

    plants: parameters with bounds, states, quantities, ports, inputs, constants and keys of a record. effects: port,
    equation, parameters, source, the plants that take it. fitness: how records join. identifiers: what they need.
    analyses: sections of the report of a study.
    """
    if what not in KINDS:
        raise ArmidError(f"list '{what}' is not known: {nearest(what, KINDS)}")
    registry = load_registry(plugins)
    texts = {"effects": effect_texts, "plants": plant_texts, "fitness": fitness_texts, "identifiers": identifier_texts,
             "analyses": analysis_texts}  # fmt: skip
    if wants("quiet"):
        put(*getattr(registry, what))
    elif wants("json"):
        give(**{what: {name: entry(thing) for name, thing in getattr(registry, what).items()}})
    elif is_long and what == "identifiers":
        say(*"\n\n".join(map(long_text, registry.identifiers.values())).splitlines(), "", COMPOSED)
    else:
        say(*"\n\n".join(texts[what](registry)).splitlines())


def entry(thing: Any) -> dict[str, Any]:
    found: dict[str, Any] = {"note": getattr(thing, "note", "") or (getattr(thing, "__doc__", "") or "").strip()}
    if isinstance(thing, Plant | Effect):
        keys = ("unit", "low", "high", "null", "fixed", "note")
        found["parameters"] = {p.name: {key: getattr(p, key) for key in keys} for p in thing.parameters}
        ports = thing.ports if isinstance(thing, Plant) else {port: returned_text(f) for port, f in thing.adds.items()}
        found["ports"] = dict(ports)
    if hasattr(thing, "build"):
        from armid.identifiers import options_of

        flags = ("is_global", "uses_gradient", "is_stochastic", "needs_residuals")
        found |= {flag: getattr(thing, flag) for flag in flags} | {"options": options_of(thing)}
    return found | ({"unit": thing.unit, "join": thing.join} if hasattr(thing, "join") else {})


def long_text(identifier: Any) -> str:
    from armid.identifiers import options_of

    lines = [f"{identifier.name}: {identifier.note or 'no note'}"]
    for name, told in options_of(identifier).items():
        default = told["default"]
        value = "its own" if default is None or callable(default) else quoted(default).strip("'")
        unit = f" [{told['unit']}]" if told["unit"] else ""
        lines.append(folded(f"  --option {name}={value}{unit} {told['meaning']}"))
    return "\n".join(lines)


def effect_texts(registry: Registry) -> list[str]:
    plants = [p for plant in registry.plants.values() for p in (plant, *plant.variants)]
    return [effect_text(e, plants) for e in registry.effects.values()]


def effect_text(effect: Effect, plants: Sequence[Plant] = ()) -> str:
    several = len(effect.every_form) > 1
    lines = [f"{effect.name}: {effect.note or 'no note'}"]
    for form in effect.every_form:
        lines += [f"  in the form {form.form}"] if several else []
        lines += form_lines(form, several or form.source != effect.source)
    lines += [f"  source: {effect.source}"] if effect.source and not several else []
    return "\n".join(folded(line) for line in [*lines, f"  on {places(effect, plants)}"])


def form_lines(effect: Effect, with_source: bool) -> list[str]:
    lines = [f"  port {port} += {returned_text(f)}" for port, f in effect.adds.items()]
    lines += [f"  state {s.name} [{s.unit}], d {s.name}/dt = {returned_text(s.rate)}" for s in effect.states]
    lines += [f"  {d.name}: {returned_text(d.of)} at t - {d.by}" for d in effect.delays]
    lines += [f"  approximates the form {effect.exact.form}"] if effect.exact is not None else []
    lines += [f"  switch {g.name} where {returned_text(g.function)} comes to 0" for g in effect.guards]
    lines += [f"  {parameter_text(p)}" for p in effect.parameters]
    return lines + ([f"  source: {effect.source}"] if with_source and effect.source else [])


def places(effect: Effect, plants: Sequence[Plant]) -> str:
    """Return the plants that offer the ports and names of an effect, siblings by what they record."""
    fitting = [p for p in plants if any(not refusal_of(e, p) for e in effect.every_form)]
    names = list(dict.fromkeys(p.name for p in fitting))
    told = []
    for name in names:
        units = [p.output_unit for p in fitting if p.name == name]
        whole = len(units) == sum(p.name == name for p in plants)
        told.append(name if whole else f"{name} in {', '.join(units)}")
    return ", ".join(told) or "no plant"


def folded(line: str) -> str:
    return textwrap.fill(line, WIDTH, subsequent_indent="      ", break_long_words=False, break_on_hyphens=False)


def parameter_text(parameter: Parameter) -> str:
    text = f"{parameter.name} [{parameter.unit}] from {parameter.low:g} to {parameter.high:g}"
    if parameter.null is not None:
        text += f", null {parameter.null:g}"
    if parameter.fixed is not None:
        text += f", fixed at {parameter.fixed:g} unless bounds free it"
    return f"{text}: {parameter.note}" if parameter.note else text


def plant_texts(registry: Registry) -> list[str]:
    return [plant_text(p) for plant in registry.plants.values() for p in (plant, *plant.variants)]


def plant_text(plant: Plant) -> str:
    lines = [f"{plant.name} (recorded in {', '.join(o.unit for o in plant.outputs)}): {plant.note}"]
    if not plant.records_one_speed:
        lines += [f"  output {o.name} [{o.unit}] = {o.signal} from {' or '.join(o.factors)}" for o in plant.outputs]
        lines += [f"  effect of a sensor {name}: {e.note}" for name, e in sensor_effects(plant).items()]
    lines += [f"  parameter {parameter_text(p)}" for p in plant.parameters]
    lines += [f"  state {s.name} [{s.unit}]" for s in plant.states]
    lines += [f"  quantity {name} = {returned_text(f)}" for name, f in plant.quantities.items()]
    lines += [f"  port {name} [{unit}]" for name, unit in plant.ports.items()]
    lines += [
        f"  input {i.name} [{i.unit}] from {' or '.join(i.columns) or 'a column that you name'}" for i in plant.inputs
    ]
    lines += [f"  constant {c.name} = {c.value:g} {c.unit}{f' ({c.note})' if c.note else ''}" for c in plant.constants]
    lines += [f"  key {k.key} sets {k.constant}" for k in plant.keys]
    lines += [f"  {alias} is another name for {name}" for alias, name in plant.aliases.items()]
    return "\n".join(lines)


def fitness_texts(registry: Registry) -> list[str]:
    return [f"{name}: {f.note or 'no note'} (records join by {f.join})" for name, f in registry.fitness.items()]


def identifier_texts(registry: Registry) -> list[str]:
    lines = []
    for name, i in registry.identifiers.items():
        kinds = {"gradient": i.uses_gradient, "stochastic": i.is_stochastic, "rmse or likelihood": i.needs_residuals}
        words = ["global" if i.is_global else "local", *(word for word, on in kinds.items() if on)]
        lines.append(f"{name}: {i.note or 'no note'} ({', '.join(words)})")
    return [*lines, COMPOSED]


def analysis_texts(registry: Registry) -> list[str]:
    from armid.study.analyses.catalogue import ANALYSES

    own = [f"{name}: {(f.__doc__ or 'no note').strip().splitlines()[0]}" for name, f in registry.analyses.items()]
    return [*(f"{a.name}: {a.note}" for a in ANALYSES), *own]
