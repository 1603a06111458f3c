"""The fast similarity degree against Eqs 10-14 as they are printed, written out below without any haste."""

from itertools import pairwise

import numpy as np
import pytest

from arm_cases import REFERENCE
from armid.problem.similarity import numerical_similarity, similarity

INTERVAL, EPSILON, XI, THRESHOLD = 0.001, 0.03, 0.030, 0.2


def literal_s1(x, y):
    """Eqs 11-13, case by case; negative s_i clipped to 0."""
    total = 0.0
    for a, b in zip(x, y, strict=True):
        if a == 0.0 and b == 0.0:
            s = 1.0
        elif a == 0.0 or b == 0.0 or (a < 0.0) != (b < 0.0):
            s = 0.0
        else:
            s = max(0.0, 1.0 - abs(a - b) / abs(a))
        total += s * abs(a)
    return float(total / sum(abs(a) for a in x))


def literal_landmarks(x, interval, epsilon, xi):
    """Steps 1 to 4 of section III.B; returns the ends of the subintervals and the normalised levels there."""
    low, high = min(x), max(x)
    level = [float((v - low) / (high - low)) for v in x]
    steps = [(i, level[i + 1] - level[i]) for i in range(len(x) - 1) if level[i + 1] != level[i]]
    extrema = [i + 1 for (i, d), (_, e) in pairwise(steps) if d * e < 0]
    while True:
        small = []
        for k in range(len(extrema) - 1):
            a, b = extrema[k], extrema[k + 1]
            if abs(level[b] - level[a]) < epsilon and (b - a) * interval < xi:
                small.append((abs(level[b] - level[a]), k))
        if not small:
            ends = [0, *extrema, len(x) - 1]
            return ends, [level[i] for i in ends]
        _, k = min(small)
        del extrema[k : k + 2]


def literal_pairs(ends, ends2):
    """Pair subintervals by order, or by overlap, largest first, when their numbers differ."""
    n, n2 = len(ends) - 1, len(ends2) - 1
    if n == n2:
        return [(i, i) for i in range(n)]
    overlaps = []
    for i in range(n):
        for j in range(n2):
            overlap = min(ends[i + 1], ends2[j + 1]) - max(ends[i], ends2[j])
            if overlap > 0:
                overlaps.append((-overlap, i, j))
    pairs = []
    for _, i, j in sorted(overlaps):
        if all(i != p and j != q for p, q in pairs):
            pairs.append((i, j))
    return pairs


def literal_s2(x, y, interval, epsilon, xi, threshold):
    """Step 5 and Eq 14."""
    if min(y) == max(y):
        return 0.0
    ends, level = literal_landmarks(x, interval, epsilon, xi)
    ends2, level2 = literal_landmarks(y, interval, epsilon, xi)
    similar = 0.0
    for i, j in literal_pairs(ends, ends2):
        length, length2 = (ends[i + 1] - ends[i]) * interval, (ends2[j + 1] - ends2[j]) * interval
        if abs((level[i + 1] - level[i]) / length - (level2[j + 1] - level2[j]) / length2) < threshold:
            similar += length + length2
    return similar / (2 * (len(x) - 1) * interval)


def agree(x, rows, interval, epsilon, xi, threshold):
    """Compare the fast degree of each row with the literal one."""
    s, s1, s2 = similarity(x, rows, interval, epsilon, xi, threshold)
    literal1 = [literal_s1(x, y) for y in rows]
    literal2 = [literal_s2(x, y, interval, epsilon, xi, threshold) for y in rows]
    np.testing.assert_allclose(s1, literal1, rtol=0, atol=1e-13)
    np.testing.assert_allclose(s2, literal2, rtol=0, atol=1e-13)
    np.testing.assert_allclose(s, np.sqrt(s1 * s2), rtol=1e-15)
    np.testing.assert_array_equal(numerical_similarity(x, rows), s1)
    assert ((s >= 0) & (s <= 1) & (s1 >= 0) & (s1 <= 1) & (s2 >= 0) & (s2 <= 1)).all()


def smooth(rng, n):
    t = np.linspace(0.0, 1.0, n)
    slow = np.sin(2 * np.pi * rng.uniform(0.3, 4) * t + rng.uniform(0, 6))
    return slow + 0.3 * np.sin(2 * np.pi * rng.uniform(1, 30) * t)


SERIES = {
    "smooth": smooth,
    "noisy": lambda rng, n: smooth(rng, n) + rng.uniform(0, 0.1) * rng.standard_normal(n),
    "quantised": lambda rng, n: np.round(smooth(rng, n) + 0.02 * rng.standard_normal(n), 1),
    "finely quantised": lambda rng, n: np.round((smooth(rng, n) + 0.03 * rng.standard_normal(n)) / 0.02) * 0.02,
    "few levels": lambda rng, n: rng.integers(0, rng.integers(2, 9), n).astype(float),
    "plateaus": lambda rng, n: np.repeat(smooth(rng, n), 7)[:n],
    "walk": lambda rng, n: np.cumsum(rng.standard_normal(n)),
    "walk of whole steps": lambda rng, n: np.round(np.cumsum(rng.standard_normal(n))),
    "wild": lambda rng, n: rng.standard_normal(n) * np.exp(2.0 * rng.standard_normal(n)),
}


