"""The plants and effects there are."""

from armid.model.effect import Effect
from armid.model.effects.coulomb import coulomb
from armid.model.effects.torque_offset import torque_offset
from armid.model.effects.viscous import viscous
from armid.model.plant import Plant
from armid.model.plants.driven_axis import driven_axis
from armid.model.plants.shell_transfer_arm import shell_transfer_arm

PLANTS: dict[str, Plant] = {p.name: p for p in (shell_transfer_arm, driven_axis)}
EFFECTS: dict[str, Effect] = {e.name: e for e in (coulomb, viscous, torque_offset)}
