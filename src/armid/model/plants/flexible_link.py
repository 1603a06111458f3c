"""A hub and a tip with a spring between them: an elastic link, or an elastic gear with its load.

J1 dv/dt = gain u - b1 v + c + ports, J2 (dv/dt + d2 phi/dt2) = -c, c = Ks s + b2 dphi/dt where the coupling is in
contact, phi the deflection (tip less hub), s what of it is beyond the play. Its scales stand for 1 until a campaign
sets them from its train records.
"""

import numpy as np

from armid.model.effect import Guard, State
from armid.model.parameter import Parameter, Scales
from armid.model.plant import Constant, Input, Output, Plant
from armid.model.plants.driven_axis import drive_effort


def play_half(half_play, play):
    """Half the play of the coupling [rad]; `play` is what effects add to the declared one."""
    return half_play + play


def coupling_torque(twist, twist_speed, stiffness, link_damping, series_compliance, play_half, coupling):
    """Torque of the coupling [N m]: spring and damper where it is in contact, 0 within the play.

    `series_compliance` [rad/(N m)] of effects is in series with the declared stiffness. The damper builds up over a
    tenth of the play, so that the torque does not jump at a contact.
    """
    stretch = twist - np.maximum(np.minimum(twist, play_half), -play_half)
    touching = np.where(play_half > 0.0, stretch**2 / (stretch**2 + np.maximum(0.1 * play_half, 1e-30) ** 2), 1.0)
    spring = stiffness / (1 + stiffness * series_compliance) * stretch
    return spring + (link_damping * twist_speed + coupling) * touching


def hub_acceleration(drive_effort, drive, hub_damping, hub_speed, coupling_torque, torque, hub_inertia):
    """Acceleration of the hub [rad/s2]."""
    return (drive_effort + drive - hub_damping * hub_speed + coupling_torque + torque) / hub_inertia


def recorded_hub_angle(hub_angle, hub_sensor):
    """Angle of the hub that is recorded [rad]."""
    return hub_angle + hub_sensor


def recorded_deflection(twist, deflection_sensor):
    """Deflection of the tip against the hub that is recorded [rad]."""
    return twist + deflection_sensor


def recorded_hub_speed(hub_speed, output):
    """Recorded speed of the hub [rad/s]."""
    return hub_speed + output


def recorded_deflection_speed(twist_speed, deflection_speed_sensor):
    """Speed of the tip against the hub that is recorded [rad/s]."""
    return twist_speed + deflection_speed_sensor


def twist_speed_rate(coupling_torque, tip_inertia, hub_acceleration):
    return -coupling_torque / tip_inertia - hub_acceleration


# The way to the contact on either side [rad].
CONTACTS = (Guard("upper_contact", lambda twist, play_half: twist - play_half),
            Guard("lower_contact", lambda twist, play_half: twist + play_half))  # fmt: skip
FROM_RECORD = "set from the record"

flexible_link = Plant(
    name="flexible_link",
    note="hub and tip with an elastic link or gear between them: J1 dv/dt = gain u - b1 v + c, J2 (dv/dt + phi'') = -c",
    parameters=(
        Parameter("hub_inertia", "inertia", 0.001, 5.0, note="inertia on the side of the drive"),
        Parameter("tip_inertia", "inertia", 0.001, 5.0, note="inertia behind the link"),
        Parameter("stiffness", "effort/speed/s", 0.05, 500.0, note="torque per deflection"),
        Parameter("hub_damping", "effort/speed", 0.0, 5.0, note="viscous, of drive and hub"),
        Parameter("link_damping", "effort/speed", 0.0, 1.0, note="viscous, of the link"),
    ),
    states=(
        State("hub_angle", "rad", lambda hub_speed: hub_speed, lambda start_hub_angle: start_hub_angle,
              "hub_angle_state_rad"),
        State("hub_speed", "rad/s", lambda hub_acceleration: hub_acceleration, lambda start_hub_speed: start_hub_speed,
              "hub_speed_state_rad_s"),
        State("twist", "rad", lambda twist_speed: twist_speed, lambda start_deflection: start_deflection, "twist_rad"),
        State("twist_speed", "rad/s", twist_speed_rate, lambda start_deflection_speed: start_deflection_speed,
              "twist_speed_rad_s"),
    ),
    quantities={f.__name__: f for f in (
        drive_effort, play_half, coupling_torque, hub_acceleration, recorded_hub_angle, recorded_deflection,
        recorded_hub_speed, recorded_deflection_speed,
    )},
    constants=(
        Constant("gain", 1.0, "N m per unit of the drive column", "torque constant at the hub; 1 for a torque"),
        Constant("half_play", 0.0, "rad", "half the play of the coupling"),
        Constant("start_hub_angle", 0.0, "rad", FROM_RECORD),
        Constant("start_hub_speed", 0.0, "rad/s", FROM_RECORD),
        Constant("start_deflection", 0.0, "rad", FROM_RECORD),
        Constant("start_deflection_speed", 0.0, "rad/s", FROM_RECORD),
    ),
    inputs=(Input("u", "A or N m", ("current_A", "drive_N_m", "drive_V")),),
    ports={
        "torque": "N m", "drive": "N m", "play": "rad", "series_compliance": "rad/(N m)", "coupling": "N m",
        "hub_sensor": "rad", "deflection_sensor": "rad", "output": "rad/s", "deflection_speed_sensor": "rad/s",
    },
    guards=CONTACTS,
    aliases={"omega": "hub_speed", "theta": "hub_angle", "load_effort": "coupling_torque"},
    outputs=(
        Output("hub_angle", "recorded_hub_angle", "rad", port="hub_sensor"),
        Output("deflection", "recorded_deflection", "rad", port="deflection_sensor"),
        Output("hub_speed", "recorded_hub_speed", "rad/s", port="output"),
        Output("deflection_speed", "recorded_deflection_speed", "rad/s", port="deflection_speed_sensor"),
    ),
    scales=Scales(effort=1.0, speed=1.0),
    from_rest=False,
    scales_from_records=True,
)  # fmt: skip
