"""How the machine moves: compiled simulation of populations."""

from armid.simulation.calibrate import FINE, STANDARD, Calibration, accuracy_against, calibrate, probes
from armid.simulation.compile import cache_folder, compile_model
from armid.simulation.simulate import Schedule, Simulation, simulate

__all__ = [
    "FINE", "STANDARD", "Calibration", "Schedule", "Simulation", "accuracy_against", "cache_folder", "calibrate",
    "compile_model", "probes", "simulate",
]  # fmt: skip
