"""The fitness `my_fitness`: how far a simulated motion is from the measured one.

    armid check my_fitness.py:my_fitness
    armid identify CAMPAIGN --plugin my_fitness.py:my_fitness --fitness my_fitness
"""

import numpy as np


# Arguments are bound by name. `measured` has the shape (n_samples,), `simulated` (n_candidates, n_samples), both in
# rad/s or m/s. Where the function names them it also gets `interval`, the time between samples [s], and `noise`, the
# rms of the record's noise [rad/s or m/s]. The arrays must be left as they are; a candidate that diverged is no worry.
# Records are joined by their durations; armid.Fitness("my_fitness", function, join="samples") joins otherwise.
def my_fitness(measured, simulated):
    """Return the mean deviation of each candidate [rad/s or m/s], shape (n_candidates,); smaller is better."""
    return np.abs(simulated - measured).mean(axis=1)
