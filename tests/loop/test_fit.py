"""What is left out in turn when a larger model is judged; effects that may as well be at their nulls."""

from types import SimpleNamespace

import numpy as np
import pytest

from armid.inference.library import EffectKey
from armid.inference.model import Fit
from armid.loop import search
from armid.loop.fit import is_undetermined, parts_to_judge

N = 100
PARTS = [np.arange(N), np.arange(N, 2 * N), np.arange(2 * N, 3 * N)]


def models(slopes, size, n_parts=2, n_manoeuvres=0):
    """A smaller model that leaves `size` at each sample, and a larger one with two parameters of such slopes."""
    jacobian = np.concatenate([np.tile(row, (N, 1)) for row in slopes[:n_parts]])
    data = SimpleNamespace(n_manoeuvres=n_manoeuvres or n_parts, parts=lambda: PARTS[:n_parts],
                           blocks=lambda part: np.array_split(part, 5))  # fmt: skip
    larger = SimpleNamespace(jacobian=jacobian, n_free=2, records=SimpleNamespace(data=data))
    return SimpleNamespace(residual=np.full(n_parts * N, size)), larger


# Each record sees its own parameter alone, or both see both.
APART = [(50.0, 0.0), (0.0, 50.0), (50.0, 50.0)]
TOGETHER = [(50.0, 0.0), (50.0, 1.0), (0.0, 50.0)]


def test_manoeuvres_that_do_not_determine_each_other_are_judged_in_blocks():
    parts = parts_to_judge(*models(APART, 2.0))
    assert len(parts) == 10
    assert np.array_equal(np.sort(np.concatenate(parts)), np.arange(2 * N))


def test_the_one_of_three_that_the_others_do_not_determine_is_judged_in_blocks():
    """So it is with the record of a load that no other has: what the rest predicts of it says nothing."""
    parts = parts_to_judge(*models([(50.0, 0.0), (50.0, 1.0), (50.0, 50.0)], 2.0, 3))
    assert [len(p) for p in parts] == [N, N, *5 * [N // 5]]


@pytest.mark.parametrize(("slopes", "size", "n_parts"), [
    (TOGETHER, 2.0, 2), (APART, 50.0, 2), (APART, 2.0, 3), (TOGETHER, 2.0, 1),
])  # fmt: skip
def test_others_are_left_out_whole(slopes, size, n_parts):
    """They predict each other, the effect is larger than what they leave open, a third sees both, or there is one."""
    parts = parts_to_judge(*models(slopes, size, n_parts))
    assert [len(p) for p in parts] == [N] * n_parts


def test_blocks_of_the_only_manoeuvre_are_not_cut_again():
    assert len(parts_to_judge(*models(APART, 2.0))) == 10
    assert [len(p) for p in parts_to_judge(*models(APART, 2.0, n_manoeuvres=1))] == [N, N]


def test_the_spread_is_that_of_the_linear_prediction():
    """One parameter unseen by the rest has the variance 1/12 of its range, so that its slope s makes s^2/12."""
    for size, expected in ((14.0, True), (15.0, False)):
        assert is_undetermined(*models([(0.0, 0.0), (0.0, 50.0)], size), PARTS[1]) is expected
    assert pytest.approx(14.43**2, rel=1e-3) == 50.0**2 / 12


DRAG = EffectKey("drag")


def fit_with(level, trust, started=0.0):
    """A linear model of a parameter, and of an effect whose strength is at some share of its range from its null.

    started: how far a deviation of a measured start would move the strength, in standard deviations of it.
    """
    jacobian = np.random.default_rng(1).normal(size=(400, 3)) @ np.array(
        [[9.0, 6.0, 0.0], [0.0, 5.0, 1.0], [0, 0, 4.0]]
    )
    names = ("inertia", "drag.level", "drag.width")
    nulls = {"inertia": None, "drag.level": -1.0, "drag.width": None}
    space = SimpleNamespace(free=np.ones(3, dtype=bool), low=-np.ones(3), high=np.ones(3), free_names=names)
    records = SimpleNamespace(
        space=space, model=SimpleNamespace(parameters={n: SimpleNamespace(null=v) for n, v in nulls.items()}),
        data=SimpleNamespace(trust=lambda residual: np.full(400, trust)), values=lambda z: 2.0 * z - 1.0,
    )  # fmt: skip
    fit = Fit((DRAG,), records, np.array([0.5, level, 0.5]), np.zeros(400))
    fit.__dict__["jacobian"] = jacobian
    deviation = np.sqrt(np.linalg.inv(trust * jacobian.T @ jacobian)[1, 1])
    fit.__dict__["start_slopes"] = started * deviation * jacobian[:, 1:2]
    return fit, deviation


@pytest.mark.parametrize("trust", [1.0, 0.04])
def test_an_effect_is_needed_whose_interval_does_not_hold_its_null(trust):
    deviation = fit_with(0.0, trust)[1]
    assert [fit_with(k * deviation, trust)[0].needs(DRAG) for k in (0.0, 1.9, 2.05, 9.0)] == [False, False, True, True]
    assert [fit_with(k * deviation, trust, 2.0)[0].needs(DRAG) for k in (2.05, 4.3, 4.5)] == [False, False, True]


def test_a_model_is_pruned_and_fitted_again_from_where_it_stands(monkeypatch):
    keys = [EffectKey(name) for name in "abc"]

    def model(active, chi2):
        return SimpleNamespace(active=tuple(active), chi2=chi2, values={}, needs=lambda key: key.name != "b")

    whole, known, better = model(keys, 1.0), model((keys[0], keys[2]), 3.0), model((keys[0], keys[2]), 1.5)
    monkeypatch.setattr(search, "finished_near", lambda active, values, library: better)
    found = search.Search(None, fits={frozenset(f.active): f for f in (whole, known)})
    assert found.pruned(whole) is better
    assert found.pruned(known) is known
    assert found.fits[frozenset(better.active)] is better
