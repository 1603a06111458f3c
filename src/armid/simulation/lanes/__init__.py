"""Vector of doubles for numba: one value per candidate, side by side in the registers of the processor.

Every operation acts lane by lane, so a candidate's result does not depend on its neighbours.
"""

from armid.simulation.lanes import operators as operators
from armid.simulation.lanes.bits import exponent_of, mantissa_of, two_to_the
from armid.simulation.lanes.functions import any_above, fabs, floor_of, fused, nearest, select, square_root
from armid.simulation.lanes.memory import lane, make_access, n_lanes, store, with_lane
from armid.simulation.lanes.vector import Lanes, is_number, mixes_lanes

__all__ = [
    "Lanes", "any_above", "exponent_of", "fabs", "floor_of", "fused", "is_number", "lane", "make_access",
    "mantissa_of", "mixes_lanes", "n_lanes", "nearest", "select", "square_root", "store", "two_to_the", "with_lane",
]  # fmt: skip
