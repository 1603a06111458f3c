"""The record to make next: the manoeuvre that tells the most probable models apart."""

from collections.abc import Callable

import numpy as np

from armid.estimation.advice import Advice, Rival, advise
from armid.estimation.design import manoeuvre_grid
from armid.inference.decisions import WINDOW
from armid.inference.hypothesis import words
from armid.inference.infer import Inference
from armid.model import Array

# Manoeuvres that are listed, and models that one has to tell apart.
MOST_ADVICE, MOST_RIVALS = 5, 3


def advice_on(
    inference: Inference, speed_limit: float | None, threads: int, say: Callable[[str], None]
) -> tuple[Advice, ...]:  # fmt: skip
    """Return the manoeuvres that would tell the most probable models apart, best first; none where one stands alone."""
    rivals = rivals_of(inference)
    if len(rivals) < 2:
        return ()
    say(f"looking for a manoeuvre that tells {' and '.join(r.name for r in rivals)} apart")
    best = inference.exploration.fits[inference.in_force]
    replays, levels = best.records.replays, best.records.data.levels
    # of each output the first level, in the order in which `Motions.signals` gives them
    known = dict(sorted(((r.place, level) for r, level in reversed([*zip(replays, levels, strict=True)])),
                        key=lambda pair: pair[0]))  # fmt: skip

    def white(signals: Array) -> Array:
        pairs = zip(known.values(), signals, strict=True)
        weight = float(np.sqrt(rivals[0].trust))
        return weight * np.concatenate([level.white(y, [y.shape[-1]]) for level, y in pairs], axis=-1)

    library = inference.exploration.library
    grid = manoeuvre_grid(best.model, library.data.records)
    return advise(rivals, white, grid, speed_limit, threads=threads)[:MOST_ADVICE]


def rivals_of(inference: Inference) -> list[Rival]:
    """Return the most probable models without faults of records whose effects differ, one for each set of names."""
    ranked = [(m, p) for m, p in inference.exploration.ranked() if all(h.kind == "effect" for h in m)]
    rivals: dict[str, Rival] = {}
    for model, p in ranked:
        name = words(model)
        if ranked[0][1] - p > WINDOW or len(rivals) == MOST_RIVALS:
            break
        fit = inference.exploration.fits[model]
        # What a sample counts, and one of a record like these will: less than 1 where more than noise is left.
        trust = float(np.mean(fit.records.data.trust(fit.residual)))
        rivals.setdefault(name, Rival(name, fit.records, fit.z, -2.0 * p, trust, fit.constants))
    return list(rivals.values())
