"""What a machine is asked to do: steps, random steps, PRBS, chirp, multisine and ramps."""

import numpy as np

from machines.catalogue import Array

HELD = ("steps", "random_steps", "prbs")
SMOOTH = ("chirp", "multisine", "ramps")
KINDS = (*HELD, *SMOOTH)


def excitation(kind: str, times: Array, slowest: float, rng: np.random.Generator) -> Array:
    """Return a signal between -1 and 1 at the times [s], (n_samples,), 0 at first.

    slowest: time [s] that the machine needs to answer; levels last at least as long, and the highest frequency of a
    chirp or a multisine is 1/slowest. Sources: Ljung, System Identification, chapter 13; Schroeder 1970 (phases).
    """
    n, length = times.size, float(times[-1])
    rest = int(rng.integers(2, max(3, n // 12)))
    if kind in ("steps", "random_steps"):
        edges = edges_of(times, slowest * (2.0 if kind == "steps" else 1.0), rng)
        levels = rng.uniform(-1.0, 1.0, edges.size + 1)
        if kind == "steps":
            levels = np.where(np.arange(levels.size) % 2 == 0, rng.uniform(0.6, 1.0), -rng.uniform(0.0, 1.0))
        signal = levels[np.searchsorted(edges, times, side="right")]
    elif kind == "prbs":
        period = max(0.5 * slowest, 2.0 * (times[1] - times[0]))
        bits = rng.integers(0, 2, int(length / period) + 2)
        signal = 2.0 * bits[(times / period).astype(int)] - 1.0
    elif kind == "chirp":
        low, high = 2.0 / length, max(1.0 / slowest, 6.0 / length)
        signal = np.sin(2.0 * np.pi * (low * times + 0.5 * (high - low) / length * times**2))
    elif kind == "multisine":
        count = int(np.clip(length / slowest, 4, 20))
        order = np.arange(1, count + 1)
        phases = -np.pi * order * (order - 1) / count + rng.uniform(0.0, 2.0 * np.pi)
        waves = np.sin(2.0 * np.pi * order[:, None] * times / length + phases[:, None])
        signal = np.sum(waves, axis=0)
        signal = signal / np.max(np.abs(signal))
    else:
        edges = np.concatenate([[0.0], edges_of(times, 2.0 * slowest, rng), [length]])
        signal = np.interp(times, edges, np.append(0.0, rng.uniform(-1.0, 1.0, edges.size - 1)))
    if kind in HELD:
        return np.where(np.arange(n) < rest, 0.0, signal)
    # a smooth signal rises from 0 without a step
    return np.asarray(signal * np.clip((np.arange(n) - rest) / max(n // 20, 1), 0.0, 1.0))


def edges_of(times: Array, shortest: float, rng: np.random.Generator) -> Array:
    """Return the times of changes [s], each on a sample and at least `shortest` after the last."""
    edges, at, length = [], 0.0, float(times[-1])
    while at < length:
        at += max(shortest * float(rng.uniform(1.0, 3.0)), length / 25.0)
        edges.append(at)
    places = np.searchsorted(times, [e for e in edges if e < length])
    return times[np.minimum(places, times.size - 1)]
