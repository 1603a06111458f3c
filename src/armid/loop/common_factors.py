"""Which parameters and constants the records give only together."""

from dataclasses import replace

import numpy as np

from armid.estimation.constants import STEP, common_factors
from armid.inference.candidates import ERROR_OF
from armid.inference.library import Library
from armid.inference.model import Fit, beyond, decomposed
from armid.inference.refit import candidate_at
from armid.inference.whitening import WhiteRecords
from armid.model import Array
from armid.problem.problem import with_each


def known_together(fit: Fit, library: Library) -> tuple[str, ...]:
    """Return in words which parameters of the declared model and constants the records give only together.

    What the free strengths of effects make up for counts as unseen. An effect that a parameter is already comes last.
    """
    doubles = [f"{key.public} would do what {name} does already, and was not looked for"
               for key, name in library.doubles.items()]  # fmt: skip
    own, strengths = {}, [np.zeros(len(fit.residual))]
    for name, value in fit.values.items():
        owner = library.owner(name)
        if owner is None:
            own[name] = slope(fit, fit.records, name, value)
        elif owner.name.startswith(ERROR_OF):
            own[owner.name.removeprefix(ERROR_OF)] = slope(fit, fit.records, name, 1.0 + value)
        else:
            strengths.append(slope(fit, fit.records, name, value))
    pieces = {r.record.file: r.pieces for r in fit.records.replays}
    for key in library.candidates:
        if key.name.startswith(ERROR_OF) and key not in fit.active:
            records = library.problem((*fit.active, key), fit.values)
            there = replace(records, replays=with_each(records.replays, lambda r: replace(
                r, record=replace(r.record, pieces=pieces[r.record.file]))))  # fmt: skip
            own[key.name.removeprefix(ERROR_OF)] = slope(fit, there, f"{key.compiled}.error", 1.0)
    if not own:
        return tuple(doubles)
    basis, _ = decomposed(np.column_stack(strengths))
    products = [replace(p, slope=beyond(basis, p.slope)) for p in fit.products(library.tolerances)]
    return (*common_factors(tuple(own), beyond(basis, np.column_stack([*own.values()])), products), *doubles)


def slope(fit: Fit, records: WhiteRecords, name: str, size: float) -> Array:
    """Return the change of the whitened signal by a parameter, its size taken as 1, about a fit, (n_samples,)."""
    both = np.tile(candidate_at(records, fit.values), (2, 1))
    both[:, records.space.index(name)] += np.array([STEP, -STEP]) * size
    upper, lower = replace(records, data=fit.records.data).whole_signals(both)
    return np.asarray((upper - lower) / (2.0 * STEP))
