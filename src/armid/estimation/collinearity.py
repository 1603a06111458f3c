"""Parameters that move together: groups whose changes the others of the group make up for."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from armid.estimation.information import SINGULAR

Array = NDArray[np.float64]
# From here on a group is told of; Brun et al. call indices above 10 to 15 poorly identifiable.
CRITICAL = 10.0
# A group explains the collinearity of a larger set when its index comes to this share of the set's.
EXPLAINS = 0.5
# Above this number of parameters only groups of up to so many members are tried, or all of them.
MOST_TRIED, LARGEST_TRIED = 12, 4


@dataclass(frozen=True)
class Group:
    """Hold parameters that the records cannot tell apart.

    names: in the order of the model. index: collinearity index; a change of one is made up for by the others to within
    1/index. direction: how they move together, as shares of their ranges, shape (n_names,), its largest component 1.
    """

    names: tuple[str, ...]
    index: float
    direction: Array


def normalised(fisher: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the information matrix of the parameters that are seen, its diagonal scaled to 1, and which they are."""
    scale = np.sqrt(np.maximum(np.diag(fisher), 0.0))
    seen = np.isfinite(scale) & (scale > 0.0)
    return np.asarray(fisher[np.ix_(seen, seen)] / np.outer(scale[seen], scale[seen])), seen


def collinearity_index(fisher: Array) -> float:
    """Return 1/sqrt(smallest eigenvalue) of the information matrix scaled to a diagonal of 1.

    1 for parameters whose sensitivities are orthogonal, 3e6 (rounding) where one repeats others.
    fisher: shape (n, n). Source: Brun, Reichert, Kuensch 2001, doi:10.1029/2000WR900350, Eq 14.
    """
    scaled, _ = normalised(fisher)
    if len(scaled) < 2:
        return 1.0
    return float(1.0 / np.sqrt(max(float(np.linalg.eigvalsh(scaled)[0]), SINGULAR)))


def groups(fisher: Array, names: tuple[str, ...], critical: float = CRITICAL) -> tuple[Group, ...]:
    """Return the groups of parameters that move together, the worst first.

    The smallest set whose index comes to half of that of all parameters is the first group; then the member that does
    most harm is taken as known, and the rest is looked at again, until its index is below `critical`.
    fisher: of the parameters in shares of their range, shape (n_free, n_free); a parameter that is not seen at all has
    a zero row and is in no group.
    """
    scaled, seen = normalised(fisher)
    told = tuple(n for n, s in zip(names, seen, strict=True) if s)
    scale = np.sqrt(np.diag(fisher)[seen])
    left, found = tuple(range(len(told))), []
    while (index := index_of(scaled, left)) >= critical:
        members = smallest(scaled, left, max(critical, EXPLAINS * index))
        found.append(group_of(scaled, scale, told, members))
        freed = [tuple(i for i in left if i != member) for member in members]
        left = min(freed, key=lambda rest: index_of(scaled, rest))
    return tuple(found)


def index_of(scaled: Array, members: tuple[int, ...]) -> float:
    """Return the collinearity index of some of the parameters."""
    return collinearity_index(scaled[np.ix_(members, members)])


def smallest(scaled: Array, among: tuple[int, ...], index: float) -> tuple[int, ...]:
    """Return the smallest set, and of its size the worst, that comes to an index; all where none smaller does."""
    for size, sets in by_size(among):
        worst = max(sets, key=lambda members: index_of(scaled, members))
        if index_of(scaled, worst) >= index or size == len(among):
            return worst
    return among


def by_size(among: tuple[int, ...]) -> Iterator[tuple[int, list[tuple[int, ...]]]]:
    """Yield the sets of 2, 3, ... members."""
    largest = len(among) if len(among) <= MOST_TRIED else LARGEST_TRIED
    for size in range(2, largest + 1):
        yield size, list(combinations(among, size))


def group_of(scaled: Array, scale: Array, names: tuple[str, ...], members: tuple[int, ...]) -> Group:
    """Return a group with its index and its direction."""
    some = list(members)
    _, vectors = np.linalg.eigh(scaled[np.ix_(some, some)])
    moves = vectors[:, 0] / scale[some]
    moves = moves / moves[int(np.argmax(np.abs(moves)))]
    return Group(tuple(names[i] for i in some), index_of(scaled, members), moves)
