"""What `simulate` takes, refuses and returns; no candidate depends on who is simulated beside it or on threads."""

import tracemalloc
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from arm_cases import drawn
from armid.contract.trials import PlainModel
from armid.engine import Schedule, along, simulate
from armid.engine.generate import FEWEST_IDLE, strengths_of
from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Manoeuvre, Model
from armid.problem.fitness import mean_square

KILOBYTE = 1024
AXIS = Model(PLANTS["driven_axis"])
TRUTH = np.array([3.05e6, 1.0, 0.55, 1.4])


def test_shapes_and_that_a_switch_that_is_never_reached_has_no_time(arm):
    found = simulate(arm, Manoeuvre(0.001, 60), drawn(arm, 11, 1), states=True)
    assert found.output.shape == (11, 60)
    assert found.failed.shape == found.switch_times["closed"].shape == (11,)
    assert {s.shape for s in found.states.values()} == {(11, 60)}
    assert np.array_equal(found.output, found.states["omega"])
    assert simulate(arm, Manoeuvre(0.001, 60), drawn(arm, 1, 1)).states == {}
    none = simulate(arm, Manoeuvre(0.001, 60), np.empty((0, 4)))
    assert (none.output.shape, none.failed.shape) == ((0, 60), (0,))
    candidate = drawn(arm, 1, 2)
    one, row = (simulate(arm, Manoeuvre(0.001, 60), c).output for c in (candidate[0], candidate))
    assert np.array_equal(one, row)
    assert np.array_equal(simulate(arm, Manoeuvre(0.001, 1), drawn(arm, 3, 1)).output, np.zeros((3, 1)))
    # A supply too weak to lift: no switch, and no time of one.
    weak = Manoeuvre(0.001, 200, {"U": 1.0, "theta_C": 0.3, "theta_D": -0.8})
    assert np.isnan(simulate(arm, weak, drawn(arm, 3, 1)).switch_times["closed"]).all()


@pytest.mark.parametrize("plan", [None, np.full(899, 4)], ids=["no plan", "a plan of another length"])
def test_more_samples_do_not_change_the_first(arm, plan):
    population = drawn(arm, 5, 3)
    short, long = (simulate(arm, Manoeuvre(0.001, n), population, Schedule(plan=plan)).output for n in (301, 900))
    assert np.array_equal(short, long[:, :301])


def test_refused(arm):
    with pytest.raises(ArmidError, match=r"shape \(2, 3\) was given: \(n_candidates, 4\) is expected for p0, k, eta3"):
        simulate(arm, Manoeuvre(0.001, 60), np.ones((2, 3)))
    with pytest.raises(ArmidError, match="constant 'theta_E' is not one of plant 'shell_transfer_arm': did you mean"):
        simulate(arm, Manoeuvre(0.001, 60, {"theta_E": 0.1}), drawn(arm, 1, 1))
    with pytest.raises(ArmidError, match="the manoeuvre lacks the input 'u' of plant 'driven_axis'"):
        simulate(AXIS, Manoeuvre(0.001, 60), [[1.0]])
    with pytest.raises(ArmidError, match=r"input 'u' has shape \(59,\): \(60,\) is expected"):
        simulate(AXIS, Manoeuvre(0.001, 60, inputs={"u": np.ones(59)}), [[1.0]])
    with pytest.raises(ArmidError, match=r"'curent' is not a name of plant 'shell_transfer_arm'.*current"):
        along(arm, Manoeuvre(0.001, 50), TRUTH, Schedule(), ["curent"])


@pytest.fixture(scope="module")
def schedule(schedule_for):
    return schedule_for("lower", "standard")


def same(found, rows, expected):
    """Compare outputs, failures and switch times bit for bit."""
    pairs = [(found.output, expected.output), (found.failed, expected.failed)]
    pairs += [(found.switch_times[k], v) for k, v in expected.switch_times.items()]
    return all(np.array_equal(a[rows], b, equal_nan=True) for a, b in pairs)


def test_neighbours_threads_and_weights_change_no_bit(arm, manoeuvres, schedule):
    population = drawn(arm, 50, 21)
    whole = simulate(arm, manoeuvres["lower"], population, schedule)
    for i in (0, 7, 8, 49):
        assert same(whole, slice(i, i + 1), simulate(arm, manoeuvres["lower"], population[i], schedule))
    order = np.random.default_rng(22).permutation(50)
    assert same(whole, order, simulate(arm, manoeuvres["lower"], population[order], schedule))
    for threads in (2, 3, 8, 64):
        found = simulate(arm, manoeuvres["lower"], population, schedule, threads=threads)
        assert same(whole, slice(None), found)
    for weights in (None, -schedule.weights, np.ones(4)):
        other = simulate(arm, manoeuvres["lower"], population, replace(schedule, weights=weights))
        assert same(whole, slice(None), other)


