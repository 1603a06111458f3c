"""Units and bounds that follow the size of a machine."""

import pytest

from armid.errors import ArmidError
from armid.model import Parameter, Scales
from armid.model.parameter import resolve

ARM = Scales(effort=1000.0, speed=2.0)
AXIS = Scales(effort=150.0, speed=0.3, effort_unit="N", length_unit="m")


@pytest.mark.parametrize(("unit", "scales", "shown", "size"), [
    ("effort", ARM, "N m", 1000.0),
    ("speed", ARM, "rad/s", 2.0),
    ("effort/speed", ARM, "N m s/rad", 500.0),
    ("effort/speed^2", ARM, "N m s2/rad2", 250.0),
    ("inertia", ARM, "kg m2", 500.0),
    ("effort", AXIS, "N", 150.0),
    ("effort/speed", AXIS, "N s/m", 500.0),
    ("inertia", AXIS, "kg", 500.0),
    ("speed*s", AXIS, "m", 0.3),
])  # fmt: skip
def test_products_of_scales_become_si(unit, scales, shown, size):
    found = resolve(Parameter("c", unit, -1.0, 2.0, null=0.0, fixed=0.5, nominal=0.25), scales)
    assert found.unit == shown
    assert (found.low, found.high) == pytest.approx((-size, 2 * size))
    assert (found.null, found.fixed, found.nominal) == pytest.approx((0.0, 0.5 * size, 0.25 * size))


@pytest.mark.parametrize("unit", ["Pa", "1", "kg m2", "s", "N m s/rad"])
def test_physical_units_stay(unit):
    parameter = Parameter("c", unit, 1.0, 2.0)
    assert resolve(parameter, ARM) is parameter


def test_misspelt_scale_is_refused():
    with pytest.raises(ArmidError, match=r"'sped'.*'speed'"):
        resolve(Parameter("c", "effort/sped", 0.0, 1.0), ARM)


@pytest.mark.parametrize("name", ["a b", "2c", "", "lambda", "a__b", "a.b"])
def test_names_that_equations_cannot_use_are_refused(name):
    with pytest.raises(ArmidError, match="no usable name"):
        Parameter(name, "1", 0.0, 1.0)


def test_bounds_that_are_no_interval_are_refused():
    with pytest.raises(ArmidError, match="low < high"):
        Parameter("c", "1", 1.0, 1.0)
