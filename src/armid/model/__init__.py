"""What the machine is: equations, no numba, no files.

parameter, effect, plant: what is declared. graph: equations bound by argument name, and as text.
model: a plant with effects. effects, plants: what there is, listed below.
"""

from armid.model.effect import Effect, Guard, State
from armid.model.effects import bodies, control, drive, friction, sensor
from armid.model.model import Model, applicable, refusal_of
from armid.model.parameter import Parameter, Scales
from armid.model.plant import Constant, Input, Manoeuvre, ManoeuvreKey, Output, Plant
from armid.model.plants.driven_axis import driven_axis
from armid.model.plants.flexible_link import flexible_link
from armid.model.plants.rotary_arm import rotary_arm
from armid.model.plants.shell_transfer_arm import shell_transfer_arm
from armid.model.plants.shell_transfer_arm_elastic import shell_transfer_arm_elastic

__all__ = [
    "EFFECTS", "PLANTS", "Constant", "Effect", "Guard", "Input", "Manoeuvre", "ManoeuvreKey", "Model",
    "Output", "Parameter", "Plant", "Scales", "State", "applicable", "refusal_of",
]  # fmt: skip

PLANTS: dict[str, Plant] = {
    p.name: p for p in (shell_transfer_arm, driven_axis, shell_transfer_arm_elastic, flexible_link, rotary_arm)
}
# Their order is that of reports: friction, bodies, what drives, control, what is recorded.
FAMILIES = (friction, bodies, drive, control, sensor)
EFFECTS: dict[str, Effect] = {effect.name: effect for family in FAMILIES for effect in family.EFFECTS}
