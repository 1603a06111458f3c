"""The plants and effects there are."""

from armid.model.effect import Effect
from armid.model.effects import bodies, control, drive, friction, sensor
from armid.model.plant import Plant
from armid.model.plants.driven_axis import driven_axis
from armid.model.plants.flexible_link import flexible_link
from armid.model.plants.rotary_arm import rotary_arm
from armid.model.plants.shell_transfer_arm import shell_transfer_arm
from armid.model.plants.shell_transfer_arm_elastic import shell_transfer_arm_elastic

PLANTS: dict[str, Plant] = {
    p.name: p for p in (shell_transfer_arm, driven_axis, shell_transfer_arm_elastic, flexible_link, rotary_arm)
}
# Their order is that of reports: friction, bodies, what drives, control, what is recorded.
FAMILIES = (friction, bodies, drive, control, sensor)
EFFECTS: dict[str, Effect] = {effect.name: effect for family in FAMILIES for effect in family.EFFECTS}
