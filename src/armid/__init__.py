"""Identify the unknown parameters of a motor-driven machine from its measured motion.

Names are read from their modules when they are first asked for, so that a command imports only what it needs.
"""

from importlib import import_module
from typing import Any

WHERE = {
    "armid.errors": ("ArmidError", "DataError", "ModelError", "StudyError"),
    "armid.progress": ("set_log_level",),
    "armid.model": (
        "EFFECTS", "PLANTS", "Constant", "Delay", "Effect", "Guard", "Input", "Manoeuvre", "ManoeuvreKey", "Model",
        "Output", "Parameter", "Plant", "Scales", "State",
    ),
    "armid.engine": ("Schedule", "Simulation", "calibrate", "probes"),
    "armid.api": ("close_loop", "examine", "identify", "simulate"),
    "armid.record": ("Campaign", "Record", "read_campaign", "write_campaign"),
    "armid.problem.fitness": ("FITNESS", "Fitness"),
    "armid.problem.meter": ("Meter", "MeterTermination"),
    "armid.problem.problem": ("IdentificationProblem", "replays", "residuals"),
    "armid.problem.similarity": ("numerical_similarity", "similarity"),
    "armid.problem.space": ("Space", "space_of"),
    "armid.identifiers": ("IDENTIFIERS", "Identifier", "PaperPSO", "as_identifier", "identifier_of"),
    "armid.estimation.examine": ("Examination",),
    "armid.estimation.identify": ("Identification",),
    "armid.problem.suite": ("SuiteProblem", "suite"),
    "armid.estimation.information": ("Information", "Profile", "information_at", "sensitivities"),
    "armid.estimation.least_squares": ("estimate", "refine"),
    "armid.problem.simulated": ("SimulatedCampaign",),
    "armid.loop": ("ClosedLoop", "report_of"),
    "armid.registry": ("Registry", "load_registry"),
    "armid.study.results": ("StudyResults", "load_study"),
    "armid.study.runner": ("run_study",),
    "armid.study.tasks": ("Study", "read_study"),
}  # fmt: skip
HOME = {name: module for module, names in WHERE.items() for name in names}
__all__ = sorted(HOME)  # noqa: PLE0605 - the names stand above


def __getattr__(name: str) -> Any:
    if name not in HOME:
        raise AttributeError(f"module 'armid' has no attribute '{name}'")
    return getattr(import_module(HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(HOME)