@pytest.mark.parametrize("kind", SERIES)
def test_agrees_with_the_literal_equations(kind):
    rng = np.random.default_rng([*kind.encode()])
    for n in (2, 3, 5, 10, 40, 150):
        for _ in range(12):
            x = SERIES[kind](rng, n)
            if x.min() == x.max():
                continue
            noise = rng.uniform(0.0, 0.2) * rng.standard_normal((2, n))
            rows = np.array([*(make(rng, n) for make in SERIES.values()), *(x + noise), np.round(x + noise[0], 1)])
            options = ((0.001, 0.01, 0.002), (0.03, 0.1, 0.3, 2.0), (0.03, 0.005, 0.1, 1.0), (0.2, 2.0, 20.0))
            rows = np.vstack([rows, np.full(n, x[0])])
            agree(x, rows, *(float(rng.choice(values)) for values in options))


def test_agrees_with_the_literal_equations_on_the_arm():
    """Angular velocities [rad/s] of the reference arm at 1 kHz, the first 0.7 s."""
    files, rng = sorted(REFERENCE.glob("trajectory_*.csv")), np.random.default_rng(1)
    trajectories = np.array([np.loadtxt(file, delimiter=",", skiprows=1, usecols=2)[:701] for file in files])
    assert len(trajectories) == 14
    gyro = np.deg2rad(0.15)
    for x in trajectories[:7]:
        noisy = x + np.deg2rad(0.3) * rng.standard_normal(x.size)
        agree(x, trajectories, INTERVAL, EPSILON, XI, THRESHOLD)
        agree(noisy, np.array([x, noisy[::-1].copy(), 1.01 * x]), INTERVAL, EPSILON, XI, THRESHOLD)
        agree(np.round(noisy / gyro) * gyro, trajectories[::5], INTERVAL, EPSILON, XI, 2.0)


def test_values_by_hand():
    x = np.array([0.0, 1.0, 2.0, 1.0, 0.0])
    rows = np.array([2 * x, -x, 0 * x, 0.5 * x, [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 2.0, 1.0, 1.0, 0.0]])
    s, s1, s2 = similarity(x, rows, 1.0, slope_threshold=0.3)
    np.testing.assert_allclose(s1, [0.0, 0.0, 0.0, 0.5, 0.75, 0.5])
    # 0.5 x normalises to x; the ramp has 1 interval of slope 0.25 [1/s] against 0.5, paired with the first by overlap;
    # the last has slopes 1 and -1/3 against 0.5 and -0.5, so its second interval is similar: (2 + 3) / 8
    np.testing.assert_allclose(s2, [1.0, 0.0, 0.0, 1.0, 0.75, 0.625])
    np.testing.assert_allclose(s, np.sqrt(s1 * s2))


def test_a_failed_candidate_harms_no_other_a_diverged_one_stays_within_bounds_and_layouts_do_not_matter():
    rng = np.random.default_rng(4)
    x, rows = smooth(rng, 701), np.array([smooth(rng, 701) for _ in range(12)])
    clean = np.array(similarity(x, rows, INTERVAL))
    for bad, (row, sample) in zip((np.nan, np.inf, -np.inf), ((2, 5), (5, 0), (8, 700)), strict=True):
        rows[row, sample] = bad
    spoilt = np.array(similarity(x, rows, INTERVAL))
    failed = [2, 5, 8]
    assert (spoilt[:, failed] == 0.0).all()
    np.testing.assert_array_equal(np.delete(spoilt, failed, 1), np.delete(clean, failed, 1))
    assert (numerical_similarity(x, rows)[failed] == 0.0).all()
    x = smooth(np.random.default_rng(6), 101)
    for size in (1e6, 1e150, 1e300):
        s, s1, s2 = similarity(x, size * x[np.newaxis], INTERVAL)
        assert (s[0], s1[0]) == (0.0, 0.0)
        assert 0.0 <= s2[0] <= 1.0
    rng = np.random.default_rng(7)
    x, rows = np.round(100 * smooth(rng, 60)), np.round(100 * np.array([smooth(rng, 60) for _ in range(3)]))
    expected = similarity(x, rows, 1)
    for other in (np.asfortranarray(rows), rows.astype(int), rows.tolist(), np.repeat(rows, 2, axis=1)[:, ::2]):
        np.testing.assert_array_equal(similarity(x.tolist(), other, 1), expected)
    assert all(v.shape == (0,) for v in similarity(x, np.empty((0, 60)), 1))


@pytest.mark.parametrize(("measured", "options", "sentence"), [
    (np.zeros(5), {}, "zero throughout"), (np.full(5, 2.0), {}, "constant"),
    (np.array([1.0, np.nan, 2.0, 3.0, 4.0]), {}, "1 of 5 measured values are no finite numbers"),
    (np.arange(4.0), {}, r"shape \(1, 5\), expected \(n_candidates, 4\)"),
    (np.ones((2, 5)), {}, "expected .n_samples,."), (np.arange(5.0), {"interval": 0.0}, "interval is 0.0"),
    (np.arange(5.0), {"slope_threshold": np.nan}, "slope_threshold nan"),
    (np.arange(5.0), {"epsilon": -0.1}, "epsilon is -0.1"), (np.arange(5.0), {"xi": np.inf}, "xi inf"),
])  # fmt: skip
def test_refuses_in_a_sentence(measured, options, sentence):
    with pytest.raises(ValueError, match=sentence):
        similarity(measured, np.ones((1, 5)), **{"interval": 0.001, **options})
    with pytest.raises(ValueError, match="zero throughout"):
        numerical_similarity(np.zeros(3), np.ones((1, 3)))
