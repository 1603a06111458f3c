"""What several families of effects share."""

from armid.model.parameter import Parameter

SIGN_WIDTH = Parameter("width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the sign is smoothed")
SIZE_WIDTH = Parameter(
    "width", "speed", 0.0005, 0.05, fixed=0.005, note="speed over which the size of speed is smoothed"
)


def zero():
    """Return 0: nothing has happened before the start."""
    return 0.0


def start_speed(omega):
    """Return the speed: what follows it has settled before the start."""
    return omega


def slope_itself(slope):
    """Rate of a signal whose slope is a state."""
    return slope


def drive_now(drive_effort):
    """Return the effort of the drive: what follows it has settled before the start."""
    return drive_effort
