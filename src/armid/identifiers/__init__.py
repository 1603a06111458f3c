"""Who searches: the paper's swarm and others, each an algorithm of pymoo.

In reading order:
identifier         what an identifier is, and checks of its options
catalogue          identifiers by name, the composed ones too
pso                the paper's swarm
evolutionary       pymoo's own swarm, genetic algorithm and differential evolution; CMA-ES (IPOP, BIPOP); random search
nlopt              the local searches of NLopt
least_squares      the trust region of scipy on the residual vector, and derivatives by differences
foreign            identifiers of other libraries, each a function that searches by itself
chain              identifiers one after another, and multistart
search             what a search is: it asks for candidates and is told their fitness; threads, starts, failures
own                how a user's own becomes an identifier
pymoo_adapter      a search as an algorithm of pymoo, an algorithm of pymoo as a search, and a run without pymoo's loop
"""

from armid.identifiers.catalogue import IDENTIFIERS, identifier_of, options_of
from armid.identifiers.identifier import Identifier
from armid.identifiers.own import as_identifier
from armid.identifiers.pso import PaperPSO
from armid.identifiers.pymoo_adapter import SearchAlgorithm, can_run_directly, run_directly

__all__ = [
    "IDENTIFIERS", "Identifier", "PaperPSO", "SearchAlgorithm", "as_identifier", "can_run_directly", "identifier_of",
    "options_of", "run_directly",
]  # fmt: skip
