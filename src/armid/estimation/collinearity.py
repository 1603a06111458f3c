"""Parameters that move together: groups whose changes the others of the group make up for."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from armid.estimation.information import SINGULAR

Array = NDArray[np.float64]
Members = tuple[int, ...]
# From here on a group is reported; Brun et al. call indices above 10 to 15 poorly identifiable.
CRITICAL = 10.0
# A group explains the collinearity of a larger set when its index comes to this share of the set's.
EXPLAINS = 0.5
# Above this number of parameters only groups of up to so many members are tried, or all of them.
MOST_TRIED, LARGEST_TRIED = 12, 4


@dataclass(frozen=True, eq=False)
class Group:
    """Hold parameters that the records cannot tell apart.

    names: in the order of the model. index: collinearity index; a change of one is made up for by the others to within
    1/index. direction: how they move together, as shares of their ranges, shape (n_names,), its largest component 1.
    """

    names: tuple[str, ...]
    index: float
    direction: Array


def groups(fisher: Array, names: tuple[str, ...], critical: float = CRITICAL) -> tuple[Group, ...]:
    """Return the groups of parameters that move together, the worst first.

    The smallest set whose index comes to half of that of all parameters is the first group; then the member that does
    most harm is taken as known, and the rest is looked at again, until its index is below `critical`.
    fisher: of the parameters in shares of their range, shape (n_free, n_free); a parameter that is not seen at all has
    a zero row and is in no group.
    """
    scaled, seen = normalised(fisher)
    visible = tuple(n for n, s in zip(names, seen, strict=True) if s)
    scale = np.sqrt(np.diag(fisher)[seen])
    left, found = tuple(range(len(visible))), []
    while (index := index_of(scaled, left)) >= critical:
        members = smallest(scaled, left, max(critical, EXPLAINS * index))
        _, vectors = np.linalg.eigh(scaled[np.ix_(members, members)])
        moves = vectors[:, 0] / scale[list(members)]
        moves = moves / moves[int(np.argmax(np.abs(moves)))]
        found.append(Group(tuple(visible[i] for i in members), index_of(scaled, members), moves))
        left = min((tuple(i for i in left if i != m) for m in members), key=lambda rest: index_of(scaled, rest))
    return tuple(found)


def collinearity_index(fisher: Array) -> float:
    """Return 1/sqrt(smallest eigenvalue) of the information matrix scaled to a diagonal of 1.

    1 for parameters whose sensitivities are orthogonal, 3e6 (rounding) where one repeats others.
    fisher: shape (n, n). Source: Brun, Reichert, Kuensch 2001, doi:10.1029/2000WR900350, Eq 14.
    """
    scaled, _ = normalised(fisher)
    if len(scaled) < 2:
        return 1.0
    return float(1.0 / np.sqrt(max(float(np.linalg.eigvalsh(scaled)[0]), SINGULAR)))


def normalised(fisher: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the information matrix of the parameters that are seen, its diagonal scaled to 1, and which they are."""
    scale = np.sqrt(np.maximum(np.diag(fisher), 0.0))
    seen = np.isfinite(scale) & (scale > 0.0)
    return np.asarray(fisher[np.ix_(seen, seen)] / np.outer(scale[seen], scale[seen])), seen


def index_of(scaled: Array, members: Members) -> float:
    return collinearity_index(scaled[np.ix_(members, members)])


def smallest(scaled: Array, among: Members, index: float) -> Members:
    """Return the smallest set, and of its size the worst, that comes to an index; all where none smaller does."""
    for size in range(2, (len(among) if len(among) <= MOST_TRIED else LARGEST_TRIED) + 1):
        worst = max(combinations(among, size), key=lambda members: index_of(scaled, members))
        if index_of(scaled, worst) >= index or size == len(among):
            return worst
    return among
