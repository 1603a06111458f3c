"""The position loop's gain differs from the declared one (Franklin, Powell, Emami-Naeini, Feedback Control)."""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def command(K_p, theta_D, theta, error):
    """Voltage on top of the demand [V], error K_p (theta_D - theta)."""
    return error * K_p * (theta_D - theta)


position_gain = Effect(
    name="position_gain",
    parameters=(Parameter("error", "1", -0.4, 0.4, null=0.0, note="relative error of K_p"),),
    adds={"command": command},
    note="the position loop is stiffer or softer than declared",
    source="Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems, chapter 4",
)
