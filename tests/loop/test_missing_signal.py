"""A force that nobody declared is recovered from the speed of an axis, without a form and with the right variable."""

import json

import numpy as np
import pytest
from few_candidates import CANDIDATES, COMMON, TRUTH

from armid.inference.candidates import bump_at
from armid.inference.kinds.missing_signal import dependences, missing_signal, motions, segments
from armid.loop import close_loop, report_of
from armid.loop.document import conclusion, details_of
from armid.loop.figures import figures_of
from armid.model import Model
from armid.problem.problem import replays
from armid.problem.space import space_of
from armid.record import read_campaign
from armid.report.style import save
from synthetic import moved, write_records

MASS, NOISE = 2.0, 2e-4


def spring(position):
    """A force that engages beyond 0.3 m [N]."""
    return -0.8 * np.maximum(0.0, position - 0.3)


@pytest.fixture(scope="module")
def axis(tmp_path_factory):
    """Three records of an axis with an undeclared spring: model with the mass known, campaign, replays."""
    times, rng, tables = 0.005 * np.arange(400), np.random.default_rng(5), {}
    for rate in (3.0, 3.7, 4.6):
        drive = 4.0 * np.sin(rate * times)
        position, speed = moved(lambda x, u: np.array([x[1], (u + spring(x[0])) / MASS]), drive, 0.005, (0.0, 0.0)).T
        tables[f"r{rate}.csv"] = {"time_s": times, "velocity_m_s": speed + NOISE * rng.standard_normal(400),
                                  "drive_N": drive, "position_m": position}  # fmt: skip
    head = 'name = "spring"\nplant = "driven_axis"\n'
    campaign = read_campaign(write_records(tmp_path_factory.mktemp("spring") / "axis", head, tables, holdout=0))
    model = Model(campaign.plant)
    space = space_of(model, fixed={"mass": MASS})
    return model, space, replays(campaign.train, model, space)


@pytest.fixture(scope="module")
def whole(axis):
    model, space, ready = axis
    tested = Model(model.plant, tuple(map(bump_at, model.plant.ports)))
    return segments(tested, space, np.empty(0), ready, [NOISE] * 3, ["torque", "output"])


@pytest.mark.slow
def test_the_missing_force_is_recovered_without_a_form_by_gains_of_an_impulse_over_the_mass(axis, whole):
    found = missing_signal(whole, "torque")
    assert found.share > 0.99
    for segment, signal in zip(whole, found.signals, strict=True):
        times = segment.piece.manoeuvre.times()
        position = np.cumsum(segment.replays[0].record.measured) * 0.005
        truth = spring(np.interp(segment.knots, times, position))
        assert np.sqrt(np.mean((signal - truth)[3:-3] ** 2)) < 0.15 * np.ptp(truth)
    segment = whole[0]
    width = segment.knots[1] - segment.knots[0]
    assert np.allclose(segment.gains["torque"][-1, 5:-1] * NOISE, width / MASS, rtol=1e-3)
    assert np.allclose(segment.gains["output"][20:380].sum(axis=1) * NOISE, 1.0, rtol=1e-4)


def test_the_variable_is_the_position_and_the_curve_is_the_spring(axis, whole):
    model, _, _ = axis
    ranked = dependences(motions(model, np.array([MASS]), whole))
    best = ranked[0]
    assert (best.port, best.variable, best.factor) == ("torque", "q", "1")
    assert best.share > 0.95
    knots = np.linspace(best.first, best.last, len(best.heights))
    assert np.max(np.abs(best.heights - spring(knots))[1:]) < 0.25 * np.ptp(spring(knots))


@pytest.mark.nightly
def test_what_no_candidate_is_has_no_name_and_its_signal_is_told(stand, tmp_path):
    """A spring of an arm that engages beyond an angle."""
    campaign = read_campaign(stand(*COMMON, "--effect", "cable_spring=300"))
    unexplained = close_loop(Model(campaign.plant), campaign, CANDIDATES)
    report = json.loads(json.dumps(report_of(unexplained), allow_nan=False))
    assert report["verdict"] in ("unexplained", "partly_explained")
    assert report["probabilities"]["unknown"] > 0.9
    assert [s["effect"] for s in report["steps"] if s["claimed"] or s["empirical"]] == []
    assert "something that the library does not hold" in conclusion(unexplained)
    assert {s.port: s.share for s in unexplained.missing.signals}["torque"] > 0.8
    assert ("torque", "theta") in {(d.port, d.variable) for d in unexplained.missing.dependences if d.share > 0.8}
    told = " ".join(details_of(unexplained)["missing"])
    assert "theta" in told
    assert "at torque" in told
    # what is trusted is true all the same, and what a cause takes of a width is a share of it
    trusted = [e for e in unexplained.after.estimates if e.name in TRUTH and e.trusted]
    assert [e.name for e in trusted if not e.low <= TRUTH[e.name] <= e.high] == []
    causes = [c for e in unexplained.after.estimates for c in e.causes]
    assert [c for c in causes if float(c.rpartition(", ")[2].removesuffix("%")) > 100.0] == []
    figures = figures_of(unexplained, report, details_of(unexplained))
    save(figures["missing"](), tmp_path / "missing.png")
    assert (tmp_path / "missing.png").stat().st_size > 10_000
