"""The effect `my_effect`: something that the declared equations of a machine lack.

    armid check my_effect.py:my_effect
    armid identify CAMPAIGN --plugin my_effect.py:my_effect --effects my_effect
    armid close-loop CAMPAIGN --plugin my_effect.py:my_effect --out DIR

The last looks for it among all others: whatever --plugin registers is a candidate.
"""

import numpy as np

from armid import Effect, Parameter


# An equation is a plain function of numbers. Its argument names are the binding: the effect's own parameters and
# states first, then whatever the plant declares (`armid list plants` shows it). `omega` is the speed and `theta` the
# position on every plant of armid. Choose with np.where, np.minimum, np.maximum instead of if.
def drag(omega, strength, knee):
    """Drag against the motion [N m or N], quadratic far below the knee and linear far above it."""
    return -strength * omega * np.abs(omega) / (np.abs(omega) + knee)


my_effect = Effect(
    "my_effect",
    parameters=(
        # Bounds of the search are SI, or multiples of the plant's own sizes where the unit is made of `effort`, `speed`
        # and `inertia`: one file then serves a 0.2 N m pendulum and a 600 N m arm.
        # null: the value at which the effect vanishes. At least one parameter needs it, and near it the signal has to
        # answer in proportion, or nothing could trace the effect.
        Parameter("strength", "effort/speed", 0.0, 0.5, null=0.0, note="drag per speed far above the knee"),
        # fixed: where it stays unless --bounds my_effect.knee=LOW:HIGH frees it.
        Parameter("knee", "speed", 0.01, 1.0, fixed=0.2, note="speed at which the drag bends"),
    ),
    # Port of the plant -> function whose value is added there. Most plants offer `torque`, `drive` and `output`.
    adds={"torque": drag},
    note="drag that begins quadratic and becomes linear",
    source="where the equation is from",
)
