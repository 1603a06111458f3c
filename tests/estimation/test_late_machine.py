"""What identification makes of a dead time: its value, its interval, its derivative, and that it is not a lag."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armid import identify
from armid.estimation.information import information_at
from armid.estimation.least_squares import estimate, refine, weighted_records
from armid.model import EFFECTS, Model
from armid.problem.problem import replays
from armid.problem.space import space_of
from armid.record import read_campaign
from synthetic import write_records
from winch import DRUM, FRICTION, INTERVAL, K_T, OHMS, exact_speed, held_voltage, winch

NOISE, DELAY = 0.12, 0.0142
PLUGIN = f"{Path(__file__).parents[1] / 'winch.py'}:winch"


def written(folder, rng, times=None):
    """Write a campaign of two records of the winch; times: grid, rng -> times and which samples, None: all, even."""
    tables = {}
    for name, seed in (("a.csv", 2), ("b.csv", 5)):
        u = held_voltage(np.random.default_rng(seed))
        grid = INTERVAL * np.arange(len(u))
        t, kept = (grid, slice(None)) if times is None else times(grid, rng)
        speed = exact_speed(u[kept], DELAY, t) + NOISE * rng.standard_normal(len(t))
        tables[name] = {"time_s": np.round(t, 9), "angular_velocity_rad_s": speed, "volts_V": u[kept]}
    head = 'name = "winch"\nplant = "winch"\n'
    return read_campaign(write_records(folder, head, tables, holdout=0), {"winch": winch})


def late_model():
    return Model(winch) + EFFECTS["viscous"] + EFFECTS["drive_delay"].in_form("voltage")


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """Records of one campaign, ready for least squares, and their estimate."""
    campaign = written(tmp_path_factory.mktemp("late") / "campaign", np.random.default_rng(1))
    model = late_model()
    space = space_of(model)
    ready = replays(campaign.train, model, space)
    return space, ready, estimate(ready, space)


@pytest.mark.slow
def test_the_estimate_comes_from_anywhere_in_the_range_and_intervals_hold_the_truth(fitted):
    """The steps of the voltage are 30 samples long: chi2 has its next minimum beyond them."""
    space, ready, x = fitted
    sd = information_at(ready, space, x).deviation
    assert np.all(np.abs(x - [DRUM, FRICTION, DELAY]) <= 4.0 * sd)
    for delay in (0.0, 0.003, 0.008, 0.021, 0.03):
        assert np.all(np.abs(refine(ready, space, np.array([x[0], x[1], delay])) - x) <= 0.02 * sd)
    # Of 16 noises a 95 % interval misses 4 or more with a chance of 1 %; the mean is off by less than the noise.
    truth = space.complete(np.array([[DRUM, FRICTION, DELAY]]))
    signals, rng, found = [r.signal(truth)[0] for r in ready], np.random.default_rng(8), []
    for _ in range(16):
        pairs = zip(ready, signals, strict=True)
        noisy = tuple(r.measuring(s + NOISE * rng.standard_normal(len(s))) for r, s in pairs)
        x = refine(noisy, space, np.array([DRUM, FRICTION, 0.012]))
        found.append((x[2] - DELAY) / information_at(noisy, space, x).deviation[2])
    assert np.sum(np.abs(found) > 1.96) <= 3
    assert abs(np.mean(found)) <= 3.0 / np.sqrt(16)


def test_a_dead_time_is_no_lag_and_a_lag_no_dead_time(fitted):
    """Either explains its own record to the noise and leaves far more of the other's."""
    space, ready, _ = fitted
    truth = Model(winch) + EFFECTS["viscous"] + EFFECTS["drive_lag"].in_form("voltage")
    lagging = space_of(truth)
    lagged = replays([r.record for r in ready], truth, lagging)
    values = lagging.complete(np.array([[DRUM, FRICTION, DELAY]]))
    rng = np.random.default_rng(4)
    left = {}
    for name, make in (("dead time", None), ("lag", [r.signal(values)[0] for r in lagged])):
        for model, records in (("dead time", ready), ("lag", lagged)):
            own = records if make is None else tuple(
                r.measuring(s + NOISE * rng.standard_normal(len(s))) for r, s in zip(records, make, strict=True)
            )  # fmt: skip
            box = space if model == "dead time" else lagging
            fit = refine(own, box, np.array([DRUM, FRICTION, 0.01]))
            chi2 = weighted_records(own, box, [1.0 / NOISE] * len(own))
            left[name, model] = chi2.chi2(chi2.shares(fit))[0] / sum(len(r.measured) for r in own)
    assert left["dead time", "dead time"] < 1.1 > left["lag", "lag"]
    assert left["dead time", "lag"] > 2.0 < left["lag", "dead time"]


