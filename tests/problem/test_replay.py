"""Records and the model side by side."""

from dataclasses import replace

import numpy as np
import pytest

from armid.engine import Schedule, accuracy_against, simulate
from armid.errors import ArmidError
from armid.problem.problem import ready_record
from armid.problem.space import space_of
from armid.record import read_campaign
from changed_records import with_noise

TRUTH = np.array([[3.05e6, 1.0, 0.55, 1.4]])


def test_signal_is_the_simulation_in_the_window(paper_arm, arm, arm_space):
    record = paper_arm.with_window(0.2, 0.5).train[0]
    (replay,) = ready_record(record, arm, arm_space).each
    assert replay.measured.shape == replay.times.shape == (301,)
    np.testing.assert_allclose(replay.times[[0, -1]], [0.2, 0.5])
    np.testing.assert_array_equal(replay.measured, record.measured[200:501])
    whole = simulate(arm, record.manoeuvre, TRUTH, Schedule(4)).output[0]
    np.testing.assert_allclose(replay.signal(TRUTH)[0], whole[200:501], atol=1e-5)
    assert 0.0 < replay.engine_error_at(TRUTH[0]) < 1e-5


def test_pieces_stand_end_to_end(write_axis, axis_model, tmp_path):
    campaign = read_campaign(write_axis(tmp_path, more="restart_s = 0.5\n"))
    (replay,) = ready_record(campaign.records[0], axis_model, space_of(axis_model)).each
    assert len(replay.pieces) == 4
    assert len({id(c) for c in replay.calibrations}) == 4
    candidates = np.array([[2.0, 5.0], [3.0, 1.0]])
    parts = [run.output for run in replay.ready.runs(candidates)]
    np.testing.assert_array_equal(replay.signal(candidates), np.hstack(parts))
    # a straight line through 20 ms is not quite the curved speed at a start
    np.testing.assert_allclose(replay.signal(candidates)[0], replay.measured, atol=3e-4)


def test_the_same_manoeuvre_is_calibrated_once(write_axis, axis_model, tmp_path):
    record = read_campaign(write_axis(tmp_path, more="restart_s = 0.5\n")).records[0]
    doubled = replace(record, pieces=(record.pieces[1], record.pieces[1], record.pieces[2]))
    first, again, other = ready_record(doubled, axis_model, space_of(axis_model)).calibrations
    assert first is again
    assert other is not first


def test_noise_decides_the_accuracy(paper_arm, arm, lowering):
    record = lowering.train[0]
    quiet = with_noise(record, rms=1e-6)
    assert accuracy_against(record.noises, arm) == "standard"
    assert accuracy_against(quiet.noises, arm) == "fine"
    assert accuracy_against(with_noise(record, rms=0.0).noises, arm) == "fine"


def test_a_given_accuracy_wins(lowering, arm, arm_space):
    (fine,) = ready_record(lowering.train[0], arm, arm_space, "fine").each
    assert fine.engine_error_at(TRUTH[0]) < 2e-7
    with pytest.raises(ArmidError, match="'finest' is unknown: standard or fine"):
        ready_record(lowering.train[0], arm, arm_space, "finest")
