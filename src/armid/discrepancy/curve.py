"""Equations of a term without a physical name: a curve over one variable, straight between eight heights."""

import numpy as np


def hat(place, knot):
    """Return the weight of a knot at a place between 0 and the last knot."""
    return np.maximum(0.0, 1.0 - np.abs(place - knot))


def curve(variable, first, last, h0, h1, h2, h3, h4, h5, h6, h7):
    """Return a curve that runs straight between eight heights and stays level beyond the first and the last."""
    place = 7.0 * np.minimum(np.maximum((variable - first) / (last - first), 0.0), 1.0)
    low = h0 * hat(place, 0.0) + h1 * hat(place, 1.0) + h2 * hat(place, 2.0) + h3 * hat(place, 3.0)
    return low + h4 * hat(place, 4.0) + h5 * hat(place, 5.0) + h6 * hat(place, 6.0) + h7 * hat(place, 7.0)


def directed(variable, speed, width, first, last, h0, h1, h2, h3, h4, h5, h6, h7):
    """Return the curve against or along the motion: times the sign of the speed, smoothed over a width."""
    sign = speed / np.sqrt(speed**2 + width**2)
    return sign * curve(variable, first, last, h0, h1, h2, h3, h4, h5, h6, h7)


def driven(variable, effort, first, last, h0, h1, h2, h3, h4, h5, h6, h7):
    """Return the curve times the effort of the drive."""
    return effort * curve(variable, first, last, h0, h1, h2, h3, h4, h5, h6, h7)
