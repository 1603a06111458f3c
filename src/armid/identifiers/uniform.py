"""Random search: what every other identifier has to beat."""

from dataclasses import dataclass

from armid.identifiers.options import checked_population
from armid.identifiers.search import Ask, Method, Search, Task


@dataclass(frozen=True)
class UniformOptions:
    """Hold the options of random search. n_candidates: drawn at a time."""

    n_candidates: int = 80

    def __post_init__(self) -> None:
        checked_population("n_candidates", self.n_candidates)


def uniform_method(options: UniformOptions) -> Method:
    """Return the search that draws candidates uniformly from the box and learns nothing."""

    def method(task: Task) -> Search:
        cube = task.cube
        while True:
            yield Ask(cube.candidates(task.random.random((options.n_candidates, cube.n))))

    return method
