"""What the machine was told to do, on the time grid of its record."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Manoeuvre:
    """Describe one simulation: constants, inputs and an even time grid that starts at `start_time`.

    constants: name -> value, SI; they replace the plant's defaults.
    interval: sample interval [s]; n_samples: number of samples, the first at start_time.
    inputs: name -> values, shape (n_samples,).
    hold: "linear" (inputs run straight between samples) or "zero" (they keep the value of the last sample).
    """

    interval: float
    n_samples: int
    constants: Mapping[str, float] = field(default_factory=dict)
    inputs: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    hold: str = "linear"
    start_time: float = 0.0

    def times(self) -> NDArray[np.float64]:
        """Return the sample times [s], shape (n_samples,)."""
        return self.start_time + self.interval * np.arange(self.n_samples, dtype=np.float64)

    def shortened(self, n_samples: int) -> "Manoeuvre":
        """Return the manoeuvre cut after its first samples."""
        return replace(self, n_samples=n_samples, inputs={k: v[:n_samples] for k, v in self.inputs.items()})

    def likeness(self) -> tuple[object, ...]:
        """Return what two manoeuvres have in common when a machine answers both alike, hashable; not the start time."""
        inputs = tuple((name, values.tobytes()) for name, values in sorted(self.inputs.items()))
        return self.interval, self.n_samples, self.hold, tuple(sorted(self.constants.items())), inputs
