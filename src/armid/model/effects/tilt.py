"""Tilt of the trunnion or an error of the angle at which gravity acts (Zhao and Hou, Eq 4 with alpha + tilt)."""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def gravity(angle):
    """Error of the angle in m g L cos(theta + alpha + angle) [rad]."""
    return angle


tilt = Effect(
    name="tilt",
    parameters=(Parameter("angle", "rad", -0.15, 0.15, null=0.0, note="5 deg are 0.087 rad"),),
    adds={"gravity": gravity},
    note="gravity acts at another angle than declared",
    source="Zhao and Hou, Eq 4",
)
