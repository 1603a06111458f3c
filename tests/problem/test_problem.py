"""Identification as a problem of pymoo: its space, records ready to be simulated, residuals, and an exact budget."""

import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pymoo.algorithms.soo.nonconvex.cmaes import CMAES
from pymoo.algorithms.soo.nonconvex.de import DE
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.algorithms.soo.nonconvex.nelder import NelderMead
from pymoo.algorithms.soo.nonconvex.pso import PSO
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population
from pymoo.optimize import minimize

from armid.engine import Schedule, accuracy_against, simulate
from armid.errors import ArmidError
from armid.identifiers import PaperPSO
from armid.model import EFFECTS
from armid.problem.fitness import FITNESS
from armid.problem.meter import PENALTY, RESIDUALS, Meter, MeterTermination
from armid.problem.problem import IdentificationProblem, ReadyRecord, Replay, ready_record, replays, residuals
from armid.problem.similarity import similarity
from armid.problem.space import space_of
from armid.record import Override, read_campaign
from changed_records import with_noise

TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])
ALGORITHMS = {
    "paper": lambda: PaperPSO(n_particles=20, n_iterations=10),
    "ga": lambda: GA(pop_size=20), "de": lambda: DE(pop_size=20), "cmaes": CMAES, "nelder_mead": NelderMead,
    "pso": lambda: PSO(pop_size=20),
}  # fmt: skip


class Counted:
    """Stand in for a record that is simulated and count the candidates that really are."""

    def __init__(self, ready):
        self.ready, self.simulated = ready, 0

    def runs(self, candidates, shares=None):
        self.simulated += len(candidates)
        return self.ready.runs(candidates, shares)

    def __getattr__(self, name):
        return getattr(self.ready, name)


def test_says_what_its_columns_are_and_wants_a_free_parameter_and_a_record(arm_space, lowering_replays):
    some = IdentificationProblem(arm_space.with_fixed("k", 1.0), lowering_replays, FITNESS["rmse"])
    assert (some.names, some.units) == (("p0", "eta3", "n"), ("Pa", "1", "1"))
    assert (some.n_var, some.n_obj, some.n_constr) == (3, 1, 0)
    np.testing.assert_array_equal(some.xl, [2.6e6, 0.45, 0.9])
    np.testing.assert_array_equal(some.xu, [3.5e6, 0.70, 1.5])
    fixed = SimpleNamespace(free=np.array([False]))
    with pytest.raises(ArmidError, match="no parameter is free"):
        IdentificationProblem(fixed, lowering_replays, FITNESS["rmse"])
    with pytest.raises(ArmidError, match="no record is given"):
        IdentificationProblem(arm_space, (), FITNESS["rmse"])


@pytest.mark.parametrize("name", ALGORITHMS)
def test_never_more_simulations_than_the_budget(arm_space, lowering_replays, name):
    counted, meter = Counted(lowering_replays[0].ready), Meter(137)
    problem = IdentificationProblem(arm_space, (Replay(counted),), FITNESS["rmse"], meter)
    result = minimize(problem, ALGORITHMS[name](), MeterTermination(meter), seed=1)
    assert counted.simulated == meter.used == 137
    assert meter.best_f == problem.value(meter.best_x)[0] == meter.log().F.min() == result.F[0]
    np.testing.assert_array_equal(result.X, np.clip(meter.best_x, problem.xl, problem.xu))
    assert meter.best_f < 0.5 * problem.value(0.5 * (problem.xl + problem.xu))[0]


def test_a_simulation_that_really_diverges(write_axis, axis_model, tmp_path):
    campaign = read_campaign(write_axis(tmp_path))
    # so strong a negative friction doubles the speed every millisecond
    space = space_of(axis_model, bounds={"mass": (0.01, 5.0), "viscous.slope": (-10.0, 10.0)})
    problem = IdentificationProblem(space, replays(campaign.train, axis_model, space), FITNESS["rmse"], Meter(10))
    values = problem.evaluate(np.array([[0.01, -10.0], [2.0, 5.0]]))[:, 0]
    assert values[0] == PENALTY
    assert values[1] < 1e-3
    assert (problem.meter.used, problem.meter.n_failed, problem.meter.best_f) == (2, 1, values[1])
    assert np.isinf(problem.value(np.array([[0.01, -10.0]]))[0])


def by_hand(replay, x):
    """Return measured and simulated signal, residual, and the length of the window [s]."""
    simulated = replay.signal(x[np.newaxis])[0]
    times = replay.times
    return replay.measured, simulated, replay.measured - simulated, times[-1] - times[0]


