"""Who searches: the paper's swarm and others, each an algorithm of pymoo.

In reading order:
identifier         what an identifier is, and what an option of it is: a typed field
search             what a search is: a function that asks for the fitness of candidates; and how pymoo runs it
pso                the paper's swarm
evolutionary       pymoo's own swarm, genetic algorithm and differential evolution; CMA-ES (IPOP, BIPOP); random search
local              local searches: the trust region of scipy on the residual vector, and those of NLopt
own                algorithms of other libraries, and how a user's own becomes an identifier
catalogue          identifiers by name; composed ones: one after another, and multistart
"""

from armid.identifiers.catalogue import IDENTIFIERS, identifier_of, options_of
from armid.identifiers.identifier import Identifier
from armid.identifiers.own import as_identifier
from armid.identifiers.pso import PaperPSO
from armid.identifiers.search import SearchAlgorithm, run

__all__ = [
    "IDENTIFIERS", "Identifier", "PaperPSO", "SearchAlgorithm", "as_identifier", "identifier_of", "options_of", "run",
]  # fmt: skip
