"""A loop over sticks that a coarse encoder shows."""

import numpy as np
import pytest

from armid.loop import close_loop, report_of
from armid.model import EFFECTS
from armid.record import RecordWarning, read_campaign, write_campaign

pytestmark = pytest.mark.slow
CANDIDATES = {name: EFFECTS[name] for name in ("coulomb", "viscous", "output_lag")}
HEAD = 'name = "wheel"\nplant = "rotary_arm"\nhold = "zero"\n'
ENTRIES = '[[records]]\nfile = "a.csv"\nrole = "train"\n[[records]]\nfile = "b.csv"\nrole = "holdout"\n'
STEPS = 4


def motion(drive, interval, friction, inertia, stiffness=0.0):
    """Return angle and speed of J dw/dt = u - friction(w) - k sin q, in small steps of Heun, u held."""
    angle, speed = np.zeros(len(drive)), np.zeros(len(drive))
    q = w = 0.0
    step = interval / STEPS
    for i, u in enumerate(drive):
        angle[i], speed[i] = q, w
        for _ in range(STEPS):
            a = (u - friction(w) - stiffness * np.sin(q)) / inertia
            b = (u - friction(w + step * a) - stiffness * np.sin(q + step * w)) / inertia
            q, w = q + step * w + 0.5 * step**2 * a, w + 0.5 * step * (a + b)
    return angle, speed


def test_sticks_of_a_coarse_encoder_tell_of_dry_friction(tmp_path):
    rng, interval, n, step = np.random.default_rng(7), 0.01, 2000, 2.0 * np.pi / 4096
    tables = {}
    for file in ("a.csv", "b.csv"):
        phases = rng.uniform(0.0, 2.0 * np.pi, 3)
        times = interval * np.arange(n)
        drive = sum(size * np.sin(w * times + p) for size, w, p in zip((30, 20, 15), (1.1, 2.7, 4.9), phases))
        angle, _ = motion(drive, interval, lambda w: 1.5 * w + 6.0 * np.tanh(w / 0.02), 1.0, 130.0)
        # a clock that is a little uneven
        uneven = times + 0.02 * interval * rng.uniform(-1.0, 1.0, n)
        tables[file] = {"time_s": uneven, "drive_N_m": drive, "angle_rad": np.round(angle / step) * step}
    bounds = "[parameters.inertia]\nfixed = 1.0\n[parameters.gravity_moment]\nlow = 50\nhigh = 300\n"
    bounds += "[parameters.damping]\nlow = 0.0\nhigh = 10.0\n"
    folder = write_campaign(tmp_path / "stick", HEAD + bounds + ENTRIES, tables)
    with pytest.warns(RecordWarning, match="irregular sampling"):
        campaign = read_campaign(folder)
    found = close_loop(campaign.model(), campaign, CANDIDATES)
    report = report_of(found)
    assert report["suspects"] == []
    assert "coulomb" in report["effects"]
    assert report["error"]["after"]["holdout"]["rmse"] < 4.0 * step
