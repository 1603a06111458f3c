"""Samples that are no data are found in a record's signal alone; a sound record has none."""

from dataclasses import replace

import numpy as np
import pytest

from armid.model import Manoeuvre
from armid.record import Irregularity, Noise, Piece, Record
from armid.record.broken import broken_samples

N, NOISE = 1200, 0.005


def record(change=lambda signal: signal, irregularity=None):
    rng = np.random.default_rng(3)
    time = 1e-3 * np.arange(N)
    signal = np.round(change(2.0 * np.sin(4.0 * time) + NOISE * rng.standard_normal(N)), 6)
    manoeuvre = Manoeuvre(1e-3, N)
    piece = Piece(manoeuvre, signal, slice(0, N))
    noise = Noise(NOISE, 0.0, 0.0, 1.0, 200, "rest")
    return Record("a.csv", "train", "rad/s", manoeuvre, signal, np.zeros(200), noise, (piece,), (piece,),
                  irregularity=irregularity)  # fmt: skip


def stuck(signal):
    signal[300:340] = signal[300]
    return signal


def spikes(signal):
    signal[[100, 500, 900]] += [1.0, -0.5, 2.0]
    return signal


def gap(signal):
    signal[400:470] = np.interp(np.arange(400, 470), [399, 470], signal[[399, 470]])
    return signal


@pytest.mark.parametrize(("change", "kind", "count"), [
    (stuck, "stuck", 40), (spikes, "spikes", 3), (lambda s: np.minimum(s, 1.5), "clipped", None),
])  # fmt: skip
def test_each_kind_is_found_where_it_is(change, kind, count):
    sound = record()
    broken = record(change)
    (found,) = broken_samples(broken)
    assert found.kind == kind
    changed = np.abs(broken.measured - sound.measured) > 0.0
    assert found.count == (count or changed.sum())
    assert not (changed & ~found.samples).any()
    times = broken.times[found.samples]
    assert (found.from_s, found.to_s) == (times[0], times[-1])


def test_a_gap_that_was_bridged_is_no_data():
    # the reader keeps all digits of a line
    uneven = record(irregularity=Irregularity(0.1, 70.0, 0.399))
    broken = replace(uneven, measured=gap(uneven.measured.copy()))
    (found,) = broken_samples(broken)
    assert (found.kind, found.count) == ("gap", 72)


def test_a_sound_record_and_a_coarse_quiet_one_have_none():
    assert broken_samples(record()) == ()
    coarse = record(lambda signal: 0.05 * np.round(signal / 0.05))
    assert broken_samples(coarse) == ()


def test_motion_at_the_ends_and_what_a_jump_of_an_input_does_are_no_spikes():
    times, noise = np.arange(N) * record().manoeuvre.interval, 1e-4 * np.random.default_rng(4).standard_normal(N)
    quiet = replace(record(), noise=Noise(1e-4, 0.0, 0.0, 1.0, 200, "rest"))
    moving = replace(quiet, measured=np.sin(40.0 * times + 0.3) + noise)
    assert broken_samples(moving) == ()

    target = np.where(np.arange(N) < 600, 0.0, 1.0)
    since = np.maximum(np.arange(N) - 600.0, 0.0)
    decaying = replace(quiet, measured=noise + 12.0 * target * np.exp(-since / 3.0))
    assert broken_samples(decaying) == ()
    alone = replace(quiet, measured=noise + 12.0 * target * np.exp(-since / 0.05))
    driven = replace(alone, manoeuvre=replace(alone.manoeuvre, inputs={"target": target}))
    assert broken_samples(driven) == ()
    (found,) = broken_samples(alone)
    assert (found.kind, found.count) == ("spikes", 1)
