"""Who searches: the paper's swarm and others, each an algorithm of pymoo."""

from armid.identifiers.catalogue import IDENTIFIERS, Identifier, as_identifier
from armid.identifiers.pso import PaperPSO

__all__ = ["IDENTIFIERS", "Identifier", "PaperPSO", "as_identifier"]
