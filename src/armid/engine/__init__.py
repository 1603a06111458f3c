"""How the machine moves: compiled simulation of populations."""

from armid.engine.calibrate import FINE, STANDARD, Calibration, accuracy_against, calibrate, golden_steps, probes
from armid.engine.compile import cache_folder, compile_model
from armid.engine.evaluate import along
from armid.engine.simulate import Prepared, Schedule, Simulation, prepare, simulate

__all__ = [
    "FINE", "STANDARD", "Calibration", "Prepared", "Schedule", "Simulation", "accuracy_against", "along",
    "cache_folder", "calibrate", "compile_model", "golden_steps", "prepare", "probes", "simulate",
]  # fmt: skip
