"""Further unknowns of a fit against the exact answer of straight lines."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.inference.model import Fit
from armid.inference.unknowns import Unknown, columns_about, freed

RNG = np.random.default_rng(4)


@dataclass(frozen=True, eq=False)
class Straight:
    """Records of a model without a free parameter, whose residual answers to each unknown along a column."""

    columns: Any
    residual: Any
    space: Any = None
    replays: Any = ()

    @property
    def plain(self):
        return self

    data = plain

    @property
    def measured(self):
        return self.residual

    def whole(self, Z):
        return Z

    def white(self, signals):
        return signals

    def with_known(self, _, Z):
        return np.zeros((len(Z), len(self.residual)))

    def padded(self, columns):
        return columns

    def walls(self, z):
        return np.zeros(len(z)), np.ones(len(z))

    def moved(self, i, value):
        return replace(self, residual=self.residual - value * self.columns[:, i])


def freed_of(columns, truth):
    """Return the values that unknowns come to whose true ones are given."""
    base = Straight(columns, columns @ np.array(truth))
    unknowns = [Unknown(f"u{i}", partial(lambda i, records, value: records.moved(i, value), i))
                for i in range(len(truth))]  # fmt: skip
    fit = freed(Fit((), base, np.empty(0), base.residual), base, unknowns, 1.0)
    return np.array([f.value for f in fit.others])


def exact(columns, truth):
    return np.linalg.solve(np.eye(columns.shape[1]) + columns.T @ columns, columns.T @ columns @ np.array(truth))


@pytest.mark.parametrize("truth", [(0.0, 0.0), (1.0, -0.5), (2.5, 8.0)])
def test_unknowns_come_to_their_best_values_however_far_these_are(truth):
    columns = 10.0 * RNG.normal(size=(50, 2))
    assert freed_of(columns, truth) == pytest.approx(exact(columns, truth), abs=0.01)


def test_what_diverges_where_it_starts_is_refused():
    with pytest.raises(ArmidError, match="diverges where it starts"):
        freed_of(np.full((50, 1), np.nan), (1.0,))


def test_unknowns_whose_columns_nearly_cancel_move_together():
    """Far off, each bounded by itself they would leave more than they take away."""
    common = 100.0 * RNG.normal(size=(50, 1)) * np.array([1.0, -1.0, -1.0])
    columns, truth = common + 3.0 * RNG.normal(size=(50, 3)), (10.0, 4.0, 6.0)
    values = freed_of(columns, truth)

    def cost(v):
        return float(np.sum((columns @ (np.array(truth) - v)) ** 2) + np.sum(v**2))

    assert cost(values) < 0.1 * cost(np.zeros(3))
    assert values == pytest.approx(exact(columns, truth), abs=0.1)


def test_a_bent_answer_to_an_unknown_has_the_slope_of_its_tangent():
    """What a constant does and a parameter makes up for must cancel to the last digit, or records seem to tell it."""
    columns, bend = RNG.normal(size=(50, 2)), 1e4 * RNG.normal(size=50)
    base = Straight(columns, np.zeros(50))

    def bent(records, value):
        return replace(records, residual=records.residual - value * columns[:, 1] - value**2 * bend)

    unknowns = [Unknown("straight", lambda records, value: records.moved(0, value)), Unknown("bent", bent)]
    found = columns_about(base, unknowns, np.zeros(2), np.empty(0), {})
    np.testing.assert_allclose(found, columns, atol=1e-6)


def test_the_column_of_an_unknown_next_to_a_jump_is_that_of_its_own_side():
    columns = RNG.normal(size=(50, 2))

    def jumps(records, value):
        return replace(records, residual=records.residual - value * columns[:, 1] - 100.0 * (value < 0.0))

    unknowns = [Unknown("straight", lambda records, value: records.moved(0, value)), Unknown("jumps", jumps)]
    found = columns_about(Straight(columns, np.ones(50)), unknowns, np.zeros(2), np.empty(0), {})
    np.testing.assert_allclose(found, columns, atol=1e-6)
