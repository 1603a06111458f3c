"""What the machine is: equations, no numba, no files.

parameter, effect, plant: what is declared. graph: equations bound by argument name, and as text.
model: a plant with effects. catalogue, effects, plants: what there is.
"""

from armid.model.catalogue import EFFECTS, PLANTS, Catalogue
from armid.model.effect import Delay, Effect, Guard, State
from armid.model.model import Model, applicable, distinct, effect_name, effect_named, is_late_as_a_whole, refusal_of
from armid.model.parameter import Parameter, Scales
from armid.model.plant import Array, Constant, Input, Manoeuvre, ManoeuvreKey, Output, Plant

__all__ = [
    "EFFECTS", "PLANTS", "Array", "Catalogue", "Constant", "Delay", "Effect", "Guard", "Input", "Manoeuvre",
    "ManoeuvreKey", "Model", "Output", "Parameter", "Plant", "Scales", "State", "applicable", "distinct",
    "effect_name", "effect_named", "is_late_as_a_whole", "refusal_of",
]  # fmt: skip
