"""Files and options that cannot be used: one sentence, exit code 2, nothing written, whichever command reads them."""

import json
import os

import pytest

OUT = {"close-loop": ["--out", "out"], "simulate": ["--out", "out"]}
COMMANDS = ("identify", "close-loop", "identifiability", "simulate", "check")
CAMPAIGNS = {
    "nowhere": "does not exist", "empty": "key 'name' is missing", "binary": "line 2: not readable as text",
    "folder": "holds no campaign.toml", "loop": "does not exist", "": "holds no campaign.toml", "/dev/null": "holds no",
    "folder/no.toml": "does not exist",
}  # fmt: skip


@pytest.fixture(autouse=True)
def things(tmp_path, monkeypatch):
    """A working folder with files that are none of ours; nothing may be added to it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").write_text("")
    (tmp_path / "binary").write_bytes(bytes(range(256)) * 4)
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "text.json").write_text('{"parameters": {"p0": {"value": "high"}}}')
    (tmp_path / "deep.json").write_text("[" * 100_000)
    (tmp_path / "nan.json").write_text(json.dumps({"parameters": {n: {"value": float("nan")} for n in (
        "p0", "k", "eta3", "n")}}))  # fmt: skip
    (tmp_path / "long.json").write_text('{"parameters": {"p0": {"value": 1' + "0" * 5000 + "}}}")
    before = sorted(os.listdir(tmp_path))
    yield
    assert sorted(os.listdir(tmp_path)) == before


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(("campaign", "says"), CAMPAIGNS.items())
def test_what_is_no_campaign(refused, command, campaign, says):
    if (command, campaign) == ("check", ""):
        says = "does not exist"
    elif (command, campaign) == ("check", "/dev/null"):
        says = "/dev/null"
    assert says in refused(command, campaign, *OUT.get(command, []))


@pytest.mark.parametrize(("arguments", "says"), [
    (["report", "nowhere"], "nowhere"),
    (["report", "empty"], "empty"),
    (["report", "folder"], "folder"),
    (["export", "ioh", "empty", "out"], "empty is no store of a study"),
    (["export", "ioh", "binary", "out"], "binary is no store of a study"),
    (["export", "ioh", "folder", "out"], "there is no store"),
    (["study", "folder"], "study folder does not exist"),
    (["study", "empty"], "key 'name' is missing"),
    (["study", "binary"], "line 2: not readable as text"),
    (["import", "emps", "folder", "--out", "out"], "DATA_EMPS.mat"),
    (["import", "dfki", "folder", "--out", "out"], "ddp_measured.csv does not exist there"),
    (["import", "dfki", "binary", "--out", "out"], "ddp_measured.csv does not exist there"),
    (["import", "dfki", "folder", "--out", "out", "--holdout", "dpd"], "did you mean 'ddp'"),
    (["list", "effect"], "did you mean 'effects'"),
    (["check", "binary:x"], "binary is no Python file"),
    (["check", "folder:x"], "there is no file folder"),
])  # fmt: skip
def test_what_is_no_result_and_no_source(refused, arguments, says):
    assert says in refused(*arguments)


@pytest.mark.parametrize(("options", "says"), [
    (["--from", "nowhere"], "nowhere"),
    (["--from", "folder"], "folder"),
    (["--from", "empty"], "--from empty holds no parameters"),
    (["--from", "binary"], "--from binary holds no parameters"),
    (["--from", "text.json"], "--from text.json holds no parameters"),
    (["--from", "deep.json"], "--from deep.json holds no parameters"),
    (["--from", "long.json"], "--from long.json holds no parameters"),
    (["--from", "nan.json"], "p0"),
    (["--at", "p0=nan,k=1,eta3=0.6,n=1.1"], "p0"),
    (["--at", "p0=1,p0=2"], "'p0' is given twice"),
    (["--at", "p0"], "NAME=VALUE"),
    (["--at", "p0=3e6"], "is free and has no value"),
    (["--noise", "nan"], "--noise is nan"),
    (["--noise", "0"], "--noise is 0"),
    (["--rank", "volum"], "did you mean 'volume'"),
    (["--window", "0:nan"], "an end after its beginning"),
    (["--effects", "viscous,viscous"], "in the model already"),
    (["--out", "empty"], "is a file: a folder is expected"),
])  # fmt: skip
def test_bad_options_of_identifiability(refused, paper_arm_folder, options, says):
    assert says in refused("identifiability", paper_arm_folder, *options)


@pytest.mark.parametrize(("options", "says"), [
    (["--candidates", "viscos"], "--candidates: effect 'viscos' is not known: did you mean 'viscous'"),
    (["--without", "viscos"], "--without: effect 'viscos' is not known"),
    (["--window", "0:nan"], "an end after its beginning"),
    (["--window", "0:0.001"], "holds 2 samples"),
    (["--bounds", "p0=nan:1"], "'p0'"),
    (["--fix", "p0=inf"], "'p0'"),
    (["--effects", "coulomb,coulomb"], "in the model already"),
    (["--threads", "0"], "--threads"),
    (["--seed", "-1"], "--seed"),
    (["--out", "empty"], "is a file: a folder is expected"),
    (["--plugin", "empty:x"], "empty is no Python file"),
])  # fmt: skip
def test_bad_options_of_close_loop(refused, paper_arm_folder, options, says):
    out = [] if "--out" in options else ["--out", "out"]
    assert says in refused("close-loop", paper_arm_folder, *out, *options)


@pytest.mark.parametrize(("options", "says"), [
    (["--option", "seed=2"], "has no option 'seed' that could be set here"),
    (["--option", "termination=3"], "has no option 'termination' that could be set here"),
    (["--option", "self=1"], "has no option 'self' that could be set here"),
    (["--option", "n_particles=1000000000000"], "n_particles is 1e+12, expected a whole number of at most 1,000,000"),
    (["--identifier", "de", "--option", "variant=DE/x/1/bin"], "variant is 'DE/x/1/bin', expected DE/rand"),
    (["--identifier", "pymoo_pso", "--option", "adaptive=no"], "adaptive is 'no', expected true or false"),
    (["--identifier", "bobyqa", "--option", "initial_step=1"], "expected a number above 0 and at most 0.5"),
    (["--identifier", "pso+bobyqa", "--option", "pso.seed=3"], "has no option 'pso.seed' that could be set here"),
    (["--identifier", "pso+"], "identifier '' is not known"),
    (["--identifier", "multistart:pso"], "expects a local one"),
    (["--budget", "9" * 30], "the budget is 1e+30, expected at most"),
])  # fmt: skip
def test_bad_options_of_identifiers(refused, paper_arm_folder, options, says):
    assert says in refused("identify", paper_arm_folder, "--budget", "16", *options)


def test_truth_values_are_options(run, paper_arm_folder):
    told = ["--identifier", "pymoo_pso", "--option", "adaptive=false", "--budget", "80", "--window", "0:0.3"]
    assert run("identify", paper_arm_folder, *told).code == 0


def test_memory_that_is_not_there_is_told(refused, monkeypatch):
    def greedy(*_, **__):
        raise MemoryError("Unable to allocate 3 PiB")

    monkeypatch.setattr("armid.cli.listing.load_registry", greedy)
    assert "not enough memory: Unable to allocate 3 PiB" in refused("list", "effects")
