"""One line of the benchmark: what was measured, against what, and whether that is enough."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Bound:
    """Say what a ratio should be: at least or at most a number."""

    number: float
    at_least: bool = True

    @property
    def text(self) -> str:
        """The bound in words."""
        return f"{'at least' if self.at_least else 'at most'} {self.number:,g}"

    def holds(self, ratio: float) -> bool:
        """Tell whether a ratio is within the bound."""
        return ratio >= self.number if self.at_least else ratio <= self.number


@dataclass(frozen=True)
class Row:
    """Hold one measurement.

    what: was measured; measured: its value in `unit`, None where this system cannot tell. ratio: to what `baseline`
    says in words; wanted: its bound. simulations_per_s: [1/s]. error: largest error of the recorded signal [rad/s].
    note: what else a reader should know.
    """

    what: str
    measured: float | None
    unit: str
    baseline: str = ""
    ratio: float | None = None
    wanted: Bound | None = None
    simulations_per_s: float | None = None
    error: float | None = None
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the ratio is within its bound, None without ratio or bound."""
        return None if self.ratio is None or self.wanted is None else self.wanted.holds(self.ratio)
