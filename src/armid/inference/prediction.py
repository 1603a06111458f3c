"""What models predict of parts that are left out of their fit: which of them is put in force where none is right.

Where the best model leaves more than noise, evidence compares models that are all wrong, and effects that bend to what
is missing win on the records that they saw. There the model in force is the one that predicts parts left out of its fit
(Stone 1974, doi:10.1111/j.2517-6161.1974.tb00994.x), with the fewest effects within one standard error of the best
(Breiman and others 1984).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armid.estimation.least_squares import descend
from armid.inference.hypothesis import Hypotheses
from armid.inference.library import Library
from armid.inference.model import ROUGHLY, Fit
from armid.inference.whitening import WhitenedData
from armid.model import Array

# Parts that are left out in turn; models of each number of effects that are compared.
MOST_PARTS, MOST_OF_SIZE = 5, 3


def parts_of(data: WhitenedData) -> list[NDArray[np.int64]]:
    """Return what is left out in turn, as numbers of samples: manoeuvres with their repeats, or blocks of time."""
    names = [r.manoeuvre_file for r in data.each]
    each = data.by_record(np.arange(data.edges[-1]))
    distinct = list(dict.fromkeys(names))
    if len(distinct) > 1:
        # of many manoeuvres several are left out together, spread over the campaign
        groups = [distinct[i::MOST_PARTS] for i in range(min(MOST_PARTS, len(distinct)))]
        return [np.concatenate([x for x, n in zip(each, names, strict=True) if n in group]) for group in groups]
    blocks = [np.array_split(x, MOST_PARTS) for x in each]
    return [np.concatenate(block) for block in zip(*blocks, strict=True)]


def misses(fit: Fit) -> Array:
    """Return the mean square by which a model misses each part, fitted without it, (n_parts,)."""
    data, found = fit.records.data, []
    for part in parts_of(data):
        sound = data.sound.copy()
        sound[part] = 0.0
        posed = replace(fit.records, data=replace(data, sound=sound))
        z = descend(posed, [fit.z], ROUGHLY) if fit.n_free else fit.z
        left = fit.records.plain.residuals(z)[0][part]
        found.append(float(np.mean(left**2)) if np.isfinite(left).all() else np.inf)
    return np.array(found)


def predicting_best(
    ranked: Sequence[Hypotheses], fits: dict[Hypotheses, Fit], library: Library
) -> Hypotheses:  # fmt: skip
    """Return the model with the fewest effects that predicts as the best does, within one standard error.

    ranked: models without an unknown signal, the most probable first.
    """
    sizes: dict[int, list[Hypotheses]] = {}
    for model in ranked:
        of_size = sizes.setdefault(len(model), [])
        if len(of_size) < MOST_OF_SIZE:
            of_size.append(model)
    compared = [m for n in sorted(sizes) for m in sizes[n]]
    library.say(f"comparing what {len(compared)} models predict of parts left out of their fit")
    missed = library.each(lambda m: misses(fits[m]), compared)
    best = missed[int(np.argmin([np.mean(x) for x in missed]))]

    def is_near(own: Array) -> bool:
        apart = own - best
        return bool(np.mean(apart) <= np.std(apart, ddof=1) / np.sqrt(len(apart)))

    near = [(len(m), float(np.mean(x)), i) for i, (m, x) in enumerate(zip(compared, missed, strict=True)) if is_near(x)]
    return compared[min(near)[2]]
