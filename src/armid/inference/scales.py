"""The sizes that strengths of effects are expected to have: from the effort of the declared fit, and without a wall."""

from dataclasses import replace

import numpy as np

from armid.engine import along
from armid.estimation.least_squares import held_by_bound, spread_starts
from armid.inference.library import Library
from armid.inference.model import Fit, fit_from
from armid.inference.refit import accurate

# A declared effort within this factor of the largest one at the declared fit stays: a scale is an order of magnitude.
ALIKE = 2.0
# How much wider a range becomes whose end holds a strength, and how often.
WIDER, MOST = 8.0, 4


def declared_fit(library: Library) -> Fit:
    """Return the declared model at its estimate, from starts that are spread over the box."""
    posed = library.problem(())
    starts = spread_starts(posed) if posed.space.free.any() else ()
    return accurate(fit_from(posed, (), starts), library)


def with_scales(library: Library) -> tuple[Library, Fit]:
    """Return the library with the sizes that the declared fit shows, and that fit.

    The drive's column is no effort where it is in volts or a duty and the gain is a free parameter: the scale of effort
    is the largest one of the drive at the declared fit. A strength of the declared model that sits at the end of its
    declared range, which is a multiple of the machine's scales, gets a wider one; a range that the user gave stays.
    """
    fit = declared_fit(library)
    scaled = rescaled(library, fit)
    if scaled is not library:
        library, fit = scaled, declared_fit(scaled)
    for _ in range(MOST):
        held = set(np.array(list(fit.values))[held_by_bound(fit.records.space, fit.x)].tolist())
        own = {n for n in held & library.scaled_strengths if library.owner(n) is None
               and abs(fit.values[n]) > 0.0}  # fmt: skip
        if not own:
            break
        space = fit.records.space
        wider = {n: (WIDER * float(space.low[space.index(n)]), WIDER * float(space.high[space.index(n)])) for n in own}
        library = replace(library, widened={**library.widened, **wider}, _problems={})
        fit = declared_fit(library)
    return library, fit


def rescaled(library: Library, declared: Fit) -> Library:
    """Return the library with the effort scale of the declared fit, where the plant takes its scales from records."""
    plant, model = library.declared.plant, declared.model
    if not plant.scales_from_records or "drive_effort" not in plant.quantities:
        return library
    largest = 0.0
    for replay in declared.records.replays:
        for piece, calibration in zip(replay.pieces, replay.calibrations, strict=True):
            effort = along(model, piece.manoeuvre, declared.candidate, calibration.schedule, ["drive_effort"])
            largest = max(largest, float(np.nanmax(np.abs(effort["drive_effort"]), initial=0.0)))
    if not np.isfinite(largest) or largest <= 0.0 or 1.0 / ALIKE < largest / plant.scales.effort < ALIKE:
        return library
    scaled = replace(plant, scales=replace(plant.scales, effort=largest))
    own = {n: (p.low, p.high) for n, p in library.declared.parameters.items()
           if p.fixed is None and "." not in n and n not in {*library.overrides, *library.fixed}}  # fmt: skip
    return replace(library, declared=replace(library.declared, plant=scaled), bounds={**own, **library.bounds},
                   _models={}, _problems={})  # fmt: skip
