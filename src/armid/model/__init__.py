"""What the machine is: equations, no numba, no files."""

from armid.model.applicable import applicable, refusal_of
from armid.model.catalogue import EFFECTS, PLANTS
from armid.model.effect import Effect, Guard, State
from armid.model.errors import ArmidError, nearest
from armid.model.manoeuvre import Manoeuvre
from armid.model.model import Model
from armid.model.parameter import Parameter
from armid.model.plant import Constant, Input, ManoeuvreKey, Plant
from armid.model.scales import Scales

__all__ = [
    "EFFECTS", "PLANTS", "ArmidError", "Constant", "Effect", "Guard", "Input", "Manoeuvre", "ManoeuvreKey", "Model",
    "Parameter", "Plant", "Scales", "State", "applicable", "nearest", "refusal_of",
]  # fmt: skip
