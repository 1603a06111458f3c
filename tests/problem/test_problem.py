"""Identification as a problem of pymoo: any algorithm, an exact budget, and the records joined as declared."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest
from pymoo.algorithms.soo.nonconvex.cmaes import CMAES
from pymoo.algorithms.soo.nonconvex.de import DE
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.algorithms.soo.nonconvex.nelder import NelderMead
from pymoo.algorithms.soo.nonconvex.pso import PSO
from pymoo.optimize import minimize

from armid.errors import ArmidError
from armid.identifiers import PaperPSO
from armid.problem.fitness import FITNESS, Fitness
from armid.problem.meter import PENALTY, Meter, MeterTermination
from armid.problem.problem import IdentificationProblem, ReadyRecord, Replay, replays
from armid.problem.similarity import similarity
from armid.problem.space import space_of
from armid.record import read_campaign

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


@pytest.fixture
def problem(arm_space, lowering_replays):
    return IdentificationProblem(arm_space, lowering_replays, FITNESS["rmse"])


def test_says_what_its_columns_are(arm_space, lowering_replays):
    some = IdentificationProblem(arm_space.with_fixed("k", 1.0), lowering_replays, FITNESS["rmse"])
    assert (some.names, some.units) == (("p0", "eta3", "n"), ("Pa", "1", "1"))
    assert (some.n_var, some.n_obj, some.n_constr) == (3, 1, 0)
    np.testing.assert_array_equal(some.xl, [2.6e6, 0.45, 0.9])
    np.testing.assert_array_equal(some.xu, [3.5e6, 0.70, 1.5])


@pytest.mark.parametrize("name", ALGORITHMS)
def test_never_more_simulations_than_the_budget(arm_space, lowering_replays, name):
    counted, meter = Counted(lowering_replays[0].ready), Meter(137)
    problem = IdentificationProblem(arm_space, (Replay(counted),), FITNESS["rmse"], meter)
    result = minimize(problem, ALGORITHMS[name](), MeterTermination(meter), seed=1)
    assert counted.simulated == meter.used == 137
    assert meter.best_f == problem.value(meter.best_x)[0] == meter.log().F.min() == result.F[0]
    np.testing.assert_array_equal(result.X, np.clip(meter.best_x, problem.xl, problem.xu))
    assert meter.best_f < 0.5 * problem.value(0.5 * (problem.xl + problem.xu))[0]


def test_a_diverging_candidate_is_penalised_and_counted(arm_space, lowering_replays):
    def no_small_k(measured, simulated):
        values = np.mean((simulated - measured) ** 2, axis=1)
        return np.where(np.arange(len(values)) % 2, np.inf, values)

    meter = Meter(10)
    problem = IdentificationProblem(arm_space, lowering_replays, Fitness("mine", no_small_k), meter)
    values = problem.evaluate(np.tile(TRUTH, (4, 1)))[:, 0]
    assert values[1] == values[3] == PENALTY
    assert values[0] == values[2] == meter.best_f < 1.0
    assert (meter.used, meter.n_failed) == (4, 2)
    assert np.isinf(problem.value(np.tile(TRUTH, (2, 1)))[1])


def test_a_simulation_that_really_diverges(write_axis, axis_model, tmp_path):
    campaign = read_campaign(write_axis(tmp_path))
    # so strong a negative friction doubles the speed every millisecond
    space = space_of(axis_model, bounds={"mass": (0.01, 5.0), "viscous.slope": (-10.0, 10.0)})
    problem = IdentificationProblem(space, replays(campaign.train, axis_model, space), FITNESS["rmse"], Meter(10))
    values = problem.evaluate(np.array([[0.01, -10.0], [2.0, 5.0]]))[:, 0]
    assert values[0] == PENALTY
    assert values[1] < 1e-3
    assert (problem.meter.used, problem.meter.n_failed) == (2, 1)


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


def test_a_population_in_parts_gives_the_same_bits(problem, monkeypatch):
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


def test_without_a_free_parameter_or_a_record_it_is_refused(arm_space, lowering_replays):
    fixed = SimpleNamespace(free=np.array([False]))
    with pytest.raises(ArmidError, match="no parameter is free"):
        IdentificationProblem(fixed, lowering_replays, FITNESS["rmse"])
    with pytest.raises(ArmidError, match="no record is given"):
        IdentificationProblem(arm_space, (), FITNESS["rmse"])
