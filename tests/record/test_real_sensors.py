"""Records as sensors make them: held, coarse, at several rates, with wild samples, turns, and clocks that wrap."""

import re
import warnings

import numpy as np
import pytest

import synthetic
from armid.errors import ArmidError
from armid.model import Model
from armid.problem.problem import replays
from armid.problem.space import space_of
from armid.record import RecordWarning, read_campaign

WHEEL = 'name = "wheel"\nplant = "{}"\nhold = "zero"\n{}\n[[records]]\nfile = "a.csv"\nrole = "train"\n'
N, INTERVAL = 3000, 0.002
TIMES = INTERVAL * np.arange(N)


def wheel(damping=0.3):
    """Return times, drive, angle, speed of a wheel J dw/dt = u - b w under a drive that steps; the speed has noise."""
    rng = np.random.default_rng(1)
    drive = np.repeat(rng.choice([-1.0, -0.4, 0.5, 1.0], N // 300), 300)
    speed, angle = synthetic.wheel(drive, INTERVAL, 4.0, damping)
    return {"time_s": TIMES, "drive_V": drive, "angle_rad": angle,
            "angular_velocity_rad_s": speed + 0.02 * rng.standard_normal(N)}  # fmt: skip


def read(write, columns, plant="driven_axis", more="", entry="", warns=()):
    """Return the record and its warnings, of which one matches each of some patterns and no other comes."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        campaign = read_campaign(write(WHEEL.format(plant, more) + entry, a=columns))
    said = [str(w.message) for w in caught]
    assert all(issubclass(w.category, RecordWarning) for w in caught)
    assert len(said) == len(warns), said
    for pattern, sentence in zip(warns, said, strict=True):
        assert re.search(pattern, sentence), sentence
    return campaign.records[0], campaign


def refused(write, columns, **given):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(ArmidError) as caught:
            read(write, columns, **given)
    return str(caught.value)


@pytest.mark.parametrize("uneven", [0.0, 0.1])
def test_a_speed_that_is_renewed_every_18th_sample_counts_once_a_renewal(write, uneven):
    columns = wheel(damping=1e-9)
    held = np.repeat(columns["angular_velocity_rad_s"][::18], 18)[:N]
    jitter = uneven * INTERVAL * np.random.default_rng(2).uniform(-1.0, 1.0, N)
    columns |= {"angular_velocity_rad_s": np.round(held / 0.01) * 0.01, "time_s": TIMES + jitter}
    warned = ["renewed every 18 rows"] if uneven == 0.0 else ["irregular sampling", "renewed every 18 rows"]
    record, campaign = read(write, columns, warns=warned)
    (signal,) = record.signals
    assert signal.sensor.hold == 18
    assert signal.sensor.step == pytest.approx(0.01)
    assert signal.broken == ()
    assert record.n_samples == pytest.approx(N / 18, abs=1)
    assert record.noise.rms == pytest.approx(0.02, rel=0.35)
    model = Model(campaign.plant)
    (replay,) = replays([record], model, space_of(model))
    # of the samples that are data, at an inertia of 0.25
    residual = replay.measured - replay.signal(np.array([[0.25]]))[0]
    assert len(residual) == len(replay.times) == record.n_samples
    np.testing.assert_allclose(np.diff(replay.times), 18 * INTERVAL, atol=2e-3 * (uneven > 0) + 1e-9)
    # neither the holds nor the jitter of the clock are in it
    assert np.std(residual) < 0.03 + 4.0 * uneven * INTERVAL


def test_sticks_of_a_coarse_encoder_are_data(write):
    rng = np.random.default_rng(3)
    drive = np.sin(2.0 * TIMES) + 0.4 * np.sin(5.3 * TIMES)
    slip = np.sign(drive) * np.maximum(np.abs(drive) - 0.6, 0.0)
    angle = np.cumsum(slip) * INTERVAL
    step = 2.0 * np.pi / 4096
    for uneven in (0.0, 0.03):
        times = TIMES + uneven * INTERVAL * rng.uniform(-1.0, 1.0, N)
        columns = {"time_s": times, "drive_V": drive, "angle_rad": np.round(angle / step) * step}
        record, _ = read(write, columns, "rotary_arm", warns=["irregular"] if uneven else [])
        (signal,) = record.signals
        assert signal.data is None
        assert signal.broken == ()
        assert record.n_samples == N
        assert signal.sensor.step == pytest.approx(step)
        assert record.noise.rms >= step / np.sqrt(12.0) * (1.0 - 1e-9)


def test_outputs_at_different_rates_stand_in_one_file(write):
    columns = wheel()
    whole = columns["angle_rad"].copy()
    columns["angle_rad"] = np.where(np.arange(N) % 2 == 0, whole, np.nan)
    columns["temperature_C"] = np.where(np.arange(N) == 7, 21.0, np.nan)
    record, _ = read(write, columns, "rotary_arm", warns=["angle_rad has no number in 1500 of 3000 rows.*line 3"])
    angle, speed = record.each
    assert (angle.output, angle.n_samples, speed.n_samples) == ("angle", N // 2, N)
    assert speed.signals[0].data is None
    np.testing.assert_allclose(angle.measured[:-1], whole[:-1], atol=1e-4)
    assert "temperature_C" not in record.columns
    columns["angle_rad"] = np.where(np.arange(N) % 3 == 0, whole, np.nan)
    assert "angle_rad has no number in 2000 of 3000 rows" in refused(write, columns, plant="rotary_arm")
    columns["drive_V"] = np.where(np.arange(N) == 40, np.nan, columns["drive_V"])
    columns["angle_rad"] = whole
    assert "line 42: drive_V has no number there" in refused(write, columns, plant="rotary_arm")


@pytest.mark.parametrize("at", [0, 1700, N - 1])
def test_one_wild_sample_never_hides_the_motion(write, at):
    sound, _ = read(write, wheel())
    columns = wheel()
    columns["angular_velocity_rad_s"][at] = -1e6
    record, campaign = read(
        write, columns, warns=[f"a.csv: angular_velocity_rad_s is -1e.06 on line {at + 2}, far from"]
    )
    assert [(b.kind, b.count, b.line) for b in record.signals[0].broken] == [("spikes", 1, at + 2)]
    assert record.n_samples == N - 1
    assert record.noise.rms == pytest.approx(sound.noise.rms, rel=0.05)
    assert campaign.plant.scales.speed == pytest.approx(np.max(np.abs(sound.measured)))
    start, other = (r.pieces[0].manoeuvre.constants["start_speed"] for r in (record, sound))
    assert start == pytest.approx(other, abs=4.0 * sound.noise.rms)


def test_no_more_than_a_share_is_left_out_without_an_error(write):
    columns = wheel()
    speed = columns["angular_velocity_rad_s"]
    columns["angular_velocity_rad_s"] = np.minimum(speed, 0.6 * speed.max())
    said = refused(write, columns)
    assert re.search(r"a\.csv, line \d+: \d+\.\d% of the samples of angular_velocity_rad_s are no data, most of them "
                     r"are at the limit of the sensor: at most 5% are expected", said)  # fmt: skip
    record, _ = read(write, columns, entry="most_lost = 0.6\n")
    (clipped,) = record.signals[0].broken
    assert clipped.kind == "clipped"
    assert record.n_samples == N - clipped.count


@pytest.mark.parametrize(("header", "turn", "factor"), [
    ("angle_rad", 2.0 * np.pi, 1.0), ("angle_deg", 360.0, np.pi / 180.0), ("angle_turns", 1.0, 2.0 * np.pi),
    ("angle_counts", 65536.0, 2.0 * np.pi / 8000.0), ("angle_counts", 2.0**32, 2.0 * np.pi / 8000.0),
])  # fmt: skip
def test_turns_are_reported_and_taken_out(write, header, turn, factor):
    columns = wheel()
    angle = columns.pop("angle_rad") / factor + (turn - 100.0 if turn > 1e3 else 0.3 * turn)
    if header == "angle_counts":
        angle = np.rint(angle)
    columns[header] = np.mod(angle, turn)
    wraps = int(np.sum(np.floor(angle[1:] / turn) != np.floor(angle[:-1] / turn)))
    assert wraps > 0
    first = int(np.argmax(np.abs(np.diff(columns[header])) > 0.5 * turn)) + 3
    counts = "counts_per_turn = 8000\n"
    said = [f"{header} wraps at {turn:.6g}, {wraps} times, the first on line {first}: unwrap = true".replace("+", ".")]
    read(write, columns, "rotary_arm", counts, warns=said)
    record, _ = read(write, columns, "rotary_arm", counts + "unwrap = true\n")
    start = columns[header][0] * factor
    np.testing.assert_allclose(
        record.measured, angle * factor - angle[0] * factor + start, atol=1e-6 * abs(start) + 1e-9
    )
    if turn < 400.0:
        columns[header] = np.mod(np.cumsum(np.linspace(0.1, 0.9, N)) * turn, turn)
        assert "half a turn or more" in refused(write, columns, plant="rotary_arm", more="unwrap = true\n")


@pytest.mark.parametrize(("change", "words"), [
    (lambda t: np.insert(t, 100, t[100]), ["is there twice with all its row (1 such rows", "drop_duplicates"]),
    (lambda t: np.where(np.arange(N) < 1500, t, t - t[1500]), ["line 1502", "set back, or a second recording"]),
    (lambda t: np.mod(t + 2.0**32 * 1e-6 - 1.0, 2.0**32 * 1e-6),
     ["line 502", "a counter of 32 bits that wraps", "4294.97 s"]),
    (lambda t: np.mod(t + 60.0, 65.536), ["a counter of 16 bits that wraps", "65.536 s"]),
])  # fmt: skip
def test_times_that_do_not_rise_are_refused_with_their_cause(write, change, words):
    columns = wheel()
    times = change(TIMES)
    if times.size > N:
        columns = {k: np.insert(v, 100, v[100]) for k, v in columns.items()}
    said = refused(write, columns | {"time_s": times})
    for word in words:
        assert word in said, said