@pytest.mark.slow
def test_an_estimate_does_not_stop_where_whole_samples_make_chi2_jump(tmp_path):
    """A current shows a late voltage at once: at a dead time of three samples chi2 is stepped, and not to be passed."""
    late, rng = 3, np.random.default_rng(6)
    with_current = replace(
        winch, quantities={**winch.quantities, "recorded_current": lambda volts, winding, k_t, w, ohms, output:
                           (volts + winding - k_t * w) / ohms + output},
        ports={"torque": "N m", "winding": "V", "output": "A"}, output="recorded_current", output_unit="A",
    )  # fmt: skip
    u = held_voltage(np.random.default_rng(2))
    shown = np.concatenate([u[:1].repeat(late), u[:-late]])
    current = (shown - K_T * exact_speed(u, late * INTERVAL)) / OHMS + 0.1 * rng.standard_normal(len(u))
    table = {"time_s": INTERVAL * np.arange(len(u)), "recorded_current_A": current, "volts_V": u}
    head = 'name = "winch"\nplant = "winch"\n'
    campaign = read_campaign(write_records(tmp_path, head, {"a.csv": table}, holdout=0), {"winch": with_current})
    model = Model(with_current) + EFFECTS["viscous"] + EFFECTS["drive_delay"].in_form("voltage")
    space = space_of(model)
    ready = replays(campaign.train, model, space)
    for delay in (2.4, 2.9999, 3.0, 3.0001, 3.6):
        x = refine(ready, space, np.array([DRUM, FRICTION, delay * INTERVAL]))
        sd = information_at(ready, space, x).deviation
        assert np.all(np.abs(x - [DRUM, FRICTION, late * INTERVAL]) <= 4.0 * sd), delay
        assert 1e-3 * INTERVAL < sd[2] < 0.1 * INTERVAL
        chi2 = weighted_records(ready, space, [1.0 / 0.1])
        low, high = chi2.walls(chi2.shares(np.array([DRUM, FRICTION, 0.0])))
        # no delay is a bound, and a fit may leave it
        assert (low == 0.0).all()
        assert (high == 1.0).all()
        assert chi2.chi2(chi2.shares(x))[0] < 1.2 * len(u)


def jittered(grid, rng):
    return grid + 0.3 * INTERVAL * rng.uniform(-1.0, 1.0, len(grid)) * (grid > 0.0), slice(None)


def with_gap(grid, rng):
    kept = np.delete(np.arange(len(grid)), slice(400, 408))
    return grid[kept], kept


@pytest.mark.parametrize("times", [jittered, with_gap], ids=["jitter", "gap"])
def test_uneven_samples_are_shifted_on_the_even_grid(times, tmp_path):
    """What is resampled is shifted; the delay is right to a tenth of a sample interval."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        campaign = written(tmp_path / "uneven", np.random.default_rng(2), times)
    model = late_model()
    space = space_of(model)
    x = estimate(replays(campaign.train, model, space), space)
    assert abs(x[2] - DELAY) <= 0.1 * INTERVAL


def test_the_form_that_fits_is_taken_where_none_is_named(fitted, tmp_path):
    written(tmp_path / "campaign", np.random.default_rng(1))
    found = identify(tmp_path / "campaign", effects="viscous,drive_delay", plugins=[PLUGIN], identifier="least_squares")
    assert "drive_delay.delay" in found.to_dict()["parameters"]
    assert found.to_dict()["parameters"]["drive_delay.delay"]["value"] == pytest.approx(DELAY, abs=1e-4)
