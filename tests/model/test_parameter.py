"""Parameters: names that equations can use, bounds, and units that follow the size of a machine."""

import pytest

from armid.errors import ArmidError
from armid.model import Parameter, Scales
from armid.model.parameter import check_name, resolve

ARM = Scales(effort=1000.0, speed=2.0)
AXIS = Scales(effort=150.0, speed=0.3, effort_unit="N", length_unit="m")


def test_names() -> None:
    for name in ("p0", "eta3", "h", "np", "abs", "I6_loaded", "match"):
        check_name(name, "parameter")
    for name in ("a b", "2a", "lambda", "a__b", "_a", "a_", "", "a.b"):
        with pytest.raises(ArmidError, match=f"^parameter '{name}' is no usable name"):
            Parameter(name, "1", 0.0, 1.0)
    with pytest.raises(ArmidError, match="state 'time' cannot have this name: in the equations, time is"):
        check_name("time", "state")


@pytest.mark.parametrize(("low", "high"), [(1.0, 1.0), (2.0, 1.0), (float("nan"), 1.0), (0.0, float("nan"))])
def test_bounds_that_are_no_interval_are_refused(low: float, high: float) -> None:
    with pytest.raises(ArmidError, match=r"parameter 'a' has low .* and high .*: low < high is expected"):
        Parameter("a", "1", low, high)


@pytest.mark.parametrize(("unit", "scales", "si", "size"), [
    ("effort", ARM, "N m", 1000.0), ("speed", ARM, "rad/s", 2.0), ("effort/speed", ARM, "N m s/rad", 500.0),
    ("effort/speed^2", ARM, "N m s2/rad2", 250.0), ("inertia", ARM, "kg m2", 500.0), ("effort", AXIS, "N", 150.0),
    ("effort/speed", AXIS, "N s/m", 500.0), ("inertia", AXIS, "kg", 500.0), ("speed*s", AXIS, "m", 0.3),
])  # fmt: skip
def test_products_of_scales_become_si(unit: str, scales: Scales, si: str, size: float) -> None:
    found = resolve(Parameter("c", unit, -1.0, 2.0, null=0.0, fixed=0.5, nominal=0.25), scales)
    assert found.unit == si
    assert (found.low, found.high) == pytest.approx((-size, 2 * size))
    assert (found.null, found.fixed, found.nominal) == pytest.approx((0.0, 0.5 * size, 0.25 * size))


def test_physical_units_stay_and_a_misspelt_scale_is_refused() -> None:
    for unit in ("Pa", "1", "kg m2", "s", "N m s/rad"):
        parameter = Parameter("c", unit, 1.0, 2.0)
        assert resolve(parameter, ARM) is parameter
    with pytest.raises(ArmidError, match=r"'sped'.*'speed'"):
        resolve(Parameter("c", "effort/sped", 0.0, 1.0), ARM)
