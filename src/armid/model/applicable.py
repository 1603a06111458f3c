"""Which effects can be added to a plant."""

from collections.abc import Mapping

from armid.model.effect import Effect
from armid.model.errors import ArmidError
from armid.model.model import Model
from armid.model.plant import Plant


def refusal_of(effect: Effect, plant: Plant) -> str:
    """Return the sentence with which a plant refuses an effect, "" where it takes it."""
    try:
        Model(plant) + effect
    except ArmidError as error:
        return str(error)
    return ""


def applicable(effects: Mapping[str, Effect], plant: Plant) -> dict[str, Effect]:
    """Return the effects of which a plant offers the ports and names; nothing is compiled.

    effects: name -> effect. An effect of which only another form fits comes in that form.
    """
    found = {}
    for name, effect in effects.items():
        fitting = next((e for e in effect.every_form if not refusal_of(e, plant)), None)
        if fitting is not None:
            found[name] = fitting
    return found
