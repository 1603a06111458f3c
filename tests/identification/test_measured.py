"""A measured machine: EMPS, fitted on one record and judged on another."""

import json

import pytest

from armid.cli.main import main

# Other swarms may stop where Coulomb friction is at its bound 0 (3 of the first 15 seeds), and say so.
SEEDS = (1, 3)
PUBLISHED_MASS = 95.1


@pytest.fixture(scope="module")
def emps(measured, tmp_path_factory):
    """The two files as a campaign."""
    out = tmp_path_factory.mktemp("emps") / "campaign"
    with pytest.raises(SystemExit) as left:
        main(["import", "emps", str(measured / "emps"), "--out", str(out)])
    assert left.value.code == 0
    return out


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_emps(emps, tmp_path, seed):
    options = ["--effects", "coulomb,viscous,torque_offset", "--fitness", "rmse", "--seed", str(seed)]
    with pytest.raises(SystemExit) as left:
        main(["identify", str(emps), *options, "--out", str(tmp_path)])
    assert left.value.code == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["error"]["train"]["rmse"] <= 4.5e-3
    assert result["error"]["holdout"]["rmse"] <= 6.2e-3
    assert result["parameters"]["mass"]["value"] == pytest.approx(PUBLISHED_MASS, rel=0.03)
    assert not any(p["bound_active"] for p in result["parameters"].values())
