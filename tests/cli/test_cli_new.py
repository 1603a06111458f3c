"""`armid new`: starting files serve at once, under every name that is allowed (contracts: test_frozen_inputs.py)."""

import re
import tomllib

import pytest

from armid.cli.new import KINDS


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(("kind", "option"), [("fitness", "--fitness"), ("identifier", "--identifier"),
                                              ("effect", "--effects")])  # fmt: skip
def test_a_file_serves_at_once(run, kind, option):
    run("new", "campaign", "axis")
    run("new", kind, "mine")
    ran = run("identify", "axis", "--plugin", "mine.py:mine", option, "mine", "--budget", "160")
    assert (ran.code, ran.err) == (0, "")


def test_a_campaign_is_read_moves_and_says_that_it_is_synthetic(run, tmp_path):
    made = run("new", "campaign", "my_axis")
    assert (made.code, made.out) == (0, "wrote my_axis; try: armid check my_axis\n")
    checked = run("check", "my_axis")
    assert checked.code == 0
    assert re.search(r"^(\d+) of \1 points hold$", checked.out, re.MULTILINE)
    text = (tmp_path / "my_axis" / "campaign.toml").read_text()
    assert text.startswith("# SYNTHETIC: no machine was measured.")
    files = [r["file"] for r in tomllib.loads(text)["records"]]
    assert files == ["synthetic_train.csv", "synthetic_holdout.csv"]


def test_the_friction_that_the_campaign_s_text_names_is_in_its_records(run):
    run("new", "campaign", "my_axis")
    ran = run("identify", "my_axis", "--effects", "viscous", "--fitness", "rmse", "--identifier", "least_squares")
    found = {name: float(value) for name, value in re.findall(r"([\w.]+) +│ ([\d.]+) +│ ", ran.out)}
    assert found["inertia"] == pytest.approx(0.05, rel=0.01)
    assert found["viscous.slope"] == pytest.approx(0.03, rel=0.02)


def test_nothing_is_overwritten(run, refused, tmp_path):
    for kind in KINDS:
        assert run("new", kind, "mine", "--out", kind).code == 0
        before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
        assert "exists already" in refused("new", kind, "mine", "--out", kind)
        assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


def test_a_link_that_leads_nowhere_is_not_written_through(refused, tmp_path):
    (tmp_path / "mine.py").symlink_to(tmp_path / "elsewhere.py")
    assert "mine.py exists already" in refused("new", "effect", "mine")
    assert not (tmp_path / "elsewhere.py").exists()


def test_check_takes_a_campaign_and_tells_what_does_not_hold(run, refused, tmp_path):
    assert "campaign 'nowhere' does not exist" in refused("check", "nowhere")
    run("new", "campaign", "my_axis")
    toml = tmp_path / "my_axis" / "campaign.toml"
    text = toml.read_text()
    toml.write_text(text + "[parameters.inertia]\nfixed = 1e-25\n")
    ran = run("check", toml)
    assert ran.code == 1
    assert "FAIL moves in synthetic_train.csv: simulated diverges" in ran.out
    toml.write_text(text.replace('# effects = ["viscous"]', 'effects = ["gas_heat_loss"]'))
    ran = run("check", toml)
    assert ran.code == 1
    assert "FAIL model: effect 'gas_heat_loss'" in ran.out
