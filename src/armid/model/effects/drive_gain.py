"""The drive gives more or less than it tells: an error of the torque constant or of the current's gain.

Source: Gautier and Briot 2014, Global identification of joint drive gains and dynamic parameters of robots,
doi:10.1115/1.4027506.
"""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def drive(drive_effort, error):
    """Effort on top of the drive's, error times the drive: the true gain is 1 + error."""
    return error * drive_effort


drive_gain = Effect(
    name="drive_gain",
    parameters=(Parameter("error", "1", -0.6, 0.6, null=0.0, note="relative error of the drive; gain 0.8 is -0.2"),),
    adds={"drive": drive},
    note="the drive is stronger or weaker than declared",
    source="Gautier and Briot 2014, doi:10.1115/1.4027506",
)
