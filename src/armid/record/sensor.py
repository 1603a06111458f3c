"""The sensor of an output, found from its values as they were read: its step and how long it holds a value."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.model import Array

Mask = NDArray[np.bool_]
# A step that is a smaller share of the largest value is the rounding of printed numbers.
FINEST_STEP = 1e-6
# Share of the values that are sound in any record.
NEARLY_ALL = 0.98
# How far from a multiple of the step a value may lie, in steps: printed numbers are rounded once more.
OFF_STEP = 0.05
# Steps that the closest two values may be apart, and the gaps between values that make a finer step no chance.
MOST_PARTS, FEWEST_GAPS = 3, 8
# Changes of the value from which a hold is found.
FEWEST_CHANGES = 20
# Renewals after which clocks that differ have drifted: longer pauses tell nothing of a hold.
MOST_RENEWALS = 3.5
# This share of all changes comes within a quarter of a hold of a multiple of it: by chance only half of them do.
ON_TIME, QUARTER = 0.9, 0.25
# ... and at least this share of the changes differs from a single step onward: a slow motion makes such steps.
UNLIKE_SLOW_MOTION = 0.2


@dataclass(frozen=True)
class Sensor:
    """Hold what the values of one output tell of its sensor.

    step: all values are multiples of it [unit of the output], 0 for a fine one. hold: samples from one renewal of
    the value to the next, 1 where each sample is new.
    """

    step: float = 0.0
    hold: int = 1


def sensor_of(values: Array) -> Sensor:
    """Return the sensor of the values of one output as they were read, (n_rows,)."""
    return Sensor(step_of(values), hold_of(values))


def step_of(values: Array) -> float:
    """Return the step [unit] that all differences of values are multiples of, 0 for a fine sensor.

    The gaps between neighbouring levels count a few steps each, so that their sum over their counts is the step to
    the last digit, however the numbers were printed.
    """
    gaps = np.diff(np.unique(values))
    # some wild values are on no grid, far from all others
    gaps = gaps[gaps <= np.quantile(gaps, NEARLY_ALL, method="higher")] if gaps.size else gaps
    is_rounding = gaps <= FINEST_STEP * float(np.quantile(np.abs(values), NEARLY_ALL))
    rounding, gaps = gaps[is_rounding], gaps[~is_rounding]
    if not gaps.size or float(np.sum(rounding)) > 1e-3 * float(np.sum(gaps)):
        return 0.0
    # among few values the closest two may be two or three steps apart
    for parts in range(1, MOST_PARTS + 1 if gaps.size >= FEWEST_GAPS else 2):
        counts = np.rint(gaps * parts / np.min(gaps))
        step = float(np.sum(gaps) / np.sum(counts))
        if np.all(np.abs(gaps - counts * step) <= OFF_STEP * step):
            return step
    return 0.0


def hold_of(values: Array) -> int:
    """Return after how many samples the sensor renews its value, 1 where each sample is new.

    A sensor that holds its value changes it after multiples of one time alone, whatever the motion. A coarse sensor of
    a slow motion does so as well where the motion is even; but then each change is one step onward.
    """
    places = np.flatnonzero(np.diff(values) != 0.0)
    if places.size < FEWEST_CHANGES:
        return 1
    apart, changes = np.diff(places), np.diff(values)[places]
    least = int(np.quantile(apart, 0.1))
    hold = float(np.mean(apart[(apart >= least - 1) & (apart < 1.5 * least)]))
    # of two samples and a half every number of samples is within a quarter of a multiple
    if hold < 3.0 and hold != 2.0:
        return 1
    short = apart[apart < MOST_RENEWALS * hold]
    on_time = np.abs(short / hold - np.maximum(np.rint(short / hold), 1.0)) < QUARTER
    if float(np.mean(on_time)) < ON_TIME or 2 * short.size < apart.size:
        return 1
    single = 1.5 * float(np.min(np.abs(changes)))
    onward = (np.abs(changes[1:]) <= single) & (np.sign(changes[1:]) == np.sign(changes[:-1]))
    return round(hold) if float(np.mean(~onward)) >= UNLIKE_SLOW_MOTION else 1


def renewed(values: Array, hold: int) -> Mask:
    """Return which rows bring a new value, (n_rows,): each first of a hold, as well where the new value is as the old.

    values: (n_rows,), as they were read.
    """
    if hold == 1:
        return np.ones(values.size, dtype=np.bool_)
    changed = np.append(True, np.diff(values) != 0.0)
    begins = np.flatnonzero(changed)
    since = np.arange(values.size) - np.repeat(begins, np.diff(np.append(begins, values.size)))
    left = np.repeat(np.diff(np.append(begins, values.size)), np.diff(np.append(begins, values.size))) - since
    # the last renewal of a run that is as old as half a hold when the run ends was none
    return np.asarray(changed | ((since % hold == 0) & (2 * left > hold)))
