"""Control: what it senses, when it acts, how strongly."""

from dataclasses import replace

import numpy as np

from armid.model.effect import Delay, Effect, Guard, State, drive_now, slope_itself, start_speed, zero
from armid.model.effects.drive import torque_delay, voltage_delay
from armid.model.effects.sensor import lag_error, lagging_rate
from armid.model.parameter import Parameter

tachometer_lag = Effect(
    name="tachometer_lag", adds={"feedback": lag_error}, states=(State("lagging", "rad/s", lagging_rate, start_speed),),
    parameters=(Parameter("time_constant", "s", 0.0, 0.03, null=0.0, note="of the tachometer's filter"),),
    note="the speed that is fed back lags",
    source="Franklin, Powell, Workman, Digital Control of Dynamic Systems, chapter 5",
)  # fmt: skip


def feedback_offset(offset):
    """Speed that the control sees less the true one [rad/s], constant.

    An offset of the angle that the control measures does the same to the demand: K_p times the angle is K_d k times
    this.
    """
    return offset


tachometer_offset = Effect(
    name="tachometer_offset", adds={"feedback": feedback_offset},
    parameters=(Parameter("offset", "speed", -0.1, 0.1, null=0.0, note="1 deg/s is 0.0175 rad/s"),),
    note="constant error of the speed that is fed back",
    source="Doebelin, Measurement Systems, chapter 4 (tachometer generators)",
)  # fmt: skip


def feedback_ripple(omega, theta, i1, sine, cosine, order):
    """Speed that the control sees less the true one [rad/s], omega (sine sin a + cosine cos a), a = order i1 theta.

    The ripple of a commutator or of an eccentric coupling is a share of the voltage, so that it grows with the speed.
    """
    return omega * (sine * np.sin(order * i1 * theta) + cosine * np.cos(order * i1 * theta))


tachometer_ripple = Effect(
    name="tachometer_ripple", adds={"feedback": feedback_ripple},
    parameters=(
        Parameter("sine", "1", -0.15, 0.15, null=0.0, note="amplitude of the sine, as a share of the speed"),
        Parameter("cosine", "1", -0.15, 0.15, null=0.0, note="amplitude of the cosine, as a share of the speed"),
        Parameter("order", "1", 0.5, 4.5, nominal=1.0, note="waves in a turn of the motor"),
    ),
    note="the speed that is fed back ripples with the turn of the motor",
    source="Doebelin, Measurement Systems, chapter 4 (tachometer generators)",
)  # fmt: skip


# The control acts late: the switch and every command come a dead time after what was measured.
#
# A digital control samples every `period`, first at the start of the stroke, and holds its command between samples.
# After the dead time its switch waits for the next sample. On average the hold is late by half a period. The hold
# is approximated by 1 / (1 + T s/2 + T^2 s^2/12), T the period, for (1 - exp(-T s)) / (T s). A period of 0 does not
# sample. Source of the hold: Franklin, Powell, Workman, Digital Control of Dynamic Systems, chapter 4.
#
# The forms named filter approximate the dead time T too, by the second-order Pade approximation
#
# exp(-T s) = (1 - T s/2 + T^2 s^2/12) / (1 + T s/2 + T^2 s^2/12) = 1 - T s / (1 + T s/2 + T^2 s^2/12),
#
# good to (w T)^5/720 at the frequency w; a step it answers before T. Where the hold is a part h of the lateness, T and
# the equations lie between the two, right to s^2. Below 2 ms the filter stays that of 2 ms while the factor T goes on
# falling: the same delay, no stiff equation, a derivative at the null. A loop closed from the start is not late.
SHORT_TIME_S = 1e-4


def lateness(delay, period):
    """Mean time by which the control is late [s]: the dead time and half a period."""
    return delay + 0.5 * period


def held_part(delay, period):
    """Part h of the lateness that is the hold's."""
    return 0.5 * period / np.maximum(lateness(delay, period), SHORT_TIME_S)


def filter_time(delay, period):
    """Time T of the filter [s]: the delay of a dead time, the period of a hold, between them right to T^2."""
    h = held_part(delay, period)
    return np.maximum(lateness(delay, period) * (6 + 2 * h**2) / (3 + np.sqrt(9 - 6 * h - 2 * h**3)), 2e-3)


def late_feedback(delay, period, omega, smooth, slope):
    """Speed that the control sees less the true one [rad/s], h (w - omega) - (lateness - h T/2) dw/dt."""
    h = held_part(delay, period)
    return h * (smooth - omega) - (lateness(delay, period) - 0.5 * h * filter_time(delay, period)) * slope


def late_command(
    closed, acting, K_p, theta_D, theta, damping, omega, feedback, direction, U, u_th, delay, period, smooth, slope
):
    """Voltage to add to the demand [V]: K_p times the late angle's lag; what makes it full until the late switch."""
    full = 2 * (U + u_th) * direction - K_p * (theta_D - theta) + damping * (omega + feedback)
    bend = held_part(delay, period) * filter_time(delay, period) ** 2 / 12
    return np.where(closed - acting > 0.5, full, K_p * (lateness(delay, period) * smooth + bend * slope))


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


def waited(theta_C, theta_D, delta_E, delay):
    """Return 0, or the whole dead time where the loop is closed from the start."""
    return np.where(np.abs(theta_D - theta_C) <= delta_E, delay, 0.0)


