"""What each figure shows and how its marks were computed."""

SUCCESS = (
    "Share of the runs in which the relative errors of all parameters are within 1 %, 0.1 % and 0.01 % at the end, "
    "with 95 % Wilson intervals; the most successful identifier on top. A failed run is no success."
)
ECDF = (
    "Share of all pairs of a run and a target that are hit within so many simulations. The 51 targets are largest "
    "relative errors of the parameters, evenly spread in their logarithm from 100 % to 1e-8 %; a target is hit when "
    "the best candidate so far (by fitness) is first that near to the truth. Names stand in the order in which the "
    "lines end; a run that stops early stays where it ended."
)
RUNNING_TIME = (
    "Simulations that one success costs on average when a method is started again until it has one: those of all runs "
    "until the target is first hit (all that were used where it is not), divided by the number of runs that hit. A "
    "line ends at the strictest target that any run hit; names are listed from the strictest one on."
)
FIXED_TARGET = (
    "The same with targets of the fitness: what is left of the way from a first candidate (median over all runs on "
    "the case) to the best fitness that anyone found on the same case, noise and seed."
)
DATA_PROFILE = (
    "Share of the problems (a case with its noise and seed) that are solved within so many simplex gradients, that is "
    "simulations divided by one more than the number of free parameters. Solved: no more than the share in the title "
    "is left of the way from a first candidate to the best fitness that anyone found (More and Wild 2009). Each "
    "fitness is compared with its own kind only."
)
CONVERGENCE_ERROR = (
    "Largest relative error of the best candidate so far against simulations, over all cases and seeds: median as a "
    "line, quartiles as a band, a colour a noise level. The error may rise, since the fitness decides what is best. "
    "Pale: the smallest median of all identifiers. Errors below 1e-6 % are drawn there; a run that stops early keeps "
    "its value."
)
CONVERGENCE_FITNESS = (
    "Smallest value of the fitness {fitness} so far (of a similarity: 1 minus its degree) against simulations, over "
    "all cases and seeds: median as a line, quartiles as a band, a colour a noise level. Pale: the smallest median of "
    "all identifiers."
)
ERROR_MAP = (
    "Largest relative error of a run [%], median over the seeds, by identifier and case, one map a noise level, "
    "the best identifier (over all) on top. The colours are logarithmic from 1e-6 % to 100 %."
)
VALLEY = (
    "Deviation (value - truth)/truth [%] of the results of all finished runs in each pair of parameters, one mark a "
    "run; counts on the diagonal. Where marks lie along a line, parameters stand in for each other. Of more than 600 "
    "runs of one identifier every n-th is drawn."
)
CRITICAL_DIFFERENCE = (
    "Mean ranks over the cases. A bar joins identifiers of which no pair differs significantly at 5 % (Wilcoxon "
    "signed-rank, Holm)."
)
RANKS = "How sure is it that one identifier is better than another on cases like these?"
