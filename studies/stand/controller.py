"""What the simulated arm's controller asks of the drive."""

import math

from stand.arm import Arm
from stand.effects import Effects
from stand.manoeuvre import Manoeuvre

State = dict[str, float]


def command(arm: Arm, effects: Effects, manoeuvre: Manoeuvre, seen: State, closed_loop: bool) -> float:
    """Give the voltage demanded of the drive [V]: full supply before E; after it K_p (theta_D - theta) - K_d k omega.

    The threshold circuit shrinks the closed-loop demand toward 0 by u_th; the supply clips it. `seen` is the state
    that the controller knows of, which may be an earlier one.
    """
    supply = manoeuvre.supply_volt
    if not closed_loop:
        return math.copysign(supply, manoeuvre.target - manoeuvre.start)
    speed = seen.get("tachometer", seen["speed"]) + math.radians(effects.tachometer_offset_deg_s)
    if effects.tachometer_ripple:
        turn = effects.tachometer_order * arm.ratio_motor * seen["angle"]
        speed *= 1.0 + effects.tachometer_ripple * math.sin(turn)
    demand = arm.position_gain * (manoeuvre.target - seen["angle"]) - arm.speed_gain * arm.k * speed
    return math.copysign(min(max(abs(demand) - arm.threshold, 0.0), supply), demand)
