"""The quarter drone as published: theta'' = c1 sin(theta) + c2 u^2 + c3 theta', u the command in percent.

Nobody measured its inertia, and none can come of angle and command: all is per unit of inertia, which stands for 1.
"""

from dataclasses import replace

from armid import PLANTS, Parameter, Scales
from armid.model.plants.rotary_arm import driven_by, propeller_effort

rotary_arm = PLANTS["rotary_arm"]
BOUNDS = {"inertia": (0.5, 2.0), "gravity_moment": (0.0, 40.0), "damping": (0.0, 10.0), "gain": (0.0, 0.02)}
UNITS = {"inertia": "1", "gravity_moment": "1/s2", "damping": "1/s", "gain": "1/s2 per squared percent"}

quarter_drone = driven_by(
    propeller_effort,
    name="quarter_drone",
    note="a rotary arm with a propeller: theta'' = -c1 sin(theta) + c2 u^2 - c3 theta'",
    parameters=tuple(
        Parameter(p.name, UNITS[p.name], *BOUNDS[p.name], fixed=1.0 if p.name == "inertia" else None, note=p.note)
        for p in rotary_arm.parameters
    ),
    inputs=(replace(rotary_arm.inputs[0], columns=("command_percent",), typical=(0.0, 60.0)),),
    # thrust at a command of 50 %, and a swing of 60 deg in half a second
    scales=Scales(effort=12.0, speed=2.0),
    scales_from_records=False,
)
