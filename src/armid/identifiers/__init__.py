"""Who searches: the paper's swarm and others, each an algorithm of pymoo."""

from armid.identifiers.adapter import Searching, can_run_alone, run_alone
from armid.identifiers.catalogue import IDENTIFIERS, identifier_of
from armid.identifiers.identifier import Identifier, as_identifier
from armid.identifiers.pso import PaperPSO

__all__ = [
    "IDENTIFIERS", "Identifier", "PaperPSO", "Searching", "as_identifier", "can_run_alone", "identifier_of",
    "run_alone",
]  # fmt: skip
