"""Where the library ends: the signal that a model lacks, recovered at each port without a form."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.dependence import Dependence, Motion, dependences, motions
from armid.discrepancy.evidence import WhiteRecords
from armid.discrepancy.fit import Fit
from armid.discrepancy.library import Library, idle
from armid.discrepancy.stretch import PROBE, Stretch, stretches
from armid.discrepancy.unknown_input import MissingSignal, missing_signal

Array = NDArray[np.float64]
# A signal without a form is sought at so many knots in all: its cost grows with their square.
MOST_KNOTS = 600


@dataclass(frozen=True, eq=False)
class Missing:
    """Hold what is known of the signal that a model lacks.

    lacking: the model. signals: what would have to be added at each port, the port that removes most of the residual
    first. moved: the motion to which they belong. dependences: curves over one variable, the one that predicts left-out
    records best first.
    """

    lacking: Fit
    moved: tuple[Motion, ...]
    signals: tuple[MissingSignal, ...]
    dependences: tuple[Dependence, ...]

    def signal_at(self, port: str) -> MissingSignal | None:
        """Return the signal at a port, None where no signal there moves the output."""
        return next((s for s in self.signals if s.port == port), None)


def missing_from(lacking: Fit, library: Library) -> Missing:
    """Recover the missing signal at every port of a fitted model, and on what it depends there.

    library: with the test signals (see `with_terms`). Each port costs a simulation for every knot of every piece.
    """
    records, x = posed_in(library, lacking, ())
    model, levels = records.replays[0].model, [level.rms for level in records.evidence.levels]
    ports = [p for p in model.plant.ports if f"{PROBE}{p}" in library.candidates]
    whole = stretches(model, records.space, x, records.replays, levels, ports)
    shown = spread(whole)
    moved = motions(model, records.space.complete(x[np.newaxis])[0], whole)
    signals = sorted((missing_signal(shown, port) for port in whole[0].gains), key=lambda s: -s.share)
    kept = tuple(m for m in moved if any(m.stretch is s for s in shown))
    return Missing(lacking, kept, tuple(signals), tuple(dependences(moved)))


def posed_in(library: Library, lacking: Fit, added: tuple[str, ...]) -> tuple[WhiteRecords, Array]:
    """Return the problem of a fit, with effects added at rest, in another library, and its free parameters, SI."""
    records = library.problem((*lacking.active, *added), lacking.values)
    declared = records.replays[0].model.parameters
    free = records.space.free_names
    return records, np.array([lacking.values[n] if n in lacking.values else idle(declared[n]) for n in free])


def spread(whole: Sequence[Stretch]) -> list[Stretch]:
    """Return pieces spread evenly over all, as many as the knots allow."""
    most = max(1, int(MOST_KNOTS / np.mean([len(s.knots) for s in whole])))
    places = np.unique(np.linspace(0, len(whole) - 1, min(most, len(whole))).astype(int))
    return [whole[i] for i in places]
