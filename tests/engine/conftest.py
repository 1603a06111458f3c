"""Models of the arm, and schedules calibrated once."""

from functools import cache

import pytest

from arm_cases import box_of, index_rows, manoeuvre_of
from armid.engine import calibrate, probes
from armid.model import EFFECTS, Model, applicable


@pytest.fixture(scope="session")
def manoeuvres():
    return {row["manoeuvre"]: manoeuvre_of(row) for row in index_rows()}


@pytest.fixture(scope="session")
def rubbing_arm(arm):
    return arm + EFFECTS["coulomb"] + EFFECTS["viscous"]


@pytest.fixture(scope="session")
def wide(arm):
    """The arm with every effect, compiled for tests/contract and tests/model as well."""
    return Model(arm.plant, tuple(applicable(EFFECTS, arm.plant).values()))


@pytest.fixture(scope="session")
def schedule_for(arm, manoeuvres):
    """Schedule of the arm for a manoeuvre and an accuracy, on the box of Table I."""

    @cache
    def schedule(manoeuvre, accuracy):
        found = calibrate(arm, manoeuvres[manoeuvre], probes(*box_of(arm)), accuracy)
        assert found.reached
        return found.schedule

    return schedule
