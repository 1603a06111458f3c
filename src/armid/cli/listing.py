"""`armid list`: what there is to choose from."""

import click

from armid.cli.options import chosen, plugin_option
from armid.model import Effect, Parameter, Plant
from armid.model.equations import returned_text
from armid.registry import KINDS, Registry, load_registry


@click.command("list")
@click.argument("what", metavar="effects|plants|fitness|identifiers")
@plugin_option
def list_command(what: str, plugins: tuple[str, ...]) -> None:
    """List what is registered: names, equations, parameters, units."""
    chosen(what, dict.fromkeys(KINDS), "list")
    registry = load_registry(plugins)
    texts = {"effects": effect_texts, "plants": plant_texts, "fitness": fitness_texts, "identifiers": identifier_texts}
    print("\n\n".join(texts[what](registry)))


def effect_texts(registry: Registry) -> list[str]:
    """Return one paragraph for each effect."""
    return [effect_text(e) for e in registry.effects.values()]


def effect_text(effect: Effect) -> str:
    """Return name, note, ports with equations, states and parameters of an effect."""
    lines = [f"{effect.name}: {effect.note or 'no note'}"]
    lines += [f"  port {port} += {returned_text(f)}" for port, f in effect.adds.items()]
    lines += [f"  state {s.name} [{s.unit}], d {s.name}/dt = {returned_text(s.rate)}" for s in effect.states]
    lines += [f"  {parameter_text(p)}" for p in effect.parameters]
    return "\n".join([*lines, f"  source: {effect.source}"] if effect.source else lines)


def parameter_text(parameter: Parameter) -> str:
    """Return name, unit, bounds and null value of a parameter."""
    text = f"{parameter.name} [{parameter.unit}] from {parameter.low:g} to {parameter.high:g}"
    if parameter.null is not None:
        text += f", null {parameter.null:g}"
    if parameter.fixed is not None:
        text += f", fixed at {parameter.fixed:g} unless bounds free it"
    return f"{text}: {parameter.note}" if parameter.note else text


def plant_texts(registry: Registry) -> list[str]:
    """Return one paragraph for each plant and its siblings."""
    return [plant_text(p) for plant in registry.plants.values() for p in (plant, *plant.variants)]


def plant_text(plant: Plant) -> str:
    """Return everything that an effect or a campaign can name."""
    lines = [f"{plant.name} (recorded in {plant.output_unit}): {plant.note}"]
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
    """Return one line for each fitness."""
    return [f"{name}: {f.note or 'no note'} (records join by {f.join})" for name, f in registry.fitness.items()]


def identifier_texts(registry: Registry) -> list[str]:
    """Return one line for each identifier."""
    lines = []
    for name, i in registry.identifiers.items():
        kinds = {"global": i.is_global, "gradient": i.uses_gradient, "stochastic": i.is_stochastic}
        words = [word for word, on in kinds.items() if on]
        lines.append(f"{name}: {i.note or 'no note'} ({', '.join(words) or 'local'})")
    return lines
