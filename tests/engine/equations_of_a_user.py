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


def with_helper(omega, level):
    return -level * smooth_sign(omega)


def with_helper_by_name(omega, level):
    """A helper called with named arguments, in another order."""
    return -level * smooth_sign(width=0.1, x=omega)


def helper_named_as_port(omega, level):
    return torque(level * omega)


def helper_of_helper(omega, level):
    return s(torque(level * omega))


def constants(omega, level):
    """Constants of the file, a negative one to a power among them."""
    return level * (NEGATIVE**EXPONENT * omega + NEGATIVE**5 * WIDTH) / 9.0


def constants_of_modules(omega, level):
    return -level * omega * math.pi / np.pi + math.e * 0.0


def imported_by_name(omega, level):
    return -level * direction_of(omega) * sqrt(abs(omega) + 1.0)


def choice(omega, level):
    return -level if omega > 0.0 else (level if omega < 0.0 else 0.0)


def logic(omega, level):
    return -level * (1.0 if (0.0 < omega <= 0.2 and not level > 100.0) or omega > 1.0 else 0.5)


def several_lines(omega, level):
    push: float = level * omega
    push *= 2.0
    push -= 0.1 * level
    return -push


def where_and_clip(omega, level):
    return -level * np.clip(np.where(np.abs(omega) > 0.1, omega, 0.0), -0.5, 0.5)


def three_at_once(omega, level):
    return -min(level, max(omega, 0.1, -omega), 5.0)


def defaults(omega, level, /, share=0.5, offset=-WIDTH):
    return -level * omega * share + offset * level


def powers(omega, level):
    return -level * (omega**2 + omega**3 + abs(omega) ** 1.5 + (1.0 + omega**2) ** -1 + np.abs(omega) ** 0.5)


def branches(omega, level):
    """An `if` makes the function run lane by lane."""
    if omega > 0.3:
        return -level
    if omega > 0.1:
        return -0.5 * level
    return 0.0


def nested_selections(omega, level):
    return np.where(omega > 0.3, -level, np.where(omega > 0.1, -0.5 * level, 0.0))


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


def rare(omega, level):
    return -level * (np.arcsinh(omega) + math.expm1(omega) + omega % 0.1 + np.ceil(omega) + round(omega, 2))


def calls_branches(omega, level):
    """A helper that runs lane by lane makes its caller do so."""
    return 0.5 * branches(omega, level)


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


closed_over = made(2.0)
short = lambda omega, level: -level * omega  # noqa: E731 - equations may be lambdas
pair = (lambda omega, level: level + omega * 0.0, lambda omega, level: level * (omega if omega > 0.0 else -2.0))

VECTOR = [
    plain, with_helper, with_helper_by_name, helper_named_as_port, helper_of_helper, constants, constants_of_modules,
    imported_by_name, choice, logic, several_lines, where_and_clip, three_at_once, defaults, powers, closed_over, short,
    *pair, nested_selections,
]  # fmt: skip
BY_LANE = [branches, loop, repeated, rare, calls_branches, names_of_the_loop]
