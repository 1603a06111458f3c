"""Whatever files and options hold, reading ends in a campaign, a study, values or an ArmidError, never otherwise."""

import shutil
import tempfile
import tomllib
import warnings
from pathlib import Path

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from pymoo.optimize import minimize
from reading_whatever import (
    ARM_CSV,
    ARM_TOML,
    AXIS_CSV,
    AXIS_TOML,
    edited,
    edits,
    many,
    mutated,
    outcome,
    read_whatever,
)

from armid.cli.options import assignments, interval, intervals, numbers, value_of
from armid.contract.check import Trial
from armid.identifiers import IDENTIFIERS, identifier_of
from armid.model import PLANTS, Model
from armid.problem.meter import Meter, MeterTermination
from armid.problem.space import space_of
from armid.study.tasks import read_study
from input_texts import toml_of

ARM, AXIS = tomllib.loads(ARM_TOML), tomllib.loads(AXIS_TOML)


def test_the_originals_read_also_as_they_are_written_here():
    assert tomllib.loads(toml_of(ARM).decode()) == ARM
    for toml, csv in ((ARM_TOML.encode(), ARM_CSV), (toml_of(ARM), ARM_CSV), (toml_of(AXIS), AXIS_CSV)):
        assert read_whatever(toml, csv.encode()) is not None


@many(240)
@given(st.one_of(st.tuples(mutated(ARM), st.just(ARM_CSV)), st.tuples(mutated(AXIS), st.just(AXIS_CSV))))
def test_any_value_for_the_arm_and_for_an_axis(case):
    table, csv = case
    read_whatever(toml_of(table), csv.encode())


@many(480)
@given(st.sampled_from([(ARM_TOML, ARM_CSV), (AXIS_TOML, AXIS_CSV)]), edits, edits)
def test_edited_text_of_the_arm_and_of_an_axis(texts, toml, csv):
    read_whatever(edited(texts[0], toml), edited(texts[1], csv))


@many(120)
@given(st.lists(st.integers(1, 10**12), min_size=19, max_size=60), st.sampled_from([1e-12, 1e-3, 1e17]),
       st.sampled_from([1e30, 1.0, 1e-20, 5e-324]))  # fmt: skip
def test_any_increasing_times(steps, unit, size):
    times = np.unique(np.cumsum(np.array(steps, dtype=float)) * unit)
    times -= times[len(times) // 4]
    rows = [f"{t!r},{size * np.cos(i)!r},{size!r},0\n" for i, t in enumerate(times.tolist())]
    header = "time_s,angular_velocity_rad_s,drive_V,angle_deg\n"
    read_whatever(AXIS_TOML.replace("restart_s = 0.03", "").encode(), (header + "".join(rows)).encode())
    arm = ARM_TOML.replace("window_s = [0.0, 0.7]", "").replace("gyro_range_deg_s = 200", "")
    read_whatever(arm.encode(), ("time_s,angular_velocity_deg_s,a,b\n" + "".join(rows)).encode())


@many(120)
@given(st.binary(max_size=300), st.binary(max_size=300))
@example(b"", b"#")
@example(b"", b"\xff\xfe")
@example(b"", b"\xff\xfea")
def test_any_bytes(toml, csv):
    read_whatever(toml, ARM_CSV.encode())
    read_whatever(ARM_TOML.encode(), csv)
    read_whatever(ARM_TOML.encode(), b"time_s,angular_velocity_deg_s\n" + csv)


BUDGET = 30
OPTIONS = (
    "n_particles", "n_iterations", "c1", "first_inertia", "velocity_limit", "pop_size", "n_offsprings", "CR", "F", "w",
    "variant", "adaptive", "initial_velocity", "eliminate_duplicates", "initial_step", "tolerance", "differences",
    "step", "n_candidates", "growth", "share", "seed", "budget", "self", "termination", "pso.c1", "bobyqa.tolerance", ""
)  # fmt: skip
OWN = [n for n, i in IDENTIFIERS.items() if not i.package]
NAMES = (*OWN, "pso+bobyqa", "de+least_squares", "multistart:nelder_mead", "random+slsqp")
TEXTS = st.one_of(
    st.sampled_from(["nan", "inf", "-inf", "1e400", "-1", "0", "1", "2", "0.5", "1e-300", "true", "rand", "literal",
                     "forward", "9" * 5000, "0.5:0.3", "1_000", "DE/rand/2/bin", "\u0661", "0x10"]),
    st.text(max_size=6), st.floats().map(repr), st.integers(-5, 60).map(str),
)  # fmt: skip
PARTS = st.one_of(st.sampled_from(["p0", "k", "eta3", "n", "q", "", "=", ":"]), TEXTS)
DECLARED_ARM = Model(PLANTS["shell_transfer_arm"])


@many(160)
@given(st.sampled_from(NAMES), st.lists(st.tuples(st.one_of(st.sampled_from(OPTIONS), st.text(max_size=5)), TEXTS),
                                        min_size=1, max_size=2))  # fmt: skip
@example("pso", [("seed", "2")])
@example("pso", [("self", "1")])
@example("pso", [("budget", "3")])
@example("pso", [("display", "1")])
@example("pso", [("n_particles", "1000000000000")])
@example("bobyqa", [("initial_step", "1")])
@example("de", [("variant", "a/b")])
@example("pso", [("", "\n")])
def test_any_option(name, options):
    def built():
        given = assignments([f"{option}={text}" for option, text in options], "--option")
        told = {option: value_of(text) for option, text in given.items()}
        return identifier_of(name, IDENTIFIERS).with_options(told).build(BUDGET)

    algorithm = outcome(built)
    if algorithm is None:
        return
    meter = Meter(BUDGET)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        minimize(Trial(meter), algorithm, MeterTermination(meter), seed=1, copy_algorithm=False)
    assert 0 < meter.used <= BUDGET


@many(100)
@given(st.text(alphabet="pso+bqya:multirde_ ", max_size=16))
def test_any_name_of_an_identifier(name):
    outcome(lambda: identifier_of(name, IDENTIFIERS).build(BUDGET))


@many(100)
@given(st.lists(st.tuples(PARTS, PARTS, PARTS), max_size=2), st.lists(st.tuples(PARTS, PARTS), max_size=2))
def test_any_bounds_and_fixed_values(bounds, fixed):
    def space():
        wide = intervals([f"{name}={low}:{high}" for name, low, high in bounds], "--bounds")
        return space_of(DECLARED_ARM, {}, wide, numbers([f"{name}={value}" for name, value in fixed], "--fix"))

    found = outcome(space)
    if found is not None:
        assert np.isfinite([found.low, found.high]).all()
        assert (found.low < found.high).all()


@many(100)
@given(st.one_of(st.text(max_size=10), st.tuples(TEXTS, TEXTS).map(":".join)))
def test_any_window(text):
    outcome(lambda: interval(text, "--window"))


FROZEN = Path(__file__).parents[1] / "frozen"
STUDY = (FROZEN / "study.toml").read_text(encoding="utf-8")
TABLE = tomllib.loads(STUDY)


def study_of(content):
    """Read a study of these bytes beside campaigns; tell whether it was one."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(FROZEN / "campaigns", folder / "campaigns")
        (folder / "study.toml").write_bytes(content)
        return outcome(lambda: checked(folder / "study.toml")) is not None


def checked(file):
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


@many(40)
@given(st.binary(max_size=200))
@example(b"\xef\xbb\xbf")
def test_any_bytes_for_a_study(content):
    study_of(content)
