"""The plants and effects there are."""

from armid.model.effect import Effect
from armid.model.effects import balance, bodies, control, drive, friction, motor, sensor
from armid.model.plant import Plant
from armid.model.plants.driven_axis import driven_axis
from armid.model.plants.shell_transfer_arm import shell_transfer_arm

PLANTS: dict[str, Plant] = {p.name: p for p in (shell_transfer_arm, driven_axis)}
# Their order is that of reports: friction, bodies, drive, motor, balance, control, what is recorded.
FAMILIES = (friction, bodies, drive, motor, balance, control, sensor)
EFFECTS: dict[str, Effect] = {effect.name: effect for family in FAMILIES for effect in family.EFFECTS}
