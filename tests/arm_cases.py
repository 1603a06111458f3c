"""The arm's reference: its manoeuvres, its box, and candidates in it."""

import csv
from pathlib import Path

import numpy as np

from armid.model import Manoeuvre

REFERENCE = Path(__file__).parent / "reference"


def index_rows():
    with (REFERENCE / "index.csv").open(encoding="utf-8") as index:
        return list(csv.DictReader(index))


def manoeuvre_of(row, interval=0.001, n_samples=1201):
    constants = {
        "theta_C": np.deg2rad(float(row["start_angle_deg"])), "theta_D": np.deg2rad(float(row["target_angle_deg"])),
        "shell": float(row["shell"]), "U": float(row["supply_V"]),
    }  # fmt: skip
    return Manoeuvre(interval, n_samples, constants)


def candidate_of(row):
    """The parameters of a row, SI."""
    return np.array([float(row["p0_MPa"]) * 1e6, float(row["k"]), float(row["eta3"]), float(row["n"])])


def box_of(model):
    """Bounds of a model's parameters, (n_parameters,) each."""
    parameters = model.parameters.values()
    return np.array([p.low for p in parameters]), np.array([p.high for p in parameters])


def drawn(model, n_candidates, seed):
    """Candidates uniform in the box, (n_candidates, n_parameters)."""
    low, high = box_of(model)
    return low + (high - low) * np.random.default_rng(seed).random((n_candidates, len(low)))
