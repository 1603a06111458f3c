"""The suite: reproducible from name and version, exact optima, several objectives, and what is hard about it."""

import hashlib
import os

import numpy as np
import pytest
from pymoo.core.problem import Problem

import armid
from armid.errors import ArmidError
from armid.problem.suite import CLASSES_OF_FORMS, DEFINITIONS
from commands import python

# Problem of version 1 -> i and the value at the point u_j = frac(i sqrt(j + 2)).
STORED = {
    "arm/1": (1, 0.13404600046558043), "arm/15": (2, 0.2675166514234411), "arm_noisy/2": (3, 0.10788614908986356),
    "arm_similarity/3": (4, 0.14730023937865555), "arm_shape/6": (5, 0.1857142857142857),
    "arm_similarity_noisy/4": (6, 0.02294472544182413), "arm_short/5": (7, 0.3286182717919192),
    "arm_four/6": (8, 0.09678005082351138), "friction/7": (9, 0.06476747340794244),
    "friction_similarity/8": (10, 0.024362695031477144), "sticking/10": (12, 0.38000634195995114),
    "sticking_similarity/11": (13, 0.4634497329162959), "lags_similarity/13": (15, 0.04956412520446862),
    "rocking_friction/1": (17, 0.38986471225039465), "whole_similarity/6": (20, 0.3854988502694925),
}  # fmt: skip
OF_THE_ARM = [name for name in STORED if name.startswith("arm")]


def is_as_stored(name):
    problem, (i, value) = armid.suite()[name], STORED[name]
    return problem((i * np.sqrt(np.arange(2, 2 + problem.n_var))) % 1.0) == pytest.approx(value, rel=1e-7)


def test_values_at_stored_points():
    assert [name for name in OF_THE_ARM if not is_as_stored(name)] == []


@pytest.mark.nightly
@pytest.mark.parametrize("name", [name for name in STORED if name not in OF_THE_ARM])
def test_values_at_stored_points_of_other_machines(name):
    """Nearly each compiles a model of its own, which two processes may share out."""
    assert is_as_stored(name)


def test_every_problem_is_what_version_1_declares():
    """Names, boxes, records, fitness and drawn truths, to nine digits."""
    lines = []
    for problem in armid.suite(units="SI"):
        given, numbers = problem.definition, (*problem.xl, *problem.xu, *problem.truth)
        kept = (*sorted(given.free), given.fitness, given.strokes, given.duration_s, given.noise_deg_s)
        lines.append(repr((problem.name, *problem.names, *(f"{x:.9g}" for x in numbers), *kept)))
    assert hashlib.sha256("\n".join(lines).encode()).hexdigest()[:16] == "d012508c95671a16"


def test_the_suite_is_a_lazy_sequence_and_what_is_hard_is_measured():
    suite = armid.suite()
    assert len(suite) == 15 * len(DEFINITIONS) >= 360
    assert [p.name for p in suite[:16]][-2:] == ["arm/15", "arm_noisy/1"]
    assert len({p.name for p in suite}) == len(suite)
    sizes = {p.n_var for p in suite}
    assert (min(sizes), max(sizes)) == (4, 14)
    assert all(isinstance(p, Problem) and len(p.xl) == len(p.xu) == p.n_var == len(p.names) for p in suite[::15])
    for wrong in (lambda: suite["am/1"], lambda: armid.suite("two"), lambda: armid.suite(units="box ")):
        with pytest.raises(ArmidError, match=r"is not in the suite|known:|mean"):
            wrong()
    arm, shape = armid.suite()["arm/1"], armid.suite()["arm_shape/1"]
    assert arm.difficulty == "smooth"
    assert arm.landscape["minima"] == 1.0
    assert shape.difficulty == "stair"
    assert shape.landscape["stair"] > 0.9
    assert {measure for _, measure, _ in CLASSES_OF_FORMS} < set(arm.landscape)


