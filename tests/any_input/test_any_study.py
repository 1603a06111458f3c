"""A study's TOML of any values, or any text: a study or one sentence, and nothing is run for it."""

import tempfile
import tomllib
from pathlib import Path

from hypothesis import example, given
from hypothesis import strategies as st
from reading_whatever import ARM_CSV, ARM_TOML, edited, edits, many, mutated, outcome, toml_of

from armid.study.tasks import Study, read_study

STUDY = """\
name = "small"
question = "Does it run?"
plant = "shell_transfer_arm"
budget = 40
seeds = 2
fitness = "rmse"
noise_deg_s = [0.0, 0.3]
windows_s = [[0.0, 0.05], "whole"]
bounds = { k = [0.5, 1.5] }
fixed = { n = 1.2 }

[[identifiers]]
name = "pso"
label = "wide"
fitness = ["rmse", "similarity"]
options = { velocity_limit = 0.2, n_particles = 10 }

[[identifiers]]
name = "pso+least_squares"
options = { share = 0.5, pso = { c1 = 1.0 } }

[[cases]]
name = "row 1"
truth = { p0 = 3.20e6, k = 1.00, eta3 = 0.62, n = 1.2 }
manoeuvres = [{ start_angle_deg = -48.0, target_angle_deg = 22.0, shell = true, supply_V = 28.0, duration_s = 0.3 }]

[[cases]]
name = "measured"
campaign = "c"
records = ["lower.csv"]

[random_cases]
n = 2
seed = 1
manoeuvres = [{ start_angle_deg = -48.0, target_angle_deg = 22.0, shell = true, supply_V = 28.0, duration_s = 0.3 }]
"""
TABLE = tomllib.loads(STUDY)


def study_of(content: bytes) -> bool:
    """Read a study of these bytes beside a campaign; tell whether it was one."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "c").mkdir()
        (folder / "c" / "campaign.toml").write_text(ARM_TOML.replace("window_s = [0.0, 0.7]\n", ""))
        (folder / "c" / "lower.csv").write_text(ARM_CSV)
        (folder / "study.toml").write_bytes(content)
        return outcome(lambda: checked(folder / "study.toml")) is not None


def checked(file: Path) -> Study:
    study = read_study(file)
    assert study.description()["name"] == study.name
    assert next(iter(study.plan())).run
    return study


def test_the_original_is_a_study():
    assert study_of(STUDY.encode())
    assert study_of(toml_of(TABLE))


@many(80)
@given(mutated(TABLE))
def test_any_value(table):
    study_of(toml_of(table))


@many(60)
@given(edits)
def test_edited_text(changes):
    study_of(edited(STUDY, changes))


@many(40)
@given(st.binary(max_size=200))
@example(b"\xef\xbb\xbf")
def test_any_bytes_for_a_study(content):
    study_of(content)