def still_to_wait(closed, delay, period, waiting, clock):
    """Return the time until the late switch [s]: the rest of the dead time, and then until the next sample."""
    due = clock - waiting + delay
    sample = -np.floor(-due / np.maximum(period, SHORT_TIME_S)) * period
    return np.where(closed > 0.5, np.where(period > SHORT_TIME_S, sample, due) - clock, lateness(delay, period))


def present_angle(theta):
    """Angle that the control measures [rad]."""
    return theta


def late_held_feedback(late_speed, omega, period, smooth, slope):
    """Speed that the control sees less the true one [rad/s]: the speed of a dead time ago, held for a period."""
    return late_speed - omega + late_feedback(0.0, period, late_speed, smooth, slope)


def late_held_command(
    closed, acting, K_p, theta_D, theta, damping, omega, feedback, direction, U, u_th, late_angle, period, smooth, slope
):
    """Voltage to add to the demand [V]: K_p times the lag of the late, held angle; full until the late switch."""
    full = 2 * (U + u_th) * direction - K_p * (theta_D - theta) + damping * (omega + feedback)
    bend = held_part(0.0, period) * filter_time(0.0, period) ** 2 / 12
    behind = theta - late_angle + lateness(0.0, period) * smooth + bend * slope
    return np.where(closed - acting > 0.5, full, K_p * behind)


def held_slope_rate(period, late_speed, smooth, slope):
    """Second derivative of the late speed that is held [rad/s3], see `slope_rate`."""
    return slope_rate(0.0, period, late_speed, smooth, slope)


def filtered_drive(delay, slope):
    """Effort on top of the drive's, -T dw/dt: with w = E / (1 + T s/2 + T^2 s^2/12) the drive is E exp(-T s)."""
    return -delay * slope


def filtered_drive_rate(delay, drive_effort, smooth, slope):
    """Second derivative of the smoothed effort w, 12/T^2 (E - w - T/2 dw/dt), T at least 2 ms (see above)."""
    T = np.maximum(delay, 2e-3)
    return 12 / T**2 * (drive_effort - smooth - 0.5 * T * slope)


DEAD_TIME = (
    "Astrom and Murray, Feedback Systems, chapter 9; Franklin, Powell, Workman, Digital Control of Dynamic Systems, "
    "chapter 4"
)
PADE = "Golub and Van Loan, Matrix Computations, section 9.3; Astrom and Murray, Feedback Systems, chapter 9"
late_feedback_of_plant = Effect(
    name="controller_delay", form="feedback", adds={"feedback": late_held_feedback, "command": late_held_command},
    states=(
        State("smooth", "rad/s", slope_itself, start_speed),
        State("slope", "rad/s2", held_slope_rate, zero),
        State("waiting", "s", waiting_rate, waited),
        State("clock", "s", clock_rate, zero),
    ),
    guards=(Guard("acting", still_to_wait, latch=True),),
    delays=(Delay("late_speed", start_speed, "delay"), Delay("late_angle", present_angle, "delay")),
    parameters=(
        Parameter("delay", "s", 0.0, 0.03, null=0.0, note="dead time of the control"),
        Parameter("period", "s", 0.0, 0.03, null=0.0, fixed=0.0, note="between samples of a digital control"),
    ),
    note="the control switches and commands late", source=DEAD_TIME,
)  # fmt: skip
# With a back EMF a late voltage is not a late torque: taken for one it bends the inertia.
# Where the plant holds the control itself, with a port for its command, that is what is late.
late_command_of_record = replace(
    torque_delay, name="controller_delay", form="command", note="the command acts a dead time late"
)
late_voltage = replace(voltage_delay, name="controller_delay")
feedback_filter = replace(
    late_feedback_of_plant, form="feedback_filter", exact=late_feedback_of_plant, delays=(),
    adds={"feedback": late_feedback, "command": late_command},
    states=tuple(replace(s, rate=slope_rate) if s.name == "slope" else s for s in late_feedback_of_plant.states),
    note="the control switches and commands late (second-order filter)", source=PADE,
)  # fmt: skip
command_filter = replace(
    late_command_of_record, form="command_filter", exact=late_command_of_record, delays=(),
    adds={"drive": filtered_drive},
    states=(State("smooth", "effort", slope_itself, drive_now), State("slope", "effort/s", filtered_drive_rate, zero)),
    note="the command acts a dead time late (second-order filter)", source=PADE,
)  # fmt: skip
voltage_filter = replace(
    late_voltage, form="voltage_filter", exact=late_voltage, delays=(), adds={"winding": filtered_drive},
    binds={"drive_effort": "voltage"},
    states=tuple(replace(s, unit=s.unit.replace("effort", "V")) for s in command_filter.states),
    note="the voltage at the motor is late by a dead time (second-order filter)", source=PADE,
)  # fmt: skip
controller_delay = replace(
    late_feedback_of_plant,
    forms=(late_command_of_record, late_voltage, feedback_filter, command_filter, voltage_filter),
)


def position_gain_command(K_p, theta_D, theta, error):
    """Voltage on top of the demand [V], error K_p (theta_D - theta)."""
    return error * K_p * (theta_D - theta)


position_gain = Effect(
    name="position_gain", adds={"command": position_gain_command},
    parameters=(Parameter("error", "1", -0.4, 0.4, null=0.0, note="relative error of K_p"),),
    note="the position loop is stiffer or softer than declared",
    source="Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems, chapter 4",
)  # fmt: skip

EFFECTS = (tachometer_lag, tachometer_offset, tachometer_ripple, controller_delay, position_gain)
