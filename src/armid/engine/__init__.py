"""How the machine moves: compiled simulation of populations.

simulate: a population through a manoeuvre, and quantities along a motion. calibrate: how finely time is cut.
generate, templates/kernel.py.jinja: the module of a model, its equations and the loop that integrates them.
templates/history.py.jinja: the past of late states.
transpile: the source of an equation, made self-contained. compile: the module, and what of it is kept on disk.
simd, simd_bundles, simd_math: vectors of candidates in numba, several of them as one, their elementary functions.
"""

from armid.engine.calibrate import (
    FINE,
    STANDARD,
    Calibration,
    accuracy_against,
    calibrate,
    golden_steps,
    hiding_noise,
    probes,
)
from armid.engine.compile import cache_folder, compile_model
from armid.engine.simulate import Prepared, Schedule, Simulation, along, prepare, simulate

__all__ = [
    "FINE", "STANDARD", "Calibration", "Prepared", "Schedule", "Simulation", "accuracy_against", "along",
    "cache_folder", "calibrate", "compile_model", "golden_steps", "hiding_noise", "prepare", "probes", "simulate",
]  # fmt: skip
