"""`armid identify`: every bad option gives one sentence."""

import pytest


@pytest.mark.parametrize(("options", "fragments"), [
    (["--effects", "viscos"], ["effect 'viscos'", "did you mean 'viscous'"]),
    (["--fitness", "similarty"], ["fitness 'similarty'", "did you mean 'similarity'"]),
    (["--identifier", "psoo"], ["identifier 'psoo'", "did you mean 'pso'"]),
    (["--identifier", "pso+bobqya"], ["identifier 'bobqya'", "did you mean 'bobyqa'"]),
    (["--identifier", "least_squares"], ["'least_squares' needs residual vectors", "rmse or likelihood is expected"]),
    (["--identifier", "pso+bobyqa", "--option", "pso.velocity_limt=0.2"], ["did you mean 'velocity_limit'"]),
    (["--identifier", "pso+bobyqa", "--option", "share=0.5:0.5"], ["share is '0.5:0.5', expected 1 shares"]),
    (["--bounds", "p0=3:2"], ["'p0'", "3 and 2", "low < high"]),
    (["--bounds", "p0=nan:2"], ["'p0'", "finite"]),
    (["--bounds", "p0"], ["--bounds 'p0'", "NAME=LOW:HIGH"]),
    (["--bounds", "p0=3"], ["--bounds p0 '3'", "LOW:HIGH"]),
    (["--bounds", "p0=a:b"], ["--bounds p0", "'a' is no number"]),
    (["--bounds", "eta=0.5:0.6"], ["'eta'", "did you mean 'eta3'"]),
    (["--bounds", "n=1:1.2", "--bounds", "n=1:1.3"], ["'n' is given twice"]),
    (["--bounds", "k=0.5:1", "--fix", "k=1"], ["'k'", "both bounds and a fixed value"]),
    (["--fix", "q=1"], ["'q'", "known: p0, k, eta3, n"]),
    (["--fix", "k"], ["--fix 'k'", "NAME=VALUE"]),
    (["--fix", "k=inf"], ["'k'", "finite"]),
    (["--fix", "k="], ["--fix 'k='", "NAME=VALUE"]),
    (["--window", "0.7:0"], ["0.7", "an end after its beginning"]),
    (["--window", "0.7"], ["--window '0.7'", "LOW:HIGH"]),
    (["--window", "0:nan"], ["an end after its beginning"]),
    (["--window", "5:6"], ["holds 0 samples of lower.csv", "at least 20"]),
    (["--budget", "0"], ["budget", "0", "above 0"]),
    (["--budget", "1e4"], ["--budget", "'1e4'"]),
    (["--seed", "-1"], ["seed", "-1"]),
    (["--target", "nan"], ["target is NaN"]),
    (["--target", "high"], ["--target", "'high'"]),
    (["--accuracy", "fin"], ["--accuracy 'fin'", "did you mean 'fine'"]),
    (["--buget", "10"], ["--buget", "--budget"]),
    (["another"], ["unexpected extra argument", "another"]),
])  # fmt: skip
def test_bad_options(refused, paper_arm_folder, options, fragments):
    sentence = refused("identify", paper_arm_folder, "--budget", "80", *options)
    for fragment in fragments:
        assert fragment in sentence


@pytest.mark.parametrize(("attribute", "option", "fragments"), [
    ("unknown_name", "--effects", ["effect 'unknown_name'", "omga", "did you mean 'omega'"]),
    ("unknown_port", "--effects", ["effect 'unknown_port'", "'torqe'", "did you mean 'torque'"]),
    ("misspelt", "--fitness", ["fitness 'misspelt'", "'nois'", "did you mean 'noise'"]),
    ("one_number", "--fitness", ["fitness 'one_number'", "shape ()", "(80,)"]),
    ("raising", "--fitness", ["mine.py, line ", "ZeroDivisionError: nothing to divide by"]),
    ("no_algorithm", "--identifier", ["identifier 'no_algorithm'", "int", "Algorithm of pymoo"]),
])  # fmt: skip
def test_bad_things_of_a_user(refused, paper_arm_folder, mine, attribute, option, fragments):
    things = ("--plugin", f"{mine}:{attribute}", option, attribute)
    sentence = refused("identify", paper_arm_folder, "--budget", "80", *things)
    for fragment in fragments:
        assert fragment in sentence


def test_a_bad_place_is_refused_before_the_search(refused, paper_arm_folder, tmp_path, monkeypatch):
    def never(*_, **__):
        raise AssertionError("the search was started")

    monkeypatch.setattr("armid.estimation.identify", never)
    (tmp_path / "file").write_text("")
    assert "is a file: a folder is expected" in refused("identify", paper_arm_folder, "--out", tmp_path / "file")
    assert "Not a directory" in refused("identify", paper_arm_folder, "--out", tmp_path / "file" / "out")


@pytest.mark.parametrize("campaign", ["nowhere", "nowhere/campaign.toml"])
def test_a_missing_campaign(refused, campaign):
    assert f"campaign '{campaign}' does not exist" in refused("identify", campaign)
