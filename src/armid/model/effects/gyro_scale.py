"""The gyro's scale factor is wrong (Titterton and Weston, doi:10.1049/PBRA017E)."""

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def output(omega, error):
    """Speed that is recorded less the true one, error omega."""
    return error * omega


gyro_scale = Effect(
    name="gyro_scale",
    parameters=(Parameter("error", "1", -0.1, 0.1, null=0.0, note="relative error of the scale factor"),),
    adds={"output": output},
    note="error of the recorded speed in proportion to it",
    source="doi:10.1049/PBRA017E",
)
