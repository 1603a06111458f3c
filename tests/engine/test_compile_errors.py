"""Equations that cannot be compiled are refused with one sentence that names them."""

import functools
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from armid.engine import simulate
from armid.errors import ArmidError
from armid.model import PLANTS, Effect, Manoeuvre, Model, Parameter

MANOEUVRE = Manoeuvre(0.01, 20, inputs={"u": np.ones(20)})
TABLE = {"a": 1.0}


def itself(omega, level):
    """Call itself."""
    return itself(omega, level)


def unknown_object(omega, level):
    return TABLE["a"] * omega * level


def nothing_returned(omega, level):
    omega + level


def odd_default(omega, level, table=TABLE):
    return omega * level


def sometimes_nothing(omega, level):
    if omega > 0:
        return None
    return level


def imports(omega, level):
    import math

    return math.sin(omega) * level


def plain(omega, level):
    return -omega * level


class Owner:
    """Something with a method."""

    def method(self, omega, level):
        return -omega * level


typed: dict[str, Any] = {}
exec("def typed_in(omega, level): return -omega * level", typed)

TOLD = {
    "or": (lambda omega, level: -level / (omega or 1e-9),
            "'omega or 1e-09' joins numbers by `or`: conditions are expected"),
    "calls itself": (itself, "the equation itself calls itself: write it as a loop"),
    "object": (unknown_object, r"the equation unknown_object uses 'TABLE' \(dict\), which cannot be compiled: numpy"),
    "module": (lambda omega, level: random.random() * level, r"uses 'random' \(module\), which cannot be compiled"),
    "builtin": (lambda omega, level: sorted([omega, level]), "uses 'sorted', which cannot be compiled"),
    "no return": (nothing_returned, "the equation nothing_returned returns nothing: a number is expected"),
    "default": (odd_default, "the equation odd_default has the default {'a': 1.0}: a number is expected"),
    "no source": (typed["typed_in"], "the source of the equation typed_in cannot be read: define it in a file"),
    "partial": (functools.partial(plain), "is not a plain Python function: write it as a def"),
    "method": (Owner().method, "the equation Owner.method is not a plain Python function: write it as a def"),
}  # fmt: skip
COMPILED = {
    "arrays": (lambda omega, level: level * np.linalg.norm(omega),
               r"the equation 'bad.torque' cannot be compiled \(numba has no norm\(float64\)\): numpy"),
    "import": (imports, r"the equation 'bad.torque' cannot be compiled \(numba: Use of unsupported opcode"),
    "None": (sometimes_nothing, r"the equation 'bad.torque' cannot be compiled \(it does not return a number in every"),
}  # fmt: skip


def refused(function: Callable[..., Any], sentence: str) -> ArmidError:
    bad = Effect("bad", (Parameter("level", "effort", 0, 1, null=0.0),), {"torque": function})
    with pytest.raises(ArmidError, match=sentence) as caught:
        simulate(Model(PLANTS["driven_axis"]) + bad, MANOEUVRE, [[1.0, 0.1]])
    assert "\n" not in str(caught.value)
    return caught.value


@pytest.mark.parametrize(("function", "sentence"), TOLD.values(), ids=TOLD)
def test_what_cannot_be_written_down(function: Callable[..., Any], sentence: str) -> None:
    refused(function, sentence)


@pytest.mark.parametrize(("function", "sentence"), COMPILED.values(), ids=COMPILED)
def test_what_numba_cannot_compile(function: Callable[..., Any], sentence: str) -> None:
    error = refused(function, sentence)
    assert error.__cause__ is not None, "the cause must not be lost"