@pytest.mark.slow
def test_a_diverged_candidate_is_nan_from_then_on_and_harms_no_other(manoeuvres, arm):
    pushed_arm = arm + EFFECTS["viscous"]
    calm = np.column_stack([drawn(pushed_arm, 20, 25)[:, :4], np.zeros(20)])
    wild = np.column_stack([drawn(pushed_arm, 30, 26)[:, :4], -np.geomspace(1e3, 1e7, 30)])
    order = np.random.default_rng(1).permutation(50)
    for schedule in (Schedule(), Schedule(plan=np.full(1200, 8)), Schedule(3)):
        mixed = simulate(pushed_arm, manoeuvres["lower"], np.vstack([wild, calm])[order], schedule)
        assert same(
            mixed, order >= 30, simulate(pushed_arm, manoeuvres["lower"], calm[order[order >= 30] - 30], schedule)
        )
        found = simulate(pushed_arm, manoeuvres["lower"], wild, schedule)
        lost = np.isnan(found.output)
        assert np.array_equal(lost.any(axis=1), found.failed)
        assert found.failed[-1]
        # once lost, lost for good
        assert np.array_equal(np.maximum.accumulate(lost, axis=1), lost)
        assert np.nanmax(np.abs(found.output)) <= 1e3 * pushed_arm.plant.scales.speed


def test_an_impossible_parameter_fails_alone(arm, manoeuvres, schedule):
    population, others = drawn(arm, 12, 27), np.arange(12) != 5
    expected = simulate(arm, manoeuvres["lower"], population, schedule)
    for value in (np.nan, np.inf, -1e300, 1e300):
        spoilt = population.copy()
        spoilt[5, 0] = value
        found = simulate(arm, manoeuvres["lower"], spoilt, schedule)
        assert np.array_equal(found.failed, ~others)
        assert np.isnan(found.output[5, -1])
        assert np.array_equal(found.output[others], expected.output[others])


def test_memory_is_flat_beyond_the_output(arm):
    """What Python holds at the peak, and what tracemalloc cannot see: the compiled loop's own arrays."""

    def beyond_output(n_candidates, n_samples):
        population = drawn(arm, n_candidates, 1)
        tracemalloc.start()
        try:
            found = simulate(arm, Manoeuvre(0.001, n_samples), population)
            return tracemalloc.get_traced_memory()[1] - found.output.nbytes
        finally:
            tracemalloc.stop()

    simulate(arm, Manoeuvre(0.001, 9), drawn(arm, 1, 1))
    small, large = beyond_output(80, 300), beyond_output(1280, 2000)
    # The population itself is kept once more, lane by lane: 1280 x 4 x 8 bytes and their order.
    assert large - small <= 300 * KILOBYTE
    assert 50 * large < 1280 * 2000 * 8
    resource = pytest.importorskip("resource", reason="this system does not say the resident size")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = simulate(arm, Manoeuvre(0.001, 2000), drawn(arm, 1280, 2))
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown * KILOBYTE <= found.output.nbytes + 4 * KILOBYTE**2


def test_quantities_and_latches_agree_with_one_moment_at_a_time(arm):
    manoeuvre = Manoeuvre(0.001, 800)
    names = ["demand", "voltage", "back_emf", "balance_torque", "torque", "total_inertia"]
    found = along(arm, manoeuvre, TRUTH, Schedule(4), [*names, *arm.states])
    run = simulate(arm, manoeuvre, TRUTH[np.newaxis], Schedule(4), states=True)
    closed = run.switch_times["closed"][0]
    assert np.array_equal(found["omega"], run.states["omega"][0])
    plain = PlainModel(arm, manoeuvre, TRUTH)
    for i in (0, 100, 500, 577, 579, 799):
        states = np.array([found[s][i] for s in arm.states])
        moment = plain.moment(0.001 * i, states, (float(0.001 * i >= closed),))
        assert np.allclose(plain.evaluate(names, moment), [found[n][i] for n in names], rtol=1e-12)
    assert 0.5 < closed < 0.7


