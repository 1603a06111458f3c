"""Linear algebra of the tests for noise."""

from types import SimpleNamespace

import numpy as np
import pytest

from armid.inference.checks import spectra, square_along
from armid.inference.model import decomposed


@pytest.mark.parametrize("rank", [1, 3, 5])
def test_the_part_along_columns_is_that_of_a_decomposition_whatever_their_rank(rank):
    rng = np.random.default_rng(rank)
    columns = rng.standard_normal((300, rank)) @ rng.standard_normal((rank, 5)) * np.logspace(-3, 3, 5)
    values = rng.standard_normal(300)
    basis, inverse = decomposed(columns)
    square, found = square_along(columns, values)
    assert found == rank == basis.shape[1]
    assert square == pytest.approx(float(np.sum((basis.T @ values) ** 2)), rel=1e-9)
    np.testing.assert_allclose(columns @ (inverse @ values), basis @ (basis.T @ values), atol=1e-8)


def test_a_record_without_a_rest_adds_no_ordinate():
    """Records in motion have none, while the rest of others shows coloured noise."""
    record, level = SimpleNamespace(spacing=0.01), SimpleNamespace(rms=1.0)
    seen = SimpleNamespace(data=SimpleNamespace(each=(record, record), levels=(level, level)))
    rest = np.random.default_rng(1).normal(size=400)
    alone = SimpleNamespace(data=SimpleNamespace(each=(record,), levels=(level,)))
    assert spectra([rest, np.empty(0)], seen, []) == spectra([rest], alone, [])
