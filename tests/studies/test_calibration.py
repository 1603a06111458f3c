"""The study of probabilities and intervals: its order, its truth, and its scores on answers that are made up."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from armid.inference.evidence import SCALES_OF_STRENGTH, Expansion, Scale
from calibration.campaigns import ARM, HIDDEN, MACHINE, tasks
from calibration.scores import Closed, Score, calibration_error, interval_score, median, ratio_of, reliability, score
from calibration.truth import all_found, truth_of

ENTRY = {
    "effects": [
        {"name": "drive_lag", "listed": True, "library": [["drive_lag"], ["output_lag"]], "family": "lag"},
        {"name": "saturation:hard", "listed": False, "library": [], "family": "saturation"},
    ],
    "fault": {}, "parameters": {"mass": 2.0}, "tolerances": {"length": 0.0},
}  # fmt: skip


def test_a_study_that_is_cut_short_has_seen_all_families_alike():
    every = list(tasks(3))
    assert Counter(t.family for t in every) == {**dict.fromkeys((*ARM, HIDDEN), 3), MACHINE: 8}
    assert {t.family for t in every[:12]} == {*ARM, HIDDEN, MACHINE}
    hidden = next(t for t in every if t.family == HIDDEN)
    assert (hidden.name, hidden.campaign) == ("hidden_000", "one_000")


def test_names_that_nobody_can_tell_apart_share_their_truth_and_versions_are_compared_on_it():
    truth = truth_of(ENTRY, hidden=False)
    assert truth.exact
    assert truth.holds("output_lag")
    assert not truth.holds("drive_saturation")
    assert truth.is_same_physics("drive_saturation")
    assert truth.share("drive_lag", {"drive_lag": 0.3, "output_lag": 0.6}) == pytest.approx(1 / 3)
    assert truth.share("coulomb", {"coulomb": 0.9}) == 0.0
    # an effect of no library is named by nobody
    assert not all_found(truth, [frozenset({"drive_lag"})], 4)
    assert not truth_of(ENTRY, hidden=True).holds("drive_lag")

    def answer(low, high, cpu_s):
        return {"parameters": {"after": {"mass": {"value": 2.0, "low": low, "high": high}}}, "cpu_s": cpu_s}

    mine, its = answer(1.9, 2.1, 10.0), answer(2.0, 2.4, 5.0)
    both = Closed("one_000", "one", "arm", "arm", truth, ENTRY, mine, its)
    assert both.beside_former() == [(pytest.approx(0.1), pytest.approx(0.2))]
    assert ratio_of(median)(both.times_beside_former()) == 2.0
    assert Closed("one_001", "one", "arm", "arm", truth, ENTRY, mine).beside_former() == []


def test_errors_of_probabilities_costs_of_intervals_and_targets_by_hand():
    rng = np.random.default_rng(1)
    p = rng.random(40_000)
    honest = list(zip(p, (rng.random(p.size) < p).astype(float), strict=True))
    assert calibration_error(honest) < 0.01
    assert [n for n, *_ in reliability(honest)] == [4000] * 10
    assert calibration_error([(0.9, 0.0)] * 20) == pytest.approx(0.9)
    assert interval_score([(1.0, 0.99, 1.01)]) == pytest.approx(0.02)
    assert interval_score([(1.1, 1.05, 1.15)]) == pytest.approx(0.1 + 40.0 * 0.05)
    sound = [[True]] * 19 + [[False]]
    found = score("S2", "made up", "arm", sound, lambda one: one, ">= 0.97")
    assert found.value == 0.95
    assert found.met
    assert not Score("S2", "made up", "arm", 20, 0.5, 0.4, 0.6, ">= 0.97").met
    assert Score("S2", "made up", "arm", 20, 0.5, 0.4, 0.6).met is None
    # all alike: the rule of three
    assert score("S2", "made up", "arm", [[True]] * 30, lambda one: one).low == pytest.approx(0.9)


@pytest.mark.slow
def test_nested_sampling_finds_the_evidence_of_a_linear_model():
    nested = pytest.importorskip("calibration.nested", exc_type=ImportError)
    rng, at = np.random.default_rng(2), np.array([0.4, 0.6])
    jacobian, left = rng.normal(size=(60, 2)) * 20.0, rng.normal(size=60)
    left -= jacobian @ np.linalg.lstsq(jacobian, left, rcond=None)[0]
    space = SimpleNamespace(low=np.zeros(2), high=np.ones(2), free=np.ones(2, dtype=bool))
    records = SimpleNamespace(
        space=space, span=np.ones(2), rows=(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0)),
        residuals=lambda Z: left - (Z - at) @ jacobian.T, data=SimpleNamespace(log_cover=0.0),
    )  # fmt: skip
    model = SimpleNamespace(parameters=dict.fromkeys("ab"))
    fit = SimpleNamespace(records=records, values={"a": 0.4, "b": 0.6}, model=model)
    scale = Scale(60, 1.0, 1e9)
    about = Expansion(fit, scale, SimpleNamespace(owner=lambda _: None), np.empty((60, 0)))
    log_z, error, _ = nested.nested(about, scale)
    _, determinant = np.linalg.slogdet(jacobian.T @ jacobian / (2.0 * np.pi))
    assert error < 0.6
    assert log_z == pytest.approx(-0.5 * (left @ left - 60) - 0.5 * determinant, abs=3.0 * error)
    # half-normal with one of several scales
    drawn = nested.strength(0.0, 1.0, True)((np.arange(20_000) + 0.5) / 20_000)
    assert np.mean(drawn) == pytest.approx(np.mean(SCALES_OF_STRENGTH) * np.sqrt(2.0 / np.pi), rel=1e-3)
