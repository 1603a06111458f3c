"""The drive follows its command late, first order: tau dz/dt = E - z, z drives.

Below 1 ms the filter stays at 1 ms and takes a share tau / 1 ms of the drive: the same delay, no stiff equation, and a
derivative by tau at the null. The lagging drive starts from 0: a record that starts under drive starts too weak, by
the drive's first value for a time tau. Source: Leonhard, Control of Electrical Drives,
doi:10.1007/978-3-642-56649-3 (current loops as first-order lags).
"""

import numpy as np

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def drive(time_constant, lagging, drive_effort):
    """Effort on top of the drive's, z - E."""
    return time_constant / np.maximum(time_constant, 1e-3) * (lagging - drive_effort)


def lagging_rate(time_constant, lagging, drive_effort):
    """Rate of the effort that drives, (E - lagging) / time_constant."""
    return (drive_effort - lagging) / np.maximum(time_constant, 1e-3)


def from_nothing():
    """Return 0: the drive is switched on at the start."""
    return 0.0


drive_lag = Effect(
    name="drive_lag",
    parameters=(Parameter("time_constant", "s", 0.0, 0.05, null=0.0, note="of the drive's current loop"),),
    adds={"drive": drive},
    states=(State("lagging", "effort", lagging_rate, from_nothing),),
    note="the drive follows late, first order",
    source="Leonhard, Control of Electrical Drives, doi:10.1007/978-3-642-56649-3",
)
