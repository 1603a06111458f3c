"""The arm's reference: its manoeuvres, its box, and candidates in it."""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armid.model import Manoeuvre, Model

Array = NDArray[np.float64]
REFERENCE = Path(__file__).parent / "reference"


def index_rows() -> list[dict[str, str]]:
    with (REFERENCE / "index.csv").open(encoding="utf-8") as index:
        return list(csv.DictReader(index))


def manoeuvre_of(row: dict[str, str], interval: float = 0.001, n_samples: int = 1201) -> Manoeuvre:
    constants = {
        "theta_C": np.deg2rad(float(row["start_angle_deg"])), "theta_D": np.deg2rad(float(row["target_angle_deg"])),
        "shell": float(row["shell"]), "U": float(row["supply_V"]),
    }  # fmt: skip
    return Manoeuvre(interval, n_samples, constants)


def candidate_of(row: dict[str, str]) -> Array:
    """The parameters of a row, SI."""
    return np.array([float(row["p0_MPa"]) * 1e6, float(row["k"]), float(row["eta3"]), float(row["n"])])


def box_of(model: Model) -> tuple[Array, Array]:
    """Bounds of a model's parameters, (n_parameters,) each."""
    parameters = model.parameters.values()
    return np.array([p.low for p in parameters]), np.array([p.high for p in parameters])


def drawn(model: Model, n_candidates: int, seed: int) -> Array:
    """Candidates uniform in the box, (n_candidates, n_parameters)."""
    low, high = box_of(model)
    return low + (high - low) * np.random.default_rng(seed).random((n_candidates, len(low)))
