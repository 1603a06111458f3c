"""The control acts late: the switch and every command come a dead time after what was measured.

The switch is exactly late: after the plant's switch the full voltage stays on for the dead time. The angle and the
speed that the control sees pass through the second-order Pade approximation of a dead time T,

    exp(-T s) = (1 - T s/2 + T^2 s^2/12) / (1 + T s/2 + T^2 s^2/12) = 1 - T s / (1 + T s/2 + T^2 s^2/12),

good to (w T)^5/720 at the frequency w. Below 2 ms the filter stays that of 2 ms while the factor T goes on falling:
the same delay, no stiff equation, a derivative at the null. A loop that is closed from the start is not late.
Source: Golub and Van Loan, Matrix Computations, section 9.3 (Pade); Astrom and Murray, Feedback Systems, chapter 9.
"""

import numpy as np

from armid.model.effect import Effect, Guard, State
from armid.model.parameter import Parameter


def feedback(delay, slope):
    """Speed that the control sees less the true one [rad/s], -T dw/dt."""
    return -delay * slope


def command(closed, acting, K_p, theta_D, theta, damping, omega, feedback, direction, U, u_th, delay, smooth):
    """Voltage to add to the demand [V]: K_p T w for the late angle; what makes it full until the late switch."""
    full = 2 * (U + u_th) * direction - K_p * (theta_D - theta) + damping * (omega + feedback)
    return np.where(closed - acting > 0.5, full, K_p * delay * smooth)


def smooth_rate(slope):
    """Rate of the smoothed speed w [rad/s2]."""
    return slope


def slope_rate(delay, omega, smooth, slope):
    """Second derivative of the smoothed speed w [rad/s3], 12/T^2 (omega - w - T/2 dw/dt)."""
    return 12 / np.maximum(delay, 2e-3) ** 2 * (omega - smooth - 0.5 * np.maximum(delay, 2e-3) * slope)


def waiting_rate(closed):
    """Time that runs after the plant's switch."""
    return closed


def settled(omega):
    """Return the speed: the filter has settled."""
    return omega


def level():
    """Return 0: nothing accelerates before the start."""
    return 0.0


def waited(theta_C, theta_D, delta_E, delay):
    """Return 0, or the whole dead time where the loop is closed from the start."""
    return np.where(np.abs(theta_D - theta_C) <= delta_E, delay, 0.0)


def still_to_wait(delay, waiting):
    """Return the time until the late switch [s]."""
    return delay - waiting


controller_delay = Effect(
    name="controller_delay",
    parameters=(Parameter("delay", "s", 0.0, 0.03, null=0.0, note="dead time of the control"),),
    adds={"feedback": feedback, "command": command},
    states=(
        State("smooth", "rad/s", smooth_rate, settled),
        State("slope", "rad/s2", slope_rate, level),
        State("waiting", "s", waiting_rate, waited),
    ),
    guards=(Guard("acting", still_to_wait, latch=True),),
    note="the control switches and commands late",
    source="Golub and Van Loan, Matrix Computations, section 9.3; Astrom and Murray, Feedback Systems, chapter 9",
)
