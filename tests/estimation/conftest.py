"""Quick identifications, and the measured sets that may lie beside the repository."""

import os
from pathlib import Path

import pytest

from armid.estimation.identify import identify
from armid.identifiers import IDENTIFIERS
from armid.model import Model
from armid.problem.fitness import FITNESS
from armid.problem.space import space_of


@pytest.fixture(scope="session")
def found():
    """Return a function that identifies a campaign, with little if nothing else is said."""

    def run(campaign, model=None, space=None, fitness="similarity", **more):
        composed = model or Model(campaign.plant)
        told = {"budget": 160, **more}
        return identify(campaign, composed, space or space_of(composed), FITNESS[fitness], IDENTIFIERS["pso"], **told)

    return run


@pytest.fixture(scope="session")
def lowering_found(found, lowering):
    """The lowering, identified in 160 simulations and judged on the holdout."""
    return found(lowering)


@pytest.fixture(scope="session")
def measured(root):
    """Folder of the measured sets; they may not be passed on, so many machines do not have them."""
    folder = Path(os.environ.get("ARMID_MEASURED", root.parent / "shared" / "data"))
    if not (folder / "emps" / "DATA_EMPS.mat").is_file():
        pytest.skip("the measured set EMPS is not there: ARMID_MEASURED names the folder that holds emps/DATA_EMPS.mat")
    return folder
