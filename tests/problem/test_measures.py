"""The measures against one line of numpy each."""

import numpy as np
import pytest

from armid.problem.fitness import chi_square, mean_square, relative_mean_square

rng = np.random.default_rng(1)
X = rng.standard_normal(333)
ROWS = X + 0.3 * rng.standard_normal((17, 333))
FAILED = [3, 8, 16]

MEASURES = {
    "mean_square": (mean_square, lambda x, y: np.mean((x - y) ** 2, axis=1)),
    "relative": (relative_mean_square, lambda x, y: np.mean((x - y) ** 2, axis=1) / np.mean(x**2)),
    "chi_square": (lambda x, y: chi_square(x, y, 0.3), lambda x, y: np.sum(((x - y) / 0.3) ** 2, axis=1)),
}


@pytest.mark.parametrize("name", MEASURES)
def test_agrees_with_numpy(name: str) -> None:
    measure, literal = MEASURES[name]
    np.testing.assert_allclose(measure(X, ROWS), literal(X, ROWS), rtol=1e-13)
    assert measure(X, X[np.newaxis])[0] == 0.0


@pytest.mark.parametrize("name", MEASURES)
def test_a_failed_candidate_is_infinitely_far_and_harms_no_other(name: str) -> None:
    measure, _ = MEASURES[name]
    rows = ROWS.copy()
    rows[FAILED, [0, 5, 332]] = [np.nan, np.inf, -np.inf]
    values = measure(X, rows)
    assert (values[FAILED] == np.inf).all()
    np.testing.assert_array_equal(np.delete(values, FAILED), np.delete(measure(X, ROWS), FAILED))


@pytest.mark.parametrize("noise", [0.0, -1.0, np.nan, np.inf])
def test_refuses_noise_that_is_none(noise: float) -> None:
    with pytest.raises(ValueError, match="expected an rms above 0"):
        chi_square(X, ROWS, noise)


def test_refuses_a_zero_measurement_to_divide_by() -> None:
    with pytest.raises(ValueError, match="zero throughout"):
        relative_mean_square(np.zeros(3), np.ones((1, 3)))