N_POINTS, STEP, DISAGREEMENT = 2000, 1e-6, 1e-3
# Directions of the line: all parameters at once, and each alone.
DIRECTIONS = [[1.0, 0.7, -0.9, 0.8], *np.eye(4).tolist()]


def central(values, points):
    """Central differences over so many points to each side, at the points where the widest fit."""
    middle = slice(100, N_POINTS - 100)
    return np.asarray((np.roll(values, -points) - np.roll(values, points))[middle]) / (2 * points * STEP)


@pytest.mark.parametrize("accuracy", ["standard", "fine"])
@pytest.mark.parametrize("name", ["lower", "raise"])
def test_derivatives_at_two_steps_agree(name, accuracy, arm, manoeuvres, schedule_for):
    schedule = schedule_for(name, accuracy)
    record = simulate(arm, manoeuvres[name], TRUTH, schedule).output[0]
    for direction, start in product(DIRECTIONS, drawn(arm, 2, 11)):
        along = 1.0 + STEP * np.arange(N_POINTS)[:, np.newaxis] * np.array(direction)
        misfit = np.sqrt(mean_square(record, simulate(arm, manoeuvres[name], start * along, schedule).output))
        wide, narrow = central(misfit, 100), central(misfit, 10)
        counted = np.abs(wide) >= 0.1 * np.median(np.abs(wide))
        assert counted.mean() > 0.5
        assert np.max(np.abs(narrow - wide)[counted] / np.abs(wide)[counted]) <= DISAGREEMENT, direction


# Those that are tried, of all that one compiled model holds.
NAMES = ("coulomb", "viscous", "tilt", "gas_heat_loss", "gyro_lag", "shell_rocking", "controller_delay", "gyro_bias")


@pytest.fixture(scope="module")
def unweighted(schedule_for):
    return replace(schedule_for("lower", "standard"), weights=None)


def using(wide, plain, name, share=0.3):
    """Return a candidate that uses one effect, every other at its null."""
    values = dict(zip(list(wide.parameters)[: len(plain)], plain, strict=True))
    for key, p in list(wide.parameters.items())[len(plain) :]:
        rest = next(v for v in (p.null, p.fixed, p.nominal, 0.5 * (p.low + p.high)) if v is not None)
        in_use = key.startswith(f"{name}.") and p.null is not None
        values[key] = p.null + share * (p.high - p.null) if in_use else rest
    return np.array(list(values.values()))


@pytest.mark.nightly
def test_a_small_model_evaluates_every_effect_and_the_motion_is_that_without_what_is_inactive(
    arm, wide, rubbing_arm, manoeuvres, unweighted
):
    assert len(NAMES) == FEWEST_IDLE
    least = Model(arm.plant, tuple(EFFECTS[n] for n in NAMES))
    assert not strengths_of(Model(arm.plant, least.effects[1:]))
    assert set(strengths_of(least)) == set(NAMES) < set(strengths_of(wide))
    # The plant alone, and with two effects, few enough that both are evaluated.
    # A delay of 0 switches at once, and behind a switch no step is long: only even steps are the same.
    even = replace(unweighted, plan=None)
    for name, small in (("", arm), ("coulomb", rubbing_arm), ("viscous", rubbing_arm)):
        candidate = using(wide, drawn(arm, 1, 8)[0], name)
        values = dict(zip(wide.parameters, candidate))
        expected = simulate(small, manoeuvres["lower"], [values[n] for n in small.parameters], even).output
        found = simulate(wide, manoeuvres["lower"], candidate, even).output
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12)


@pytest.mark.slow
def test_neighbours_that_use_other_effects_change_nothing(arm, wide, manoeuvres, unweighted):
    plain = drawn(arm, 1, 7)[0]
    population = np.array([using(wide, plain, n) for n in (*NAMES, "", *NAMES[::-1])])
    together = simulate(wide, manoeuvres["lower"], population, unweighted).output
    for candidate, output in zip(population, together, strict=True):
        np.testing.assert_array_equal(simulate(wide, manoeuvres["lower"], candidate, unweighted).output[0], output)
    assert len(np.unique(together.round(9), axis=0)) == len(NAMES) + 1
    # a strength that is no number is not taken for the null
    candidate = using(wide, plain, "")
    candidate[list(wide.parameters).index("viscous.slope")] = np.nan
    assert simulate(wide, manoeuvres["lower"], candidate, unweighted).failed.all()
