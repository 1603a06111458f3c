"""The winding warms up and its resistance grows (Hughes and Drury, Electric Motors and Drives, chapter 3; IEC 60034-1).

On the time of a stroke hardly any heat leaves the copper: the resistance follows the integral of the current squared,
unless `cooling` says that the heat is lost again.
"""

from armid.model.effect import Effect, State
from armid.model.parameter import Parameter


def winding(current, R, rise, heat):
    """Voltage at the winding [V], -R rise heat I."""
    return -R * rise * heat * current


def heat_rate(current, heat, cooling):
    """Square of the current less what is lost again [A2], I^2 - cooling heat."""
    return current**2 - cooling * heat


def cold():
    """Return 0: the declared resistance is that at the start."""
    return 0.0


winding_heating = Effect(
    name="winding_heating",
    parameters=(
        Parameter("rise", "1/(A2 s)", 0.0, 2e-4, null=0.0, note="relative growth of resistance per integral of I^2"),
        Parameter("cooling", "1/s", 0.0, 5.0, fixed=0.0, note="rate at which the heat is lost again"),
    ),
    adds={"winding": winding},
    states=(State("heat", "A2 s", heat_rate, cold),),
    note="the winding's resistance grows with the integral of the current squared",
    source="Hughes and Drury, Electric Motors and Drives, chapter 3; IEC 60034-1",
)
