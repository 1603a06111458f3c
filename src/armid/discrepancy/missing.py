"""Where the library ends: the signal that a model lacks, recovered at each port without a form."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armid.discrepancy.dependence import Dependence, Motion, dependences, motions
from armid.discrepancy.evidence import WhiteRecords
from armid.discrepancy.fit import Fit
from armid.discrepancy.library import Library
from armid.discrepancy.names import base
from armid.discrepancy.stretch import Stretch, stretches
from armid.discrepancy.unknown_input import MissingSignal, missing_signal

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

    Each port costs a simulation for every knot of every piece.
    """
    records = narrow(lacking, library)
    model, levels = records.replays[0].model, [level.rms for level in records.evidence.levels]
    whole = stretches(model, records.space, lacking.x, records.replays, levels, list(model.plant.ports))
    shown = spread(whole)
    moved = motions(model, records.space.complete(lacking.x[np.newaxis])[0], whole)
    signals = sorted((missing_signal(shown, port) for port in whole[0].gains), key=lambda s: -s.share)
    kept = tuple(m for m in moved if any(m.stretch is s for s in shown))
    return Missing(lacking, kept, tuple(signals), tuple(dependences(moved)))


def narrow(lacking: Fit, library: Library) -> WhiteRecords:
    """Return the problem of a fit for a model that holds its effects and no other candidates: quicker to compile."""
    names = [n.partition(".")[0] for n in lacking.records.space.names]
    keys = sorted({base(n) for n in lacking.active}, key=lambda k: names.index(k) if k in names else -1)
    model = library.composed(keys)
    ready = tuple(replace(r, model=model) for r in lacking.records.replays)
    return replace(lacking.records, replays=ready, space=lacking.records.space.only(tuple(model.parameters)))


def spread(whole: Sequence[Stretch]) -> list[Stretch]:
    """Return pieces spread evenly over all, as many as the knots allow."""
    most = max(1, int(MOST_KNOTS / np.mean([len(s.knots) for s in whole])))
    places = np.unique(np.linspace(0, len(whole) - 1, min(most, len(whole))).astype(int))
    return [whole[i] for i in places]