def test_making_the_suite_compiles_nothing(tmp_path):
    """In a process of its own, whose compile cache stays empty until the first call."""
    program = ("import armid, os, sys; problems = list(armid.suite()); before = os.listdir(sys.argv[1]); "
               "assert before == [], before; print(problems[0].n_var)")  # fmt: skip
    done = python("-c", program, tmp_path, env=os.environ | {"ARMID_CACHE": str(tmp_path)})
    assert (done.stdout, done.returncode) == ("4\n", 0), done.stderr


def test_the_truth_is_the_optimum_without_noise_which_sets_the_floor():
    for name in ("arm/2", "arm_similarity/2", "arm_shape/2"):
        problem = armid.suite()[name]
        assert problem(problem.truth) == problem.optimum_value == problem.floor == 0.0
        assert (problem.optimum_x == problem.truth).all()
    noisy = armid.suite()["arm_noisy/2"]
    assert noisy.floor == pytest.approx(np.deg2rad(0.3), rel=0.1)
    assert 0.98 * noisy.floor < noisy.optimum_value < noisy.floor
    around = noisy.optimum_x + 1e-3 * np.vstack([np.eye(4), -np.eye(4)])
    assert (noisy(around) > noisy.optimum_value).all()
    similar = armid.suite()["arm_similarity_noisy/2"]
    assert similar.optimum_x is similar.optimum_value is None
    assert similar.floor > 0.0


def test_a_call_takes_a_vector_or_an_array_in_either_unit_and_gives_one_objective_a_record():
    box, own = armid.suite()["arm/3"], armid.suite(units="SI")["arm/3"]
    u = np.random.default_rng(1).random((5, 4))
    values = box(u)
    assert values.shape == (5,)
    assert isinstance(box(u[0]), float)
    assert box(list(u[0])) == values[0]
    assert (box.xl == 0.0).all()
    assert (box.xu == 1.0).all()
    np.testing.assert_allclose(own(box.si(u)), values, rtol=1e-12)
    np.testing.assert_allclose(own.truth, box.si(box.truth))
    assert own.names[0] == "p0"
    assert own.xl[0] == 2.6e6
    assert box.cost_s > 0.0
    several = armid.suite("records")
    assert len(several) < len(armid.suite())
    problem, joined = several["arm_four/1"], armid.suite()["arm_four/1"]
    u = np.random.default_rng(1).random((3, 4))
    assert problem.n_obj == 4
    assert problem(u).shape == (3, 4)
    assert problem(u[0]).shape == (4,)
    # records of the same length: the whole is the root of the mean square
    np.testing.assert_allclose(np.sqrt((problem(u) ** 2).mean(axis=1)), joined(u), rtol=1e-12)


def test_a_campaign_is_a_problem_on_top(paper_arm, paper_arm_folder):
    suite = armid.suite(campaigns=[paper_arm_folder])
    problem = suite[-1]
    assert (len(suite), problem.name, str(problem)) == (
        len(armid.suite()) + 1, "paper_arm/1", "<MeasuredProblem paper_arm/1, version 1: p0, k, eta3, n>")  # fmt: skip
    assert armid.suite(campaigns=paper_arm_folder)[-1].name == armid.suite(campaigns=str(paper_arm_folder))[-1].name
    assert problem.truth is problem.optimum_x is problem.optimum_value is None
    # the records are simulated with parameters that are known here
    near = problem((np.array([3.05e6, 1.0, 0.55, 1.4]) - [2.6e6, 0.6, 0.45, 0.9]) / [0.9e6, 0.5, 0.25, 0.6])
    assert near == pytest.approx(problem.floor, rel=0.03)
    assert problem.landscape["valley"] > 3.0
    assert problem.difficulty == "smooth"
    records = armid.suite("records", campaigns=[paper_arm])[-1]
    u = np.random.default_rng(1).random((2, 4))
    assert records(u).shape == (2, len(paper_arm.train))
    with pytest.raises(ArmidError, match="campaign 'paper_arm': the suite has a problem of that name already"):
        armid.suite(campaigns=[paper_arm, paper_arm_folder])
