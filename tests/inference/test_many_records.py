"""Long campaigns: some of the records are searched first, and the models that lead there are fitted to all."""

from types import SimpleNamespace

import numpy as np
import pytest

from armid.inference import infer, prepared, search
from armid.inference.whitening import whitened
from armid.model import EFFECTS, Model
from armid.record import read_campaign
from synthetic import write_records

MASS, FRICTION, STEP_S, N, REST = 2.0, 3.0, 0.02, 180, 60
HEAD = 'name = "many"\nplant = "driven_axis"\nhold = "zero"\n'
FEW = ("coulomb", "viscous", "drive_gain")


def campaign(folder, noise, count):
    """Eight records of an axis with dry friction, at rest first; count: the step of the sensor, of all or of each."""
    counts = np.broadcast_to(count, 8)
    rng, tables = np.random.default_rng(61), {}
    for i in range(8):
        force = np.where(np.arange(N) < REST, 0.0, np.repeat(rng.normal(0.0, 15.0, N // 10), 10))
        now, speed = 0.0, [0.0]
        for f in force[:-1]:
            for _ in range(50):
                after = now + STEP_S / 50 * f / MASS
                now = np.sign(after) * max(abs(after) - STEP_S / 50 * FRICTION / MASS, 0.0)
            speed.append(now)
        measured = np.round((speed + noise * rng.standard_normal(N)) / counts[i]) * counts[i]
        tables[f"r{i}.csv"] = {"time_s": STEP_S * np.arange(N), "velocity_m_s": measured, "drive_N": force}
    return read_campaign(write_records(folder, HEAD, tables, holdout=0))


def test_data_of_some_records_have_the_noise_that_all_have(tmp_path):
    coarse = campaign(tmp_path, 0.002, 0.02)
    whole = whitened(coarse.train, coarse.plant)
    which = [1, 4, 7]
    some = whole.of_records(which)
    own = [i for i, one in enumerate(whole.each) if one.file in {coarse.train[k].file for k in which}]
    assert [r.file for r in some.records] == [coarse.train[k].file for k in which]
    assert len(whole.blocks) > len(some.blocks) > 0
    signals = [np.random.default_rng(i).standard_normal((2, r.n_samples)) for i, r in enumerate(whole.each)]
    parts = whole.by_record(whole.white(signals))
    assert np.array_equal(some.white([signals[i] for i in own]), np.concatenate([parts[i] for i in own], axis=-1))


def test_a_coarse_record_has_a_noise_of_its_own(tmp_path):
    """At rest a coarse sensor shows nearly no noise. Steps below the noise do not separate sensors."""
    coarse = 0.1
    mixed = campaign(tmp_path, 0.02, [1e-4, 1e-4, coarse, 1e-4, 2e-4, 1e-4, 1e-4, 1e-4])
    levels = [level.rms for level in whitened(mixed.train, mixed.plant).levels]
    assert levels[2] == pytest.approx(np.hypot(0.02, coarse / np.sqrt(12.0)), rel=0.2)
    fine = [*levels[:2], *levels[3:]]
    assert fine == [fine[0]] * 7
    assert fine[0] == pytest.approx(0.02, rel=0.1)


@pytest.mark.nightly
def test_what_leads_on_some_records_is_fitted_to_all(tmp_path, monkeypatch):
    many = campaign(tmp_path, 0.01, 1e-4)
    data = whitened(many.train, many.plant)
    monkeypatch.setattr(search, "SAMPLES", len(data.sound) // 4)
    messages, effects = [], {n: EFFECTS[n] for n in FEW}
    found = infer(*prepared(Model(many.plant), many, effects, told=messages.append))
    assert any(m.startswith("looking at 2 of 8 records") for m in messages)
    assert found.exploration.is_led
    assert found.probabilities["effects"]["coulomb"] > 0.95
    best = found.exploration.fits[found.in_force]
    assert len(best.residual) == len(data.sound)
    assert best.values["mass"] == pytest.approx(MASS, rel=0.01)
    (level,) = (value for name, value in best.values.items() if name.endswith(".level"))
    assert level == pytest.approx(FRICTION, rel=0.02)


@pytest.mark.parametrize(("n_samples", "which"), [(40_002, [1, 4]), (11_004, None), (24_000, [1, 4]), (48_000, [3])])
def test_which_records_are_looked_at(monkeypatch, n_samples, which):
    data = SimpleNamespace(records=(SimpleNamespace(n_samples=n_samples // 6),) * 6)
    monkeypatch.setattr(search, "SAMPLES", 8_000)
    assert search.some_records(data) == which
