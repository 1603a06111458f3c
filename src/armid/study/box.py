"""The box of a case: what the plant declares, then the campaign, then the study, then the case itself."""

from collections.abc import Mapping

from armid.model import ArmidError, Model
from armid.problem import Space, space_of
from armid.record import Override
from armid.study.sheet import CaseSheet, StudySheet


def box_of(
    model: Model, overrides: Mapping[str, Override], sheet: StudySheet, entry: CaseSheet | None, where: str
) -> Space:
    """Return bounds and fixed values; what the case fixes or frees holds against what the study says.

    Raises ArmidError for an unknown parameter, impossible bounds, and one both bounded and fixed in the same place.
    """
    own_bounds, own_fixed = (entry.bounds, entry.fixed) if entry else ({}, {})
    fixed = {name: v for name, v in sheet.fixed.items() if name not in own_bounds} | dict(own_fixed)
    bounds = {name: b for name, b in sheet.bounds.items() if name not in own_fixed} | dict(own_bounds)
    try:
        return space_of(model, overrides, bounds, fixed)
    except ArmidError as error:
        raise ArmidError(f"{where}: {error}") from error
