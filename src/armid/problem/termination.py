"""The end of a search, as the meter sees it."""

from typing import Any

from pymoo.core.termination import Termination

from armid.model.errors import ArmidError
from armid.problem.meter import Meter


class MeterTermination(Termination):  # type: ignore[misc]
    """End when the meter's budget is used up or its target is reached; never earlier.

    meter: the one that the problem counts with. It is shared, not copied, when pymoo copies the termination.
    n_max_gen: end after so many generations as well (None: as many as the budget allows).
    Raises ArmidError for n_max_gen below 1.
    """

    def __init__(self, meter: Meter, n_max_gen: int | None = None) -> None:
        super().__init__()
        if n_max_gen is not None and n_max_gen < 1:
            raise ArmidError(f"n_max_gen is {n_max_gen}, expected a whole number above 0")
        self.meter = meter
        self.n_max_gen = n_max_gen

    def _update(self, algorithm: Any) -> float:
        """Return the share of the budget, or of the generations, that is used; 1 ends the search."""
        if self.meter.reached:
            return 1.0
        generations = algorithm.n_gen / self.n_max_gen if self.n_max_gen is not None else 0.0
        return float(max(self.meter.used / self.meter.budget, generations))

    def __deepcopy__(self, memo: dict[int, Any]) -> "MeterTermination":
        """Copy all but the meter: `minimize` copies its termination, and a copied meter would stand still."""
        twin = MeterTermination(self.meter, self.n_max_gen)
        twin.force_termination, twin.perc = self.force_termination, self.perc
        return twin
