"""A study that cannot be run is refused with one sentence before anything is written."""

import os
import shutil
from pathlib import Path

import pytest

from armid.errors import ArmidError
from armid.study.runner import run_study
from armid.study.tasks import read_study
from commands import refusing

BOX = "[bounds]\n"
# What is changed in the small study (old, new), and what the sentence has to hold.
REFUSED = [
    ('question = "Does it run?"', "qestion = 3", "small.toml: key 'qestion' is unknown, did you mean 'question'?"),
    ("truth = { p0 = 3", "truht = { p0 = 3", "small.toml, case 'row 1': key 'truht' is unknown, did you mean"),
    ('name = "pso+least_squares"', 'name = "pso+least_squares"\nbugdet = 3',
     "identifier 'pso+least_squares': key 'bugdet' is unknown, did you mean 'budget'?"),
    ("shell = true", "shel = true", "case 'row 1', manoeuvre 1: key 'shel' is unknown, did you mean 'shell'?"),
    ("budget = 40", "", "small.toml: key 'budget' is missing, a whole number of simulations above 0, or a rising list "
     "of such is expected"),
    ("budget = 40", "budget = true", "key 'budget' is true, a whole number"),
    ("seeds = 2", "seeds = 100000", "1,600,000 runs are asked for"),
    ("[[cases]]\nname = \"row 1", "[random_cases]\nn = 100001\nseed = 1\nmanoeuvres = [{}]\n[[cases]]\nname = \"row 1",
     "key 'n' is 100001, a whole number above 0, up to 100,000"),
    ("[0.0, 0.3]", "[-0.1]", "key 'noise_deg_s.0' is -0.1, a number of at least 0 in deg/s"),
    ("[bounds]\n", "[bounds]\nk = [1.1, 0.6]\n",
     "case 'row 1': bounds of 'k' are 1.1 and 0.6: finite numbers, low < high"),
    ("p0 = 3.20e6", "p0 = 3.2", "case 'row 1': the truth of 'p0' is 3.2, outside its bounds 2.6e+06 to 3.5e+06"),
    ("p0 = 3.20e6,", "", "case 'row 1': the truth does not tell 'p0'"),
    ("p0 = 3.20e6", "p0 = 3.20e6, q = 1", "parameter of the truth 'q' is unknown"),
    ('[[cases]]\nname = "row 5"', 'published = { eta4 = 1 }\n[[cases]]\nname = "row 5"',
     "parameter 'eta4' is unknown, did you mean 'eta3'?"),
    ('name = "pso+least_squares"', 'name = "pso+bobiqa"', "identifier 'bobiqa' is not known: did you mean 'bobyqa'?"),
    ('fitness = "rmse"', 'fitness = "rsme"', "identifier 'random': fitness 'rsme' is unknown, did you mean 'rmse'?"),
    ("seeds = 2", 'seeds = 2\nreport = "tabel1"', "report 'tabel1' is unknown, did you mean 'table1'?"),
    ('name = "pso+least_squares"', 'name = "pso"\nlabel = "mine"\nn_particles = 20',
     "identifier 'mine': key 'n_particles' is an option of pso, options = { n_particles = ... } is expected"),
    ("velocity_limit = 0.2", "velocity_limt = 0.2", "identifier 'pso': "),
    ('name = "pso+least_squares"', 'name = "pso+least_squares"\nfitness = "similarity"',
     "needs residual vectors, fitness 'similarity' has none: rmse or likelihood is expected"),
    ('name = "pso+least_squares"', 'name = "pso+least_squares"\nfitness = "likelihood"',
     "fitness 'likelihood' needs noise, but noise_deg_s holds 0"),
    ("[[0.0, 0.3]]", "[[0.29, 0.7]]", "manoeuvre 1, windows_s: the window holds 11 samples of manoeuvre 1"),
    ("start_angle_deg = -48.0", "start_angle_deg = -60.0", "case 'row 1', manoeuvre 1: start_angle_deg is -60"),
    ('"row 5"', '"row 1"', "case 'row 1' is there twice"),
    ('fitness = "rmse"', 'fitness = ["rmse", "rmse"]', "the same run is asked for twice (fitness rmse, window"),
    ('"row 5"', '"row/5"', "the name of case 'row/5' holds '/'"),
    ('name = "pso+least_squares"', 'name = "random"',
     "identifier 'random': the same run is asked for twice (fitness rmse, window 0-0.3 s), each once is expected"),
    ('name = "pso+least_squares"', 'name = "pso+least_squares"\nlabel = "random"',
     "two identifiers are called 'random'"),
    ('name = "small"', 'name = "../small"', "key 'name' is '../small', a plain name"),
    ('name = "small"', "name = ", "small.toml is not valid TOML"),
    ('[[cases]]\nname = "row 5"', 'campaign = "c"\n[[cases]]\nname = "row 5"',
     "manoeuvres to simulate or a campaign to read is expected, both are given"),
    ("duration_s = 0.3 }]", 'duration_s = 0.3, role = "holdout" }]', "no manoeuvre has the role 'train'"),
    ("[bounds]\n", "[fixed]\np0 = 3.2e6\nk = 1\neta3 = 0.62\nn = 1\n", "case 'row 1': every parameter is fixed"),
    ('plant = "shell_transfer_arm"', 'plant = "driven_axis"',
     "noise_deg_s is given, but the records are in m/s, noise_mm_s is expected"),
    ("manoeuvres = [{ start", 'campaign = "../c" #', "campaign '../c' leads out of the folder of the study"),
    ("manoeuvres = [{ start", 'campaign = "a\\u0000b" #', "leads out of the folder of the study"),
    ("manoeuvres = [{ start", 'campaign = "c" #', "does not exist, a folder with a campaign.toml is expected"),
]  # fmt: skip


