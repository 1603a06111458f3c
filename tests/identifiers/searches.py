"""What the tests of searches share: problems of known answer, and a run of an identifier on one."""

import numpy as np
from pymoo.core.problem import Problem
from pymoo.optimize import minimize

from armid.identifiers import IDENTIFIERS, identifier_of

COMPOSED = (
    "pso+bobyqa", "de+nelder_mead", "pso+least_squares", "cmaes+least_squares", "multistart:bobyqa",
    "multistart:least_squares", "random+multistart:slsqp", "ga+cobyla+sbplx",
)  # fmt: skip


class Bowl(Problem):
    """A tilted bowl of linear residuals r = A z - b, z in the unit cube of a box of very different units.

    Its least squares solution within the box is known from linear algebra. A batch that was asked for is kept.
    """

    A = np.array([[2.0, 1.0, 0.0], [0.5, -1.0, 3.0], [1.0, 1.0, 1.0], [0.0, 2.0, -1.0]])

    def __init__(self, b=(1.2, 1.1, 1.6, 0.3), fail_above=np.inf):
        low, high = np.array([2.0e6, 0.5, -1.0]), np.array([3.0e6, 1.5, 1.0])
        super().__init__(n_var=3, n_obj=1, xl=low, xu=high)
        self.b, self.fail_above = np.array(b), fail_above
        self.batches = []

    def unit(self, X):
        return np.asarray((X - self.xl) / (self.xu - self.xl))

    def _evaluate(self, X, out, *_, **__):
        self.batches.append(X.copy())
        r = self.unit(X) @ self.A.T - self.b
        failed = self.unit(X)[:, 0] > self.fail_above
        out["F"] = np.where(failed, np.nan, (r**2).sum(axis=1))
        if "residuals" in out:
            out["residuals"] = r


def identifier(name, **options):
    return identifier_of(name, IDENTIFIERS).with_options(options)


def asked_of(problem):
    """All that was asked for and its height."""
    asked = np.concatenate(problem.batches)
    return asked, np.asarray(((problem.unit(asked) @ problem.A.T - problem.b) ** 2).sum(axis=1))


def ran(name, problem, budget=300, seed=1, **options):
    algorithm = identifier(name, **options).build(budget)
    return minimize(problem, algorithm, ("n_eval", budget), seed=seed, copy_algorithm=False)
