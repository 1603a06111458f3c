"""The equation of a term without a physical name: a curve over one variable, straight between eight heights."""

import numpy as np


def hat(place, knot):
    """Return the weight of a knot at a place between 0 and the last knot."""
    return np.maximum(0.0, 1.0 - np.abs(place - knot))


def curve(variable, first, last, h0, h1, h2, h3, h4, h5, h6, h7):
    """Return a curve that runs straight between eight heights and stays level beyond the first and the last."""
    place = 7.0 * np.minimum(np.maximum((variable - first) / (last - first), 0.0), 1.0)
    low = h0 * hat(place, 0.0) + h1 * hat(place, 1.0) + h2 * hat(place, 2.0) + h3 * hat(place, 3.0)
    return low + h4 * hat(place, 4.0) + h5 * hat(place, 5.0) + h6 * hat(place, 6.0) + h7 * hat(place, 7.0)


def any_curve(
    v0, v1, v2, v3, v4, v5, v6, v7, speed, effort, w0, w1, w2, w3, w4, w5, w6, w7, one, direction, driven, width,
    first, last, h0, h1, h2, h3, h4, h5, h6, h7,
):  # fmt: skip
    """Return a curve over the variable whose weight is 1, times 1, the direction of the motion, or the drive's effort.

    Which of them is a parameter, so that one compiled model serves for all.
    """
    variable = w0 * v0 + w1 * v1 + w2 * v2 + w3 * v3 + w4 * v4 + w5 * v5 + w6 * v6 + w7 * v7
    factor = one + direction * speed / np.sqrt(speed**2 + width**2) + driven * effort
    return factor * curve(variable, first, last, h0, h1, h2, h3, h4, h5, h6, h7)
