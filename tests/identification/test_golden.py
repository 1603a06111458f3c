"""A run that must not change by accident: the committed campaign, seed 1.

`python tests/identification/test_golden.py` writes the golden file anew, for a change that is meant.
"""

import json
from pathlib import Path

import pytest

from armid.estimation.identify import identify
from armid.identifiers import IDENTIFIERS
from armid.model import Model
from armid.problem.fitness import FITNESS
from armid.problem.space import space_of
from armid.record import Campaign, read_campaign

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "tests" / "golden" / "paper_arm.json"
BUDGET, SEED = 2000, 1


def numbers(campaign: Campaign, fitness: str) -> dict[str, float]:
    """Return what a run finds, SI."""
    model = Model(campaign.plant)
    told = (FITNESS[fitness], IDENTIFIERS["pso"], BUDGET, SEED)
    found = identify(campaign, model, space_of(model), *told, accuracy="fine")
    parameters = dict(zip(found.space.names, map(float, found.candidate), strict=True))
    return {**parameters, "value": found.value, "train_rmse": found.train.rmse}


@pytest.mark.parametrize("fitness", ["similarity", "rmse"])
def test_seed_1_finds_what_it_found(paper_arm, fitness):
    # other processors round differently, and swarms carry that on
    assert numbers(paper_arm, fitness) == pytest.approx(json.loads(GOLDEN.read_text())[fitness], rel=1e-6)


if __name__ == "__main__":
    read = read_campaign(ROOT / "studies" / "campaigns" / "paper_arm")
    GOLDEN.write_text(json.dumps({name: numbers(read, name) for name in ("similarity", "rmse")}, indent=2) + "\n")
