"""The plants and effects there are, and how a catalogue shows itself."""

from typing import TypeVar

from armid.model.effect import Effect
from armid.model.effects import bodies, control, drive, friction, sensor
from armid.model.plants.driven_axis import driven_axis
from armid.model.plants.flexible_link import flexible_link
from armid.model.plants.linear_axis import linear_axis
from armid.model.plants.rotary_arm import rotary_arm
from armid.model.plants.shell_transfer_arm import shell_transfer_arm
from armid.model.plants.shell_transfer_arm_elastic import shell_transfer_arm_elastic

Thing = TypeVar("Thing")


class Catalogue(dict[str, Thing]):
    """Things by name; it shows its names alone."""

    def __repr__(self) -> str:
        return f"<{len(self)} by name: {', '.join(self)}>"


MACHINES = (shell_transfer_arm, driven_axis, shell_transfer_arm_elastic, flexible_link, rotary_arm,
            linear_axis)  # fmt: skip
PLANTS = Catalogue({plant.name: plant for plant in MACHINES})
# Their order is that of reports: friction, bodies, what drives, control, what is recorded.
FAMILIES = (friction, bodies, drive, control, sensor)
EFFECTS = Catalogue[Effect]({effect.name: effect for family in FAMILIES for effect in family.EFFECTS})
