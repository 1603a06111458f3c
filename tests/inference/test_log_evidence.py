"""The evidence against exact formulas of linear models, and the mixture against samples of it."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from armid.estimation.constants import NAMED
from armid.inference import prepared
from armid.inference.decisions import PriorBeliefs, calibration
from armid.inference.evidence import (
    SCALES_OF_STRENGTH,
    Expansion,
    Scale,
    expansion_of,
    forecast,
    log_normal,
    log_strengths,
    log_tails,
)
from armid.inference.kinds.hypothesis import Hypothesis, Proposal
from armid.inference.posterior import Atom, Posterior, confirmed_slopes, most_odds, truncated, unbounded
from armid.inference.search import begun
from armid.model import EFFECTS, Model
from armid.problem.cover import Cover
from armid.record import read_campaign

N, RNG = 60, np.random.default_rng(11)
JACOBIAN, OTHERS = RNG.normal(size=(N, 2)), RNG.normal(size=(N, 1))


def stub(residual):
    """A fit of two parameters, of which an expansion asks no more than this."""
    space = SimpleNamespace(low=np.zeros(2), high=np.ones(2), free=np.ones(2, dtype=bool))
    z = np.full(2, 0.5)
    parameters = dict.fromkeys("ab", SimpleNamespace(null=None))
    none_known = (np.empty(0, dtype=np.int64), np.empty(0), np.empty(0))
    return SimpleNamespace(
        n_free=2, z=z, x=z, jacobian=JACOBIAN, columns=OTHERS, residual=residual,
        chi2=float(residual @ residual),
        values={"a": 0.5, "b": 0.5}, records=SimpleNamespace(space=space, rows=none_known, span=np.ones(2)),
        model=SimpleNamespace(parameters=parameters), others=(SimpleNamespace(value=0.0),),
    )  # fmt: skip


def expansion(residual, scale=None):
    library = SimpleNamespace(owner=lambda _: None)
    return Expansion(stub(residual), scale or Scale(N, 1.0, 1e9), library, np.empty((N, 0)))


def test_columns_that_rounding_does_not_tell_apart_have_a_covariance(monkeypatch):
    """As those of a model that jumps next to its estimate."""
    monkeypatch.setitem(globals(), "JACOBIAN", 1e8 * (JACOBIAN[:, :1] + np.array([0.0, 1e-9])))
    about = expansion(np.ones(N))
    assert np.all(np.diag(about.covariance) > 0.0)


def proposal(columns, scales, **more):
    return Proposal(
        Hypothesis("effect", "x"), columns, np.array(scales), np.zeros(len(columns)), lambda *_: None, **more
    )


def exact(residual, columns, deviation):
    """The exact log Bayes factor of columns with normal strengths, the unknowns of the stub with their priors."""
    prior = np.array([2.0 * np.pi, 2.0 * np.pi, 1.0])
    unknowns = np.hstack([JACOBIAN, OTHERS])
    noise = np.eye(N) + unknowns / prior @ unknowns.T
    more = noise + deviation**2 * columns.T @ columns
    return multivariate_normal.logpdf(residual, cov=more) - multivariate_normal.logpdf(residual, cov=noise)


@pytest.mark.parametrize("deviation", [0.01, 1.0, 30.0])
def test_a_forecast_is_the_bayes_factor_of_a_linear_model(deviation):
    column, residual = RNG.normal(size=(1, N)), RNG.normal(size=N)
    residual = residual + 0.5 * column[0]
    found = forecast(expansion(residual), proposal(column, [deviation]))
    assert found.total == pytest.approx(exact(residual, column, deviation), abs=1e-5)


@pytest.mark.parametrize(("end", "push", "is_held"), [(0.0, -3.0, True), (0.0, 3.0, False), (1.0, 3.0, True)])
def test_a_parameter_that_is_pushed_against_its_end_cannot_make_up_for_what_is_added(end, push, is_held):
    """Its residual is left, so the forecast of a column that does the same is large."""
    rng = np.random.default_rng(12)
    residual = push * JACOBIAN[:, 0] + rng.normal(size=N)
    column = np.sign(push) * JACOBIAN[:, :1].T + 0.1 * rng.normal(size=(1, N))
    about = expansion(residual)
    free = forecast(about, proposal(column, [1.0])).total
    about.fit.z[0] = end
    about = replace(about)
    assert about.is_pushed.tolist() == [is_held, False, False]
    found = forecast(about, proposal(column, [1.0])).total
    if not is_held:
        assert found == pytest.approx(free, abs=1e-9)
        return
    assert found > free + 50.0
    unknowns = np.hstack([JACOBIAN[:, 1:], OTHERS])
    noise = np.eye(N) + unknowns / np.array([2.0 * np.pi, 1.0]) @ unknowns.T
    more = noise + column.T @ column
    known = multivariate_normal.logpdf(residual, cov=more) - multivariate_normal.logpdf(residual, cov=noise)
    assert found == pytest.approx(known, rel=1e-4)


@pytest.mark.parametrize("off", [0.0, 1.0, 4.0])
def test_a_constant_may_be_off_as_its_tolerance_may_be_wrong(off):
    """Against the mixture of two normal densities; other unknowns, such as the size of a fault, have no such tail."""
    others = [SimpleNamespace(value=off, unknown=SimpleNamespace(name=name)) for name in (f"{NAMED}mass", "offset")]
    mixture = 0.95 * norm.pdf(off) + 0.05 * norm.pdf(off, scale=3.0)
    assert log_tails(SimpleNamespace(others=others)) == pytest.approx(np.log(mixture / norm.pdf(off)))


def test_forecasts_of_columns_together_of_sides_of_what_unknowns_can_do_and_of_tempered_scales():
    columns, residual = RNG.normal(size=(4, N)), RNG.normal(size=N)
    found = forecast(expansion(residual), proposal(columns, [0.7], joint=True))
    assert found.total == pytest.approx(exact(residual, columns, 0.7), abs=1e-5)
    # A strength of either sign is as probable as its two one-sided halves together.
    column, residual = RNG.normal(size=(1, N)), RNG.normal(size=N)
    either = forecast(expansion(residual), proposal(column, [2.0]))
    halves = [forecast(expansion(residual), proposal(side * column, [2.0], one_sided=True)) for side in (1.0, -1.0)]
    assert np.logaddexp(*(h.total for h in halves)) - np.log(2.0) == pytest.approx(either.total, abs=1e-6)
    column = (JACOBIAN @ np.array([0.1, -0.2]))[np.newaxis]
    found = forecast(expansion(RNG.normal(size=N)), proposal(column, [1.0]))
    assert found.total == pytest.approx(0.0, abs=0.3)
    column = RNG.normal(size=(1, N))
    residual = RNG.normal(size=N) + 3.0 * column[0]
    totals = [forecast(expansion(residual, scale), proposal(column, [3.0])).total
              for scale in (Scale(N, 1.0, 1e9), Scale(N, 1.0, 20.0), Scale(6.0, 0.01, 0.1))]  # fmt: skip
    assert totals[0] > totals[1] > totals[2] > 0.0
    scale = Scale(40.0, 0.3, 12.0)
    assert scale.reach(scale.log_likelihood(321.0)) == pytest.approx(321.0)


def test_unknowns_that_are_projected_out_are_those_of_a_joint_fit_and_prior_odds_are_shared_out():
    """min over z of the projected problem is min over z and v of |r - C v|^2 + |v|^2."""
    columns, residual = RNG.normal(size=(N, 3)), RNG.normal(size=N)
    white = Cover.of(columns).white(residual)
    best = np.linalg.solve(np.eye(3) + columns.T @ columns, columns.T @ residual)
    left = residual - columns @ best
    assert white @ white == pytest.approx(left @ left + best @ best)
    beliefs = PriorBeliefs(1.0, {"effect": 0.7}, {"coulomb": 4.0})
    odds = (0.7 / 36) / (1 - 0.7 / 36)
    assert np.exp(beliefs.log_odds("effect", 36)) == pytest.approx(odds)
    assert np.exp(beliefs.log_odds("effect", 36, "coulomb")) == pytest.approx(4.0 * odds)
    assert set(calibration().expected) == {"effect", "record", "drift", "unknown", "unseen"}


@pytest.mark.parametrize(("p", "odds"), [(1.0, 1.0), (0.5, 1.0), (0.05, 2.4560), (0.005, 13.887), (1e-7, 228241.0)])
def test_a_p_value_allows_so_much_evidence_against_noise(p, odds):
    """Values of the table of Sellke, Bayarri and Berger (2001)."""
    assert most_odds(p) == pytest.approx(odds, rel=1e-4)


def test_a_temperature_makes_evidence_weaker_names_count_without_unknown_signals_and_causes_are_shares():
    atoms = tuple(Atom(e, p, frozenset({("effect", n)}), np.zeros(1), np.ones(1))
                  for e, p, n in ((np.log(9.0), 0.0, "a"), (0.0, np.log(2.0), "b")))  # fmt: skip
    assert Posterior(atoms, ("p",)).weights == pytest.approx([9 / 11, 2 / 11])
    assert Posterior(atoms, ("p",), 2.0).weights == pytest.approx([3 / 5, 2 / 5])
    plain, beside = frozenset({("effect", "a")}), frozenset({("effect", "a"), ("unknown", "torque")})
    found = Posterior(tuple(Atom(0.0, 0.0, names, np.zeros(1), np.ones(1)) for names in (plain, beside)), ("p",))
    assert found.probability("effect", "a") == pytest.approx(0.5)
    assert found.probability("unknown") == pytest.approx(0.5)
    # Two models as probable, far apart: their distance is nearly all, and no more than all.
    atoms = tuple(
        Atom(0.0, 0.0, frozenset({("effect", n)}), np.array([m]), np.ones(1)) for n, m in (("a", 0.0), ("b", 9.0))
    )
    causes = dict(Posterior(atoms, ("p",)).causes("p", 1.0))
    assert causes["noise"] == pytest.approx((2.0 * 1.96 / (9.0 + 2.0 * 1.645)) ** 2, rel=1e-3)
    assert sum(causes.values()) == pytest.approx(1.0)
    # A rare model that hardly knows the parameter has most of the variance, and little of the interval.
    atoms = tuple(Atom(e, 0.0, frozenset(names), np.zeros(1), np.array([d]))
                  for e, names, d in ((0.0, (), 1.0), (np.log(0.005), (("effect", "b"),), 20.0)))  # fmt: skip
    assert dict(Posterior(atoms, ("p",)).causes("p", 1.0))["noise"] > 0.9
    atoms = tuple(
        Atom(0.0, 0.0, frozenset({("effect", n)}), np.array([m]), np.ones(1)) for n, m in (("a", 0.0), ("b", 9.0))
    )
    # one model is in force, and another, sharper one has nearly all of the weight
    atoms = (Atom(0.0, 0.0, frozenset(), np.zeros(1), np.array([0.1])), atoms[1])
    assert all(share <= 1.0 for share in dict(Posterior(atoms, ("p",)).causes("p", 30.0)).values())


def test_the_mixture_has_the_quantiles_of_its_samples():
    atoms = tuple(Atom(np.log(w), 0.0, frozenset({("effect", n)}), np.array([m]), np.array([s]))
                  for w, n, m, s in ((6.0, "a", 0.0, 1.0), (3.0, "b", 5.0, 0.5), (1.0, "c", -8.0, 2.0)))  # fmt: skip
    found = Posterior(atoms, ("p",))
    drawn = np.concatenate([RNG.normal(m, s, n) for n, m, s in ((600_000, 0, 1), (300_000, 5, 0.5), (100_000, -8, 2))])
    assert found.interval("p") == pytest.approx(np.quantile(drawn, [0.025, 0.975]), abs=0.03)
    assert found.of_kind("effect") == pytest.approx({"a": 0.6, "b": 0.3, "c": 0.1})
    causes = dict(found.causes("p", 1.0))
    assert sum(causes.values()) == pytest.approx(1.0, abs=0.15)


def test_where_something_unknown_acts_a_move_of_the_names_is_doubted_whole():
    """All between the declared estimate and as far on the other side is equally likely; a complete model is not."""
    named, beside = frozenset({("effect", "a")}), frozenset({("effect", "a"), ("unknown", "torque")})
    complete, wrong = (
        Posterior((Atom(0.0, 0.0, names, np.array([5.0]), np.array([0.1])),), ("p",), declared=np.array([8.0]))
        for names in (named, beside)
    )
    assert complete.interval("p") == pytest.approx((5.0 - 0.196, 5.0 + 0.196), abs=1e-3)
    low, high = wrong.interval("p")
    drawn = RNG.uniform(2.0, 8.0, 200_000) + RNG.normal(0.0, 0.1, 200_000)
    assert high - 5.0 == pytest.approx(1.96 * np.std(drawn), rel=0.01)
    assert low < 2.0
    assert high > 8.0
    assert replace(wrong, known=0.5).interval("p") == pytest.approx((5.0 - 0.98, 5.0 + 0.98), abs=1e-3)
    assert dict(wrong.causes("p", 0.1, "something unknown"))["something unknown"] > 0.99


@pytest.mark.parametrize("at", [-8.0, -2.0, 0.0, 3.0])
def test_a_half_normal_has_the_mean_and_deviation_of_its_samples(at):
    drawn = RNG.normal(at, 1.0, 8_000_000)
    kept = drawn[drawn > 0.0] if at > -5.0 else RNG.exponential(1.0 / 8.0, 100_000)
    assert truncated(at, 1.0) == pytest.approx((kept.mean(), kept.std()), rel=0.03)


def test_a_denied_name_leaves_its_weight_to_what_nobody_knows_and_none_to_its_rival():
    def mixture(parameters, *atoms):
        return Posterior(tuple(
            Atom(np.log(p), 0.0, frozenset(names), np.array(values), np.ones(len(values)))
            for p, names, values in atoms), parameters)  # fmt: skip

    denied, rival, unknown = ("effect", "denied"), ("effect", "rival"), ("unknown", "torque")
    found = mixture(("p", "rival.size", "denied.size"),
                    (0.6, {denied}, (1.0, np.nan, 9.0)), (0.4, {rival}, (2.0, 7.0, np.nan)))  # fmt: skip
    standing = mixture(("q", "p"), (0.9, {unknown}, (5.0, 3.0)), (0.1, set(), (6.0, 4.0)))
    left = found.without(frozenset({denied}), standing)
    assert left.sets == pytest.approx({frozenset({unknown}): 0.54, frozenset({rival}): 0.4, frozenset(): 0.06})
    means = {names: dict(zip(left.parameters, atom.mean, strict=True))
             for atom in left.atoms for names in [tuple(n for _, n in atom.names)]}  # fmt: skip
    assert means["rival",] == pytest.approx({"q": np.nan, "p": 2.0, "rival.size": 7.0}, nan_ok=True)
    assert means["torque",] == pytest.approx({"q": 5.0, "p": 3.0, "rival.size": np.nan}, nan_ok=True)


@pytest.mark.parametrize("together", [0.0, 0.999])
def test_strengths_that_the_records_show_only_together_count_with_one_joint_prior(together):
    """Else each would be as large as suits its own prior, whatever the other has to be for that."""
    value, deviations = np.array([4.0, 0.1]), np.array([2.0, 0.8])
    covariance = np.outer(deviations, deviations) * np.array([[1.0, together], [together, 1.0]])
    parameters = dict.fromkeys(("a.x", "b.x"), SimpleNamespace(null=0.0))
    space = SimpleNamespace(low=np.full(2, -9.0), high=np.full(2, 9.0), free=np.ones(2, dtype=bool))
    fit = SimpleNamespace(
        values=dict(zip(parameters, value, strict=True)), model=SimpleNamespace(parameters=parameters),
        active=[SimpleNamespace(owns=lambda n, e=e: n.startswith(e)) for e in ("a.", "b.")],
        records=SimpleNamespace(space=space),
    )  # fmt: skip
    library = SimpleNamespace(strength_of=lambda *_: 1.0)
    about = SimpleNamespace(fit=fit, library=library, sizes=np.ones(2), covariance=covariance)
    each = [log_normal(value, covariance + np.diag(pair)) for pair in product(SCALES_OF_STRENGTH**2, repeat=2)]
    exact = np.log(np.mean(np.exp(each)))
    assert log_strengths(about) == pytest.approx(exact, abs=0.2)
    alone = [np.mean([norm.pdf(v, 0.0, np.hypot(d, s)) for s in SCALES_OF_STRENGTH])
             for v, d in zip(value, deviations, strict=True)]  # fmt: skip
    assert (abs(np.sum(np.log(alone)) - exact) > 0.5) == (together > 0.0)


def test_a_parameter_at_its_bound_hides_nothing_of_the_others(tmp_path, write_axis):
    """Of an axis without friction, a declared slope of friction rests at 0 for half of all noises."""
    rng, held = np.random.default_rng(7), []
    for i in range(6):
        speed = 4.0 * np.arange(401) / 200.0 + 0.02 * rng.standard_normal(401)
        campaign = read_campaign(write_axis(tmp_path / str(i), speed))
        library, declared = prepared(Model(campaign.plant) + EFFECTS["viscous"], campaign, {})
        scale = begun(library, declared).scale()
        about = expansion_of(declared, scale, library)
        slopes = about.unknowns[:, :2]
        linear = np.sqrt(scale.variance(declared.chi2) * np.diag(np.linalg.inv(scale.weight * slopes.T @ slopes)))
        np.testing.assert_allclose(np.sqrt(np.diag(unbounded(about))), linear, rtol=0.1)
        held.append(declared.values["viscous.slope"] == 0.0)
    assert 0 < sum(held) < 6


def test_slopes_that_a_fit_carried_on_make_no_interval_narrower(tmp_path, write_axis):
    """Errors of the slopes that nothing takes up would look like information."""
    rng = np.random.default_rng(3)
    speed = 4.0 * np.arange(401) / 200.0 + 0.02 * rng.standard_normal(401)
    campaign = read_campaign(write_axis(tmp_path, speed))
    library, declared = prepared(Model(campaign.plant) + EFFECTS["viscous"], campaign, {})
    scale = begun(library, declared).scale()
    slopes = expansion_of(declared, scale, library).unknowns[:, :2]
    free = np.flatnonzero(np.array([declared.values[n] for n in ("mass", "viscous.slope")]) > 0.0)
    right = scale.weight * slopes[:, free].T @ slopes[:, free]
    deviation = np.sqrt(np.diag(np.linalg.inv(right)))
    errors = rng.standard_normal((len(slopes), 2)) / np.sqrt(len(slopes)) / deviation.min()
    wrong = slopes + errors
    flat = np.full(2, 1e-6)
    found = confirmed_slopes(declared, wrong, flat, scale.weight)[:, free]
    again = np.sqrt(np.diag(np.linalg.inv(scale.weight * found.T @ found)))
    assert (np.sqrt(np.diag(np.linalg.inv(scale.weight * wrong[:, free].T @ wrong[:, free]))) < 0.8 * deviation).all()
    np.testing.assert_allclose(again, deviation, rtol=0.05)