def test_records_join_as_declared(paper_arm, arm, arm_space):
    # windows of 0.3, 0.6 and 1.2 s, so that weights matter
    records = [paper_arm.with_window(0.0, end).train[i] for i, end in ((0, 0.3), (3, 0.6), (4, 1.2))]
    several = replays(records, arm, arm_space)
    x = TRUTH * [1.02, 0.97, 0.98, 1.03]
    joined = {name: IdentificationProblem(arm_space, several, f).value(x)[0] for name, f in FITNESS.items()}
    each = [by_hand(r, x) for r in several]
    residuals = [residual for *_, residual, _ in each]
    seconds = np.array([length for *_, length in each])
    np.testing.assert_allclose(seconds, [0.3, 0.6, 1.2])
    degrees = np.array([[v[0] for v in similarity(m, s[np.newaxis], 1e-3)] for m, s, *_ in each])
    n = np.array([len(r) for r in residuals])
    relative = np.array([np.mean(r**2) / np.mean(m**2) for (m, *_), r in zip(each, residuals)])
    chi2 = sum(np.sum((r / record.noise.rms) ** 2) for record, r in zip(records, residuals))
    assert joined["similarity"] == pytest.approx(1 - degrees[:, 0] @ seconds / seconds.sum(), rel=1e-12)
    assert joined["numerical_similarity"] == pytest.approx(1 - degrees[:, 1] @ seconds / seconds.sum(), rel=1e-12)
    assert joined["shape_similarity"] == pytest.approx(1 - degrees[:, 2] @ seconds / seconds.sum(), rel=1e-12)
    assert joined["rmse"] == pytest.approx(np.sqrt(np.mean(np.concatenate(residuals) ** 2)), rel=1e-12)
    assert joined["nrmse"] == pytest.approx(np.sqrt(relative @ n / n.sum()), rel=1e-12)
    assert joined["likelihood"] == pytest.approx(chi2, rel=1e-12)


def test_a_deep_copy_shares_records_and_meter(arm_space, lowering_replays):
    problem = IdentificationProblem(arm_space, lowering_replays, FITNESS["rmse"], Meter(100))
    twin = copy.deepcopy(problem)
    assert twin.replays[0].record is problem.replays[0].record
    assert twin.measured[0] is problem.measured[0]
    assert twin.meter is problem.meter
    result = minimize(problem, GA(pop_size=10), MeterTermination(problem.meter), seed=1, save_history=True)
    assert result.history[0].problem.replays is problem.replays


def test_a_population_in_parts_gives_the_same_bits(arm_space, lowering_replays, monkeypatch):
    problem = IdentificationProblem(arm_space, lowering_replays, FITNESS["rmse"])
    X = np.random.default_rng(3).uniform(problem.xl, problem.xu, (37, 4))
    whole = problem.value(X)
    seen = []
    runs = ReadyRecord.runs

    def watched(ready, candidates, *shares):
        seen.append(len(candidates))
        return runs(ready, candidates, *shares)

    monkeypatch.setattr("armid.problem.problem.MOST_AT_ONCE", 1000)
    monkeypatch.setattr(ReadyRecord, "runs", watched)
    np.testing.assert_array_equal(problem.value(X), whole)
    assert seen == [16, 16, 5]


def test_what_the_caller_says_wins_over_the_campaign_and_frees_what_an_effect_fixes(arm):
    overrides = {"p0": Override(low=2.8e6), "k": Override(fixed=0.9), "n": Override(fixed=1.2, low=1.0, high=1.3),
                 "coulomb.level": Override(fixed=3.0)}  # fmt: skip
    space = space_of(arm, overrides, bounds={"k": (0.5, 0.7)}, fixed={"eta3": 0.6})
    assert space.free_names == ("p0", "k")
    np.testing.assert_array_equal(space.low[:2], [2.8e6, 0.5])
    np.testing.assert_array_equal(space.high[:2], [3.5e6, 0.7])
    np.testing.assert_array_equal(space.fixed, [np.nan, np.nan, 0.6, 1.2])
    model = arm + EFFECTS["coulomb"]
    assert space_of(model).free_names == ("p0", "k", "eta3", "n", "coulomb.level")
    freed = space_of(model, bounds={"coulomb.width": (0.001, 0.1)})
    assert freed.free_names == ("p0", "k", "eta3", "n", "coulomb.level", "coulomb.width")
    assert freed.units[-2:] == ("N m", "rad/s")


def test_bounds_and_fixed_values_by_name_leave_the_space_itself_alone_and_complete_a_candidate(arm_space):
    changed = arm_space.with_bounds("n", 1.0, 1.2).with_fixed("p0", 3e6)
    assert changed.free_names == ("k", "eta3", "n")
    assert changed.with_bounds("p0", 2e6, 3e6).free_names == arm_space.names
    assert arm_space.high[3] == 1.5
    assert arm_space.free.all()
    space = arm_space.with_fixed("k", 1.0)
    whole = space.complete(np.array([[3e6, 0.5, 1.4], [2.7e6, 0.6, 1.1]]))
    np.testing.assert_array_equal(whole, [[3e6, 1.0, 0.5, 1.4], [2.7e6, 1.0, 0.6, 1.1]])


