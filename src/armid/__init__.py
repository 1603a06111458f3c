"""Identify the unknown parameters of a driven arm from its measured motion.

Names are read from their modules when they are first asked for, so that a command imports only what it needs.
"""

from importlib import import_module
from typing import Any

WHERE = {
    "armid.model": (
        "EFFECTS", "PLANTS", "ArmidError", "Constant", "Effect", "Guard", "Input", "Manoeuvre", "ManoeuvreKey", "Model",
        "Parameter", "Plant", "Scales", "State",
    ),
    "armid.simulation": ("Schedule", "Simulation", "calibrate", "probes", "simulate"),
    "armid.record": ("Campaign", "Record", "read_campaign", "write_campaign"),
    "armid.fitness": ("FITNESS", "Fitness", "numerical_similarity", "similarity"),
    "armid.problem": (
        "IdentificationProblem", "Meter", "MeterTermination", "Space", "replays", "residuals", "space_of",
    ),
    "armid.identifiers": ("IDENTIFIERS", "Identifier", "PaperPSO", "identifier_of"),
    "armid.identifiability": (
        "Examination", "Information", "Profile", "estimate", "examine", "information_at", "refine", "sensitivities",
    ),
    "armid.identification": ("Identification", "identify"),
    "armid.discrepancy": ("ClosedLoop", "close_loop", "report_of"),
    "armid.registry": ("Registry", "load_registry"),
    "armid.study.results": ("StudyResults", "load_study"),
    "armid.study.runner": ("run_study",),
    "armid.study.study": ("Study", "read_study"),
}  # fmt: skip
HOME = {name: module for module, names in WHERE.items() for name in names}
__all__ = sorted(HOME)  # noqa: PLE0605 - the names stand above


def __getattr__(name: str) -> Any:
    if name not in HOME:
        raise AttributeError(f"module 'armid' has no attribute '{name}'")
    return getattr(import_module(HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(HOME)
