"""Records of a case: simulated at the truth with noise from the study's seed, or read from a campaign."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.model import ArmidError, Manoeuvre, Model
from armid.record import Noise, Record
from armid.record.pieces import is_constant, part, with_window
from armid.simulation import FINE, Schedule, calibrate, simulate
from armid.study.sheet import WHOLE

Array = NDArray[np.float64]
DEGREE = np.pi / 180.0
KNOWN = "known"
# Steps at the truth are finer by this factor than those of the engine at its "fine" accuracy. The error falls with the
# fourth power: of the arm it is then about 1e-11 rad/s.
FINER = 8


def clean_records(settings: Mapping[str, Any], model: Model) -> tuple[Record, ...]:
    """Return the records of a simulated case over their whole length, without noise.

    settings: of a run. Raises ArmidError where the truth diverges or does not move.
    """
    truth = np.array([settings["truth"][name] for name in model.parameters])
    return tuple(
        clean_record(f"manoeuvre {i}", stroke, settings["interval_s"], truth, model)
        for i, stroke in enumerate(settings["strokes"], 1)
    )


def clean_record(name: str, stroke: Mapping[str, Any], interval: float, truth: Array, model: Model) -> Record:
    """Return one record, simulated at a whole candidate."""
    n_samples = round(stroke["duration_s"] / interval) + 1
    manoeuvre = Manoeuvre(interval, n_samples, stroke["constants"])
    coarse = calibrate(model, manoeuvre, truth[np.newaxis], FINE, spans=False).schedule
    run = simulate(model, manoeuvre, truth[np.newaxis], Schedule(FINER * coarse.substeps))
    if run.failed[0]:
        raise ArmidError(f"{name}: the simulation diverges at the truth, a motion is expected")
    if is_constant(run.output[0]):
        raise ArmidError(f"{name}: the machine does not move at the truth, a motion is expected")
    silence = Noise(0.0, 0.0, 0.0, 1.0, n_samples, KNOWN)
    record = Record(
        file=name, role=stroke["role"], unit=model.plant.output_unit, manoeuvre=manoeuvre, measured=run.output[0],
        rest=np.empty(0), noise=silence, pieces=(), whole_pieces=(),
    )  # fmt: skip
    return with_signal(record, run.output[0])


def with_signal(record: Record, measured: Array) -> Record:
    """Return the record with another signal over its whole length, in one piece."""
    pieces = (part(record.manoeuvre, measured, 0, measured.size, {}),)
    return replace(record, measured=measured, pieces=pieces, whole_pieces=pieces)


def in_window(record: Record, window: Sequence[float] | str) -> Record:
    """Return the record in a window [s]; the word for all of it leaves what its file says."""
    return record if window == WHOLE else with_window(record, (float(window[0]), float(window[1])), record.file)


def noisy_records(records: Sequence[Record], settings: Mapping[str, Any]) -> tuple[Record, ...]:
    """Return the records with white noise of the gyro added, of an rms that is known and need not be estimated.

    The same study seed, case, level and seed give the same noise whoever searches, on whatever fitness and window.
    """
    rng, rms = noise_generator(settings), DEGREE * settings["noise_deg_s"]
    noisy = []
    for record in records:
        known = Noise(rms, 0.0, 0.0, 1.0, record.measured.size, KNOWN)
        signal = record.measured + rms * rng.standard_normal(record.measured.size)
        noisy.append(with_signal(replace(record, noise=known), signal))
    return tuple(noisy)


def noise_generator(settings: Mapping[str, Any]) -> np.random.Generator:
    """Return the source of a run's noise: of the study's seed, the case, the level and the run's seed alone."""
    told = "\0".join(str(settings[word]) for word in ("noise_seed", "case", "noise_deg_s", "seed"))
    return np.random.default_rng(np.frombuffer(hashlib.sha256(told.encode()).digest(), dtype="<u4"))
