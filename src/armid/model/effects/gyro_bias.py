"""The gyro tells a speed when there is none (Titterton and Weston, doi:10.1049/PBRA017E)."""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def output(bias):
    """Speed that is recorded less the true one, constant."""
    return bias


gyro_bias = Effect(
    name="gyro_bias",
    parameters=(Parameter("bias", "speed", -0.05, 0.05, null=0.0, note="0.3 deg/s are 0.0052 rad/s"),),
    adds={"output": output},
    note="constant error of the recorded speed",
    source="doi:10.1049/PBRA017E",
)
