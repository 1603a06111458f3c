"""The loop on records of several outputs: dry friction is missing, and a record begins in motion with one output."""

from dataclasses import replace

import numpy as np
import pytest
from two_inertias import NOISE_ANGLE, NOISE_SPEED, TRUTH, two_inertias, write_drive

from armid.inference.checks import holdout_residuals
from armid.inference.kinds.faults import Fault
from armid.loop import close_loop, report_of
from armid.loop.document import details_of, loop_document
from armid.loop.figures import figures_of
from armid.model import EFFECTS
from armid.model.effects.sensor import sensor_effects
from armid.record import read_campaign
from armid.report.style import pyplot
from changed_records import trimmed

pytestmark = pytest.mark.slow
FRICTION = 0.3


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    folder = write_drive(tmp_path_factory.mktemp("loop") / "drive", FRICTION, 0.03)
    campaign = read_campaign(folder, {"two_inertias": two_inertias})
    wanted = {name: EFFECTS[name] for name in ("coulomb", "viscous", "stribeck", "gyro_bias")}
    return close_loop(campaign.model(), campaign, {**wanted, **sensor_effects(campaign.plant)})


@pytest.mark.nightly
def test_the_missing_friction_is_named_the_rest_is_noise_and_the_start_held_out_does_not_judge(closed):
    """The bias of the load's angle is none: a start that is fitted makes up for all of it."""
    assert (closed.verdict, closed.effects) == ("explained", ("coulomb",))
    found = {e.name: e for e in closed.after.estimates}
    for name, truth in {**TRUTH, "coulomb.level": FRICTION}.items():
        e = found[name]
        assert e.low < truth < e.high or abs(e.value - truth) < 1.5 * (e.high - e.low) / 2.0
    for replay, residual, noise in zip(closed.after.train.replays, closed.after.train.raw,
                                       (NOISE_SPEED, NOISE_ANGLE, NOISE_ANGLE, NOISE_ANGLE), strict=True):  # fmt: skip
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(noise, rel=0.1), replay.name
    piece = closed.campaign.holdout[0].pieces[0]
    assert (piece.n_spent, piece.window.start) == (35, 35)
    started = closed.after.holdout.replays[0].pieces[0]
    for name, deviation in piece.start_deviation.items():
        assert started.start_deviation[name] < deviation, "the model knows more of these samples than a curve does"
        assert abs(started.manoeuvre.constants[name] - piece.manoeuvre.constants[name]) < 4.0 * deviation
    again = holdout_residuals(closed.after.fit, closed.campaign.holdout, closed.inference.exploration.library)
    np.testing.assert_array_equal(again.residual, closed.after.holdout.residual)


@pytest.mark.nightly
def test_the_report_tells_each_output_and_its_residual_is_drawn_against_speed_and_position(closed):
    report, details = report_of(closed), details_of(closed)
    assert list(report["outputs"]) == ["motor_speed", "load_angle", "deflection"]
    assert (report["unit"], report["outputs"]["deflection"]["unit"]) == ("rad/s", "rad")
    assert report["noise_rms"] == pytest.approx(NOISE_SPEED, rel=0.1)
    before, after = (report["error"][model]["holdout"] for model in ("before", "after"))
    assert after["rmse"] == after["outputs"]["motor_speed"]["rmse"] < before["rmse"]
    shares = [e["rmse"] / e["span"] for e in after["outputs"].values()]
    assert after["joint_nrmse"] == pytest.approx(np.sqrt(np.mean(np.square(shares))))
    records = report["error"]["after"]["records"]
    assert list(records["b.csv"]["outputs"]) == ["load_angle"]
    assert records["c.csv"]["outputs"]["load_angle"]["rmse"] == pytest.approx(after["outputs"]["load_angle"]["rmse"])
    document = loop_document(report, details, {}, "again")
    assert "load_angle" in " ".join(document.answer)
    assert any("in load_angle" in f.where for f in closed.before.diagnosis.findings)
    drawn = {name: draw() for name, draw in figures_of(closed, report, details).items()}
    figure = drawn["against"]
    variables = closed.before.train.variables
    assert len(figure.axes) % 2 == 0
    for axis in figure.axes:
        samples, means = axis.lines[0].get_xdata(), {line.get_label(): line for line in axis.lines[1:4:2]}
        assert 0 < len(samples) <= len(variables[axis.get_xlabel().partition(" [")[0]])
        before, after = (np.abs(means[name].get_ydata()).max() for name in ("before", "after"))
        assert after < before
    pyplot().close("all")


@pytest.fixture
def sound(tmp_path):
    """The drive without friction: nothing is missing."""
    return read_campaign(write_drive(tmp_path / "drive"), {"two_inertias": two_inertias})


@pytest.mark.nightly
def test_where_nothing_is_missing_no_sensor_is_accused(sound):
    """The angle of the shaft is small: a larger gain of its sensor would shrink the noise in it as well."""
    found = close_loop(sound.model(), sound, {"coulomb": EFFECTS["coulomb"]})
    assert (found.verdict, found.effects, found.suspects) == ("no_discrepancy", (), ())
    assert report_of(found)["probabilities"]["nothing"] > 0.8
    for e in found.after.estimates:
        assert abs(TRUTH[e.name] - e.value) < 1.5 * (e.high - e.low) / 2.0


@pytest.mark.nightly
@pytest.mark.parametrize(("file", "kind", "value", "alone"), [
    ("a.csv", "gain", 0.03, False), ("a.csv", "late", 0.015, True),
])  # fmt: skip
def test_a_fault_of_one_sensor_is_told(sound, file, kind, value, alone):
    """Of several outputs one sensor is at fault; starts are fitted meanwhile."""
    fault = Fault(kind, alone=alone)
    records = tuple(trimmed(fault, r, -value, sound.plant, "load_angle") if r.file == file else r
                    for r in sound.records)  # fmt: skip
    found = close_loop(sound.model(), replace(sound, records=records), {"coulomb": EFFECTS["coulomb"]})
    (suspect,) = found.suspects
    assert (suspect.record, suspect.kind, suspect.output) == (file, kind, "load_angle")
    shown = value / (1.0 - value) if kind == "gain" else value
    assert suspect.low < shown < suspect.high
    assert found.effects == ()
