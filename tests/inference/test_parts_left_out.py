"""Which model is in force where none is right: the one that predicts what its fit has not seen."""

from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

from armid.inference.hypothesis import Hypothesis

CARRY_OVER = import_module("armid.inference.carry_over")
NONE, ONE, TWO = (frozenset(Hypothesis("effect", n) for n in names) for names in ((), ("a",), ("a", "b")))
LIBRARY = SimpleNamespace(say=lambda _: None, each=lambda work, items: [work(x) for x in items])


@pytest.mark.parametrize(
    ("squares", "best"),
    [
        # Two effects miss each part by half as much, but for the loudest one, which alone would decide a mean.
        ([[9e3, 40, 30, 20, 60], [5e3, 20, 16, 10, 32], [6e3, 10, 7, 5, 15]], TWO),
        # A second effect predicts parts better and worse in turn: the fewest effects within one standard error.
        ([[90, 80, 99, 85, 95], [20, 21, 22, 19, 20], [14, 26, 24, 13, 21]], ONE),
        ([[2, 2, 2, 2, 2], [3, 3, 3, 3, 3], [4, 4, 4, 4, 4]], NONE),
        ([[2, 2, 2, 2, 2], [1, 1, 1, 1, 1], [1, np.inf, 1, 1, 1]], ONE),
    ],
)
def test_the_fewest_effects_that_predict_as_the_best_are_in_force(monkeypatch, squares, best):
    fits = dict(zip((NONE, ONE, TWO), squares, strict=True))
    monkeypatch.setattr(CARRY_OVER, "misses", np.log)
    assert CARRY_OVER.predicting_best((TWO, NONE, ONE), fits, LIBRARY) == best