def test_refused_with_one_sentence(write_study, tmp_path):
    for old, new, words in REFUSED:
        with refusing(words, ".toml"):
            run_study(write_study(change=(old, new), more=BOX), out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_bounds_in_another_unit_are_told(write_study):
    warned = pytest.warns(UserWarning, match="bounds p0 = 2.6 to 3.5 is far outside the declared range")
    with warned, pytest.raises(ArmidError, match=r"outside its bounds 2.6 to 3.5"):
        read_study(write_study(more="[bounds]\np0 = [2.6, 3.5]\n"))


@pytest.mark.parametrize(("told", "words"), [
    ({"jobs": 0}, "jobs is 0, a whole number of processes above 0"),
    ({"time_limit": 0.0}, "the time limit is 0"),
    ({"jobs": 1, "dask": "tcp://x:1"}, "both jobs and a Dask cluster are given"),
    ({"only": "row 7"}, "no case is called 'row 7', did you mean 'row"),
    ({"only": "row 1/pos"}, "no identifier is called 'pos', did you mean 'pso'?"),
])  # fmt: skip
def test_arguments_that_no_runner_can_work_with(write_study, tmp_path, told, words):
    with refusing(words):
        run_study(write_study(), out=tmp_path / "out", **told)
    assert not (tmp_path / "out").exists()


def test_a_campaign_that_is_a_variant_or_a_link_out_of_the_folder_is_refused(write_study, tmp_path, paper_arm_folder):
    """Its folder would be read in its place, with other settings."""
    (tmp_path / "c").mkdir()
    shutil.copy(paper_arm_folder / "campaign.toml", tmp_path / "c" / "variant.toml")
    file = write_study(change=("manoeuvres = [{ start", 'campaign = "c/variant.toml" #'))
    with pytest.raises(ArmidError, match="is a file: a folder that holds campaign"):
        read_study(file)
    (tmp_path / "linked").symlink_to(paper_arm_folder)
    file = write_study(change=("manoeuvres = [{ start", 'campaign = "linked" #'))
    with pytest.raises(ArmidError, match="campaign 'linked' leads out of the folder of the study"):
        read_study(file)


def test_a_path_that_is_no_utf_8_and_a_folder_that_cannot_be_written_are_refused(
    refused, write_study, tmp_path, monkeypatch
):
    """A store keeps the path as the command named it; of a whole one it keeps the name alone."""
    monkeypatch.chdir(tmp_path)
    folder = Path(os.fsdecode(b"m\xe9s"))
    folder.mkdir()
    shutil.move(write_study(more=BOX), folder)
    sentence = refused("study", folder / "small.toml", "--out", "out", "--quiet")
    assert sentence.startswith(r"armid: 'm\udce9s/small.toml' is not a name in UTF-8")
    assert not Path("out").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(ArmidError, match="cannot be used: Not a directory, a folder that can be written is expected"):
        run_study(write_study(more=BOX), out=tmp_path / "file" / "out")