def test_signal_is_the_simulation_in_the_window(paper_arm, arm, arm_space):
    record = paper_arm.with_window(0.2, 0.5).train[0]
    (replay,) = ready_record(record, arm, arm_space).each
    assert replay.measured.shape == replay.times.shape == (301,)
    np.testing.assert_allclose(replay.times[[0, -1]], [0.2, 0.5])
    np.testing.assert_array_equal(replay.measured, record.measured[200:501])
    whole = simulate(arm, record.manoeuvre, TRUTH[np.newaxis], Schedule(4)).output[0]
    np.testing.assert_allclose(replay.signal(TRUTH[np.newaxis])[0], whole[200:501], atol=1e-5)
    assert 0.0 < replay.engine_error_at(TRUTH) < 1e-5


def test_pieces_stand_end_to_end_and_the_same_manoeuvre_is_calibrated_once(write_axis, axis_model, tmp_path):
    campaign = read_campaign(write_axis(tmp_path, more="restart_s = 0.5\n"))
    (replay,) = ready_record(campaign.records[0], axis_model, space_of(axis_model)).each
    assert len(replay.pieces) == 4
    assert len({id(c) for c in replay.calibrations}) == 4
    candidates = np.array([[2.0, 5.0], [3.0, 1.0]])
    parts = [run.output for run in replay.ready.runs(candidates)]
    np.testing.assert_array_equal(replay.signal(candidates), np.hstack(parts))
    # a straight line through 20 ms is not quite the curved speed at a start
    np.testing.assert_allclose(replay.signal(candidates)[0], replay.measured, atol=3e-4)
    _, second, third, _ = campaign.records[0].pieces
    doubled = replace(campaign.records[0], pieces=(second, second, third))
    first, again, other = ready_record(doubled, axis_model, space_of(axis_model)).calibrations
    assert first is again
    assert other is not first


def test_noise_decides_the_accuracy_unless_one_is_given(paper_arm, arm, lowering, arm_space):
    record = lowering.train[0]
    quiet = with_noise(record, rms=1e-6)
    assert accuracy_against(record.noises, arm) == "standard"
    assert accuracy_against(quiet.noises, arm) == "fine"
    assert accuracy_against(with_noise(record, rms=0.0).noises, arm) == "fine"
    (fine,) = ready_record(lowering.train[0], arm, arm_space, "fine").each
    assert fine.engine_error_at(TRUTH) < 2e-7
    with pytest.raises(ArmidError, match="'finest' is unknown: standard or fine"):
        ready_record(lowering.train[0], arm, arm_space, "finest")


ASKED = ["F", "G", "H", RESIDUALS]


@pytest.fixture(scope="module")
def several(paper_arm, arm, arm_space):
    records = [paper_arm.with_window(0.0, end).train[i] for i, end in ((0, 0.3), (3, 0.5))]
    return replays(records, arm, arm_space)


@pytest.fixture(scope="module", name="X")
def candidates(arm_space):
    return np.random.default_rng(1).uniform(arm_space.low, arm_space.high, (5, 4))


def test_is_the_weighted_difference_end_to_end(several, arm_space, X):
    vectors = residuals(several, arm_space, X, [2.0, 0.5])
    assert vectors.shape == (5, 301 + 501)
    np.testing.assert_array_equal(vectors[:, :301], 2.0 * (several[0].signal(X) - several[0].measured))
    np.testing.assert_array_equal(vectors[:, 301:], 0.5 * (several[1].signal(X) - several[1].measured))
    np.testing.assert_array_equal(residuals(several, arm_space, X[0], [2.0, 0.5]), vectors[:1])
    fixed = arm_space.with_fixed("k", X[0, 1])
    np.testing.assert_array_equal(residuals(several, fixed, X[0, [0, 2, 3]], [2.0, 0.5]), vectors[:1])


@pytest.mark.parametrize("name", FITNESS)
def test_its_sum_of_squares_is_the_fitness(several, arm_space, X, name):
    fitness = FITNESS[name]
    problem = IdentificationProblem(arm_space, several, fitness)
    if fitness.weigh is None:
        with pytest.raises(ArmidError, match=f"'{name}' is not a sum of squares, least squares expects rmse or like"):
            problem.evaluated(X, True)
        return
    values, vectors = problem.evaluated(X, True)
    total = (vectors**2).sum(axis=1)
    expected = {"rmse": np.sqrt(total / vectors.shape[1]), "likelihood": total}[name]
    np.testing.assert_allclose(values, expected, rtol=1e-12)
    np.testing.assert_array_equal(values, problem.value(X))


def test_pymoo_s_evaluator_gets_it_when_it_asks(several, arm_space, X):
    meter = Meter(3)
    problem = IdentificationProblem(arm_space, several, FITNESS["rmse"], meter)
    pop = Evaluator(evaluate_values_of=ASKED).eval(problem, Population.new(X=X))
    vectors = pop.get(RESIDUALS)
    assert meter.used == 3
    np.testing.assert_array_equal(vectors[:3], residuals(several, arm_space, X[:3], [1.0, 1.0]))
    assert np.isnan(vectors[3:].astype(float)).all()
    plain = Evaluator().eval(IdentificationProblem(arm_space, several, FITNESS["rmse"]), Population.new(X=X))
    assert RESIDUALS not in plain[0].data
    np.testing.assert_array_equal(plain.get("F")[:3], pop.get("F")[:3])
