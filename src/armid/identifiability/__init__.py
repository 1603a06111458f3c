"""How well records pin down parameters."""

from armid.identifiability.collinearity import Group, collinearity_index, groups
from armid.identifiability.examine import Examination, examine
from armid.identifiability.information import MISFIT, Information, Level, collinear, information_at, sensitivities
from armid.identifiability.manoeuvres import Feasible, manoeuvre_grid
from armid.identifiability.profile import Profile, profile, profiles
from armid.identifiability.purchase import Offer
from armid.identifiability.refine import estimate, refine
from armid.identifiability.weighted import WeightedRecords, noise_weights

__all__ = [
    "MISFIT", "Examination", "Feasible", "Group", "Information", "Level", "Offer", "Profile", "WeightedRecords",
    "collinear", "collinearity_index", "estimate", "examine", "groups", "information_at", "manoeuvre_grid",
    "noise_weights", "profile", "profiles", "refine", "sensitivities",
]  # fmt: skip
