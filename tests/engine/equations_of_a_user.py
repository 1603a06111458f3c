"""Equations as a user may write them: helpers, constants, choices, loops. Each takes omega and level."""

import math
from math import sqrt

import numpy as np
from numpy import sign as direction_of

WIDTH = 0.05
EXPONENT = 2
NEGATIVE = -3.0
STEPS = 3


def smooth_sign(x, width=WIDTH):
    return x / np.sqrt(x**2 + width**2)


def torque(x):
    return -x


def s(x):
    """A helper whose name begins many others."""
    return -0.5 * x


def plain(omega, level):
    return -level * omega


def several_lines(omega, level):
    push: float = level * omega
    push *= 2.0
    push -= 0.1 * level
    return -push


def defaults(omega, level, /, share=0.5, offset=-WIDTH):
    return -level * omega * share + offset * level


def branches(omega, level):
    """An `if` makes the function run lane by lane."""
    if omega > 0.3:
        return -level
    if omega > 0.1:
        return -0.5 * level
    return 0.0


def loop(omega, level):
    total = 0.0
    for step in range(STEPS):
        total += level * omega / (1.0 + step)
    return -total


def repeated(omega, level):
    x = omega
    while x > 0.05:
        x = x - 0.05
    return -level * x


def names_of_the_loop(omega, level):
    """Local names that the generated module uses itself."""
    i, result, lane, splat, np_, h = omega, level, 1.0, 2.0, 3.0, 4.0
    if i > 0.0:
        return -result * i * lane * splat / (np_ + h)
    return 0.0


def made(factor):
    def closure(omega, level):
        return -factor * level * smooth_sign(omega)

    return closure


# Helpers, also by named arguments in another order; constants of the file and of modules, a negative one to a power;
# names that are imported; choices, logic and selections; powers.
VECTOR = [
    plain, several_lines, defaults, made(2.0),
    lambda omega, level: -level * smooth_sign(omega),
    lambda omega, level: -level * smooth_sign(width=0.1, x=omega),
    lambda omega, level: torque(level * omega),
    lambda omega, level: s(torque(level * omega)),
    lambda omega, level: level * (NEGATIVE**EXPONENT * omega + NEGATIVE**5 * WIDTH) / 9.0,
    lambda omega, level: -level * omega * math.pi / np.pi + math.e * 0.0,
    lambda omega, level: -level * direction_of(omega) * sqrt(abs(omega) + 1.0),
    lambda omega, level: -level if omega > 0.0 else (level if omega < 0.0 else 0.0),
    lambda omega, level: -level * (1.0 if (0.0 < omega <= 0.2 and not level > 100.0) or omega > 1.0 else 0.5),
    lambda omega, level: -level * np.clip(np.where(np.abs(omega) > 0.1, omega, 0.0), -0.5, 0.5),
    lambda omega, level: -min(level, max(omega, 0.1, -omega), 5.0),
    lambda omega, level: -level * (omega**2 + omega**3 + abs(omega) ** 1.5 + (1.0 + omega**2) ** -1),
    lambda omega, level: -level * np.abs(omega) ** 0.5,
    lambda omega, level: np.where(omega > 0.3, -level, np.where(omega > 0.1, -0.5 * level, 0.0)),
    *(lambda omega, level: level + omega * 0.0, lambda omega, level: level * (omega if omega > 0.0 else -2.0)),
]  # fmt: skip
# Calls that no lanes have, and a helper that makes its caller run lane by lane.
BY_LANE = [
    branches, loop, repeated, names_of_the_loop,
    lambda omega, level: -level * (np.arcsinh(omega) + math.expm1(omega) + omega % 0.1),
    lambda omega, level: -level * (np.ceil(omega) + round(omega, 2)),
    lambda omega, level: 0.5 * branches(omega, level),
]  # fmt: skip
