"""The identifier `my_identifier`: a method that finds parameters, made of any algorithm of pymoo.

    armid check my_identifier.py:my_identifier
    armid identify CAMPAIGN --plugin my_identifier.py:my_identifier --identifier my_identifier
    armid identify CAMPAIGN --plugin my_identifier.py:my_identifier --identifier my_identifier+bobyqa --fitness rmse

The last is a chain: what my_identifier has found is refined by a local method.
"""

from pymoo.algorithms.soo.nonconvex.de import DE


# `budget` is the number of simulations. armid counts them and ends the search exactly there, keeps the best candidate,
# and gives a simulation that failed a finite penalty, so that an algorithm needs no termination of its own. All that is
# random has to be drawn from the algorithm's random_state, or the same seed would not give the same result.
# A subclass of pymoo's Algorithm that needs no arguments can stand here in place of a function.
def my_identifier(budget):
    """Return differential evolution whose population grows with the budget."""
    return DE(pop_size=max(10, min(40, budget // 50)), variant="DE/rand/1/bin", CR=0.9)
