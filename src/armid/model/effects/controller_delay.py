"""The control acts late: the switch and every command come a dead time after what was measured.

The switch is exactly late: after the plant's switch the full voltage stays on for the dead time. The angle and the
speed that the control sees pass through the second-order Pade approximation of a dead time T,

    exp(-T s) = (1 - T s/2 + T^2 s^2/12) / (1 + T s/2 + T^2 s^2/12) = 1 - T s / (1 + T s/2 + T^2 s^2/12),

good to (w T)^5/720 at the frequency w. Below 2 ms the filter stays that of 2 ms while the factor T goes on falling:
the same delay, no stiff equation, a derivative at the null. A loop that is closed from the start is not late.

A digital control samples every `period`, first at the start of the stroke, and holds its command between samples: after
the dead time its switch waits for the next sample, and the hold is late by half a period on average. Of the hold alone
the approximation is 1 / (1 + T s/2 + T^2 s^2/12), T the period, the one of (1 - exp(-T s)) / (T s); where it is a part
h of the lateness, T and the equations lie between the two, right to s^2. A period of 0 does not sample.
Source: Golub and Van Loan, Matrix Computations, section 9.3 (Pade); Astrom and Murray, Feedback Systems, chapter 9;
Franklin, Powell, Workman, Digital Control of Dynamic Systems, chapter 4 (hold).
"""

import numpy as np

from armid.model.effect import Effect, Guard, State
from armid.model.parameter import Parameter

SHORT = 1e-4


def lateness(delay, period):
    """Mean time by which the control is late [s]: the dead time and half a period."""
    return delay + 0.5 * period


def held_part(delay, period):
    """Part h of the lateness that is the hold's."""
    return 0.5 * period / np.maximum(lateness(delay, period), SHORT)


def filter_time(delay, period):
    """Time T of the filter [s]: the delay of a dead time, the period of a hold, between them right to T^2."""
    h = held_part(delay, period)
    return np.maximum(lateness(delay, period) * (6 + 2 * h**2) / (3 + np.sqrt(9 - 6 * h - 2 * h**3)), 2e-3)


def feedback(delay, period, omega, smooth, slope):
    """Speed that the control sees less the true one [rad/s], h (w - omega) - (lateness - h T/2) dw/dt."""
    h = held_part(delay, period)
    return h * (smooth - omega) - (lateness(delay, period) - 0.5 * h * filter_time(delay, period)) * slope


def command(
    closed, acting, K_p, theta_D, theta, damping, omega, feedback, direction, U, u_th, delay, period, smooth, slope
):
    """Voltage to add to the demand [V]: K_p times the late angle's lag; what makes it full until the late switch."""
    full = 2 * (U + u_th) * direction - K_p * (theta_D - theta) + damping * (omega + feedback)
    bend = held_part(delay, period) * filter_time(delay, period) ** 2 / 12
    return np.where(closed - acting > 0.5, full, K_p * (lateness(delay, period) * smooth + bend * slope))


def smooth_rate(slope):
    """Rate of the smoothed speed w [rad/s2]."""
    return slope


def slope_rate(delay, period, omega, smooth, slope):
    """Second derivative of the smoothed speed w [rad/s3], 12/T^2 (omega - w - T/2 dw/dt)."""
    T = filter_time(delay, period)
    return 12 / T**2 * (omega - smooth - 0.5 * T * slope)


def waiting_rate(closed):
    """Time that runs after the plant's switch."""
    return closed


def clock_rate():
    """Return 1: time since the start of the stroke runs."""
    return 1.0


def settled(omega):
    """Return the speed: the filter has settled."""
    return omega


def level():
    """Return 0: nothing accelerates before the start."""
    return 0.0


def waited(theta_C, theta_D, delta_E, delay):
    """Return 0, or the whole dead time where the loop is closed from the start."""
    return np.where(np.abs(theta_D - theta_C) <= delta_E, delay, 0.0)


def still_to_wait(closed, delay, period, waiting, clock):
    """Return the time until the late switch [s]: the rest of the dead time, and then until the next sample."""
    due = clock - waiting + delay
    sample = -np.floor(-due / np.maximum(period, SHORT)) * period
    return np.where(closed > 0.5, np.where(period > SHORT, sample, due) - clock, lateness(delay, period))


controller_delay = Effect(
    name="controller_delay",
    parameters=(
        Parameter("delay", "s", 0.0, 0.03, null=0.0, note="dead time of the control"),
        Parameter("period", "s", 0.0, 0.03, null=0.0, fixed=0.0, note="between samples of a digital control"),
    ),
    adds={"feedback": feedback, "command": command},
    states=(
        State("smooth", "rad/s", smooth_rate, settled),
        State("slope", "rad/s2", slope_rate, level),
        State("waiting", "s", waiting_rate, waited),
        State("clock", "s", clock_rate, level),
    ),
    guards=(Guard("acting", still_to_wait, latch=True),),
    note="the control switches and commands late",
    source="Golub and Van Loan, Matrix Computations, section 9.3; Astrom and Murray, Feedback Systems, chapter 9",
)
