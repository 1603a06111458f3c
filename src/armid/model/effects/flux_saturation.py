"""The iron of the field winding saturates: the flux grows slower than the current.

Two published forms, K the declared flux per current: rational, Phi = K I / (1 + I/I_s) (Froelich's equation), and
arctangent, Phi = K I_s atan(I/I_s). Strengths with null 0: 1/I_s, and for the arctangent 1/I_s^2, because its departure
from the straight line begins with I_s^-2, so that only then a small strength is seen at all.
Source: Krause, Wasynczuk, Sudhoff, Analysis of Electric Machinery, chapter 1; Perez-Rojas, Fitting saturation and
hysteresis via arctangent functions, IEEE Power Engineering Review 20(11), 2000.
"""

import numpy as np

from armid.model.effect import Effect
from armid.model.parameter import Parameter


def flux(current, K, sharpness):
    """Flux that is missing [Wb], -K abs(I) x / (1 + x) with x = sharpness abs(I)."""
    return -K * sharpness * current**2 / (1 + sharpness * np.abs(current))


def missing_share(y):
    """Return 1 - atan(x)/x with y = x^2; a series where x < 0.1, where the difference would cancel."""
    x = np.sqrt(np.maximum(y, 0.01))
    series = y * (1 / 3 - y * (1 / 5 - y * (1 / 7 - y * (1 / 9 - y * (1 / 11 - y / 13)))))
    return np.where(y < 0.01, series, 1 - np.arctan(x) / x)


def arctangent_flux(current, K, sharpness_squared):
    """Flux that is missing [Wb], -K abs(I) (1 - atan(x)/x) with x^2 = sharpness_squared I^2."""
    return -K * np.abs(current) * missing_share(sharpness_squared * current**2)


arctangent = Effect(
    name="flux_saturation",
    form="arctangent",
    parameters=(
        Parameter("sharpness_squared", "1/A2", 0.0, 1e-3, null=0.0, note="1/I_s^2, I_s the current that saturates"),
    ),
    adds={"flux": arctangent_flux},
    note="the flux saturates (arctangent)",
    source="Perez-Rojas, IEEE Power Engineering Review 20(11), 2000",
)

flux_saturation = Effect(
    name="flux_saturation",
    form="rational",
    forms=(arctangent,),
    parameters=(Parameter("sharpness", "1/A", 0.0, 0.03, null=0.0, note="1/I_s, I_s the current that saturates"),),
    adds={"flux": flux},
    note="the flux saturates (rational)",
    source="Krause, Wasynczuk, Sudhoff, Analysis of Electric Machinery, chapter 1",
)
