"""Parameters and names: what equations can use."""

import pytest

from armid.errors import ArmidError
from armid.model import Parameter
from armid.model.parameter import check_name


@pytest.mark.parametrize("name", ["a b", "2a", "lambda", "a__b", "_a", "a_", "", "a.b", "time"])
def test_a_name_that_equations_cannot_use_is_refused(name: str) -> None:
    with pytest.raises(ArmidError, match=f"^parameter '{name}' "):
        Parameter(name, "1", 0.0, 1.0)


@pytest.mark.parametrize("name", ["p0", "eta3", "h", "np", "abs", "I6_loaded", "match"])
def test_a_name_that_equations_can_use(name: str) -> None:
    check_name(name, "parameter")


def test_the_name_of_the_time_is_taken() -> None:
    with pytest.raises(ArmidError, match="state 'time' cannot have this name: in the equations, time is"):
        check_name("time", "state")


@pytest.mark.parametrize(("low", "high"), [(1.0, 1.0), (2.0, 1.0), (float("nan"), 1.0), (0.0, float("nan"))])
def test_bounds_that_are_no_interval_are_refused(low: float, high: float) -> None:
    with pytest.raises(ArmidError, match=r"parameter 'a' has low .* and high .*: low < high is expected"):
        Parameter("a", "1", low, high)
