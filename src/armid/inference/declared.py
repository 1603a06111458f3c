"""The declared model: its fit, the scales that it shows, and the shapes and forms that its effects take by default."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from armid.engine import along
from armid.estimation.least_squares import descend, held_by_bound, spread_starts
from armid.inference.candidates import bundled
from armid.inference.kinds import effects
from armid.inference.library import Library
from armid.inference.model import (
    ROUGHLY,
    Fit,
    accurate,
    finished,
    fit_from,
    problem_about,
    starts_of_shapes,
    unless_diverged,
)
from armid.inference.unknowns import freed
from armid.inference.whitening import WhiteRecords
from armid.model import Array, Model, refusal_of

# A declared effort within this factor of the largest one at the declared fit stays: a scale is an order of magnitude.
SAME_ORDER = 2.0
# How often a range becomes wider whose end holds a parameter.
MOST_WIDENED = 4
# Shares of each record to which a first estimate is carried on.
GROWING = (0.125, 0.25, 0.5, 0.75)


def declared_fit(library: Library) -> Fit:
    """Return the declared model at its estimate, from starts over the box and one that grew with the records."""
    problem = library.problem(())
    starts = [*spread_starts(problem), grown_start(problem)] if problem.space.free.any() else ()
    return accurate(fit_from(problem, (), starts), library)


def declared_again(library: Library, declared: Fit) -> Fit:
    """Return the declared model fitted to other data of the same records."""
    return accurate(fit_from(library.problem(()), (), [declared.z]), library)


def grown_start(problem: WhiteRecords) -> Array:
    """Return the estimate of the beginning of each record, carried on to ever longer parts, as shares of the range.

    A motion that may go over the top has many minima over a long time, and few at its beginning.
    """
    first, *longer = map(problem.beginning, GROWING)
    z = descend(first, spread_starts(first), ROUGHLY)
    for part in longer:
        z = descend(part, [z], ROUGHLY)
    return z


def with_scales(library: Library) -> tuple[Library, Fit]:
    """Return the library with the sizes that the declared fit shows, and that fit.

    The drive's column is in volts or a duty where the gain is a free parameter: the scale of effort is the largest
    effort of the drive at the declared fit. A parameter of the declared model that sits at the end of its
    declared range, which is a multiple of the machine's scales, gets a wider one; a range that the user gave stays.
    """
    of_machine = library.scaled_strengths | library.scaled_by_plant
    fit = declared_fit(library)
    scaled = rescaled(library, fit)
    if scaled is not library:
        library, fit = scaled, declared_fit(scaled)
    for _ in range(MOST_WIDENED):
        held = set(np.array(list(fit.values))[held_by_bound(fit.records.space, fit.x)].tolist())
        own = {n for n in held & of_machine if library.owner(n) is None and abs(fit.values[n]) > 0.0}
        if not own:
            break
        space = fit.records.space.with_wider(own)
        wider = {n: (float(space.low[space.index(n)]), float(space.high[space.index(n)])) for n in own}
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
        for piece, schedule in zip(replay.pieces, (c.schedule for c in replay.calibrations), strict=True):
            effort = along(model, piece.manoeuvre, declared.candidate, schedule, ["drive_effort"])
            largest = max(largest, float(np.nanmax(np.abs(effort["drive_effort"]), initial=0.0)))
    if not np.isfinite(largest) or largest <= 0.0 or 1.0 / SAME_ORDER < largest / plant.scales.effort < SAME_ORDER:
        return library
    scaled = replace(plant, scales=replace(plant.scales, effort=largest))
    own = {n: (p.low, p.high) for n, p in library.declared.parameters.items()
           if p.fixed is None and "." not in n and n not in {*library.overrides, *library.fixed}}  # fmt: skip
    return replace(library, declared=replace(library.declared, plant=scaled), bounds={**own, **library.bounds},
                   _models={}, _problems={})  # fmt: skip


def with_fitting_shapes(library: Library, declared: Fit) -> tuple[Library, Fit]:
    """Return the library with the shapes of the declared model's effects free where the records deny those it fixes.

    A user knows little of the width over which a sign is smoothed; what a wrong one leaves looks like an effect.
    """
    if not library.own_shapes:
        return library, declared
    free = replace(library, own_shapes_free=True, _problems={})

    def fitted() -> Fit:
        problem = problem_about(declared, (), free)
        return finished(fit_from(problem, (), starts_of_shapes(declared, problem, free.own_shapes), rough=True), free)

    wide = unless_diverged(fitted)
    return (library, declared) if wide is None or schwarz(wide) <= schwarz(declared) else (free, wide)


def with_fitting_forms(library: Library, declared: Fit) -> tuple[Library, Fit]:
    """Return the library with the declared effects in those of their forms, and their shapes, that records ask for."""
    library, declared = with_fitting_shapes(library, declared)

    def alone(library: Library) -> Fit:
        return with_fitting_shapes(*with_scales(library))[1]

    while (form := likelier_form(library, schwarz(declared), alone)) is not None:
        library, declared = with_fitting_shapes(*with_scales(in_form(library, form)))
    return library, declared


def likelier_form(library: Library, least: float, fitted: Callable[[Library], Fit | None]) -> Model | None:
    """Return the declared model with one of its effects in the likeliest other form, None where none is likelier.

    least: how probable the records are as it is, see `schwarz`; another form is charged as a parameter is. fitted:
    returns a fit with a library of that form, which compiles nothing that the fit does not need.
    """
    found = None
    for form in other_forms(library):
        fit = unless_diverged(partial(fitted, replace(in_form(library, form), bundles=())))
        if fit is not None and schwarz(fit, more=1) > least:
            least, found = schwarz(fit, more=1), form
    return found


def in_form(library: Library, form: Model) -> Library:
    """Return the library with a declared model that has its effects in other forms."""
    return replace(library, declared=form, bundles=bundled(form, library.candidates), own_shapes_free=False,
                   _models={}, _problems={}, _schedules={})  # fmt: skip


def in_other_form(fit: Fit, library: Library, weight: float) -> Fit | None:
    """Return a model with a declared effect in another form and its shapes free, fitted from how it stands in a fit."""
    problem = effects.records_with(fit, fit.active, library)
    starts = starts_of_shapes(fit, problem, library.own_shapes)
    again = effects.fitted(fit, problem, fit.active, starts, library, weight)
    if again is None or not again.others:
        return again and accurate(again, library)
    return freed(again, again.base or again.records, [f.unknown for f in again.others], weight)


def other_forms(library: Library) -> Iterator[Model]:
    """Yield the declared model with each of its effects in each other form, if the user gave the effect no word.

    A user who declares friction knows that it is there, and seldom its form. What the user bounds or fixes the other
    form has to have.
    """
    model, given = library.declared, {*library.bounds, *library.fixed}
    for now, first in zip(model.effects, library.as_declared.effects, strict=True):
        wanted = {name for name in given if name.startswith(f"{now.name}.")}
        for form in first.searched_forms if first.forms else ():
            has_all = wanted <= {f"{form.name}.{p.name}" for p in form.parameters}
            if form is not now and has_all and not refusal_of(form, model.plant):
                yield replace(model, effects=tuple(form if e is now else e for e in model.effects))


def schwarz(fit: Fit, more: int = 0) -> float:
    """Return how probable the records are by a fit, its parameters and some more charged.

    Schwarz 1978, doi:10.1214/aos/1176344136.
    """
    return fit.log_density - 0.5 * (fit.n_free + more) * float(np.log(len(fit.residual)))
