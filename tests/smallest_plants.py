"""Each effect on the smallest plant that takes it: the equations of the arm are long to compile and to solve."""

from armid.model import EFFECTS, PLANTS, applicable

SMALLER = {"driven_axis": [], "shell_transfer_arm": ["driven_axis"],
           "flexible_link": ["driven_axis", "shell_transfer_arm"]}  # fmt: skip


def tried_on(plant):
    """Return the effects that are tried on a plant."""
    others = {name for smaller in SMALLER[plant.name] for name in applicable(EFFECTS, PLANTS[smaller])}
    # the hard limit of the drive lies above what drives the axis in a trial
    others ^= {"drive_saturation"} if plant.name != "flexible_link" else set()
    return [effect for name, effect in applicable(EFFECTS, plant).items() if name not in others]
