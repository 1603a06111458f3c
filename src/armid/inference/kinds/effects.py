"""Effects of the library that may be missing: each form on a grid of its shapes, its strength from weak to strong."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from armid.engine import Schedule
from armid.estimation.least_squares import descend
from armid.inference.candidates import EffectKey
from armid.inference.checks import square_along, train_residuals
from armid.inference.decisions import OUT_OF_TOLERANCE, PERIODS, calibration
from armid.inference.evidence import SCALES_OF_STRENGTH, Expansion, Forecast
from armid.inference.kinds.hypothesis import Hypothesis, Proposal
from armid.inference.library import OF_WAVES, Activation, Library, activation_grid
from armid.inference.model import (
    ROUGHLY,
    Fit,
    beyond,
    fit_from,
    free_values,
    problem_about,
    responses,
    start_of,
    unless_diverged,
)
from armid.inference.unknowns import freed, moved, projected
from armid.inference.whitening import WhiteRecords
from armid.model import Array
from armid.problem.problem import ReadyRecord, by_record, with_each

# Shares of the range over which a strength is tried: a slope, and two secants where the response is not linear.
SLOPE = 1e-3
SHARES_TRIED = (SLOPE, 0.05, 0.4)
# Variants of a forecast from which a fit may start.
N_STARTS_OF_EFFECT = 4
# First steps of a fit, after which it shows how far it may lead.
N_FIRST_STEPS = 2
# Wave numbers that are looked at, simulated at once, and tried.
MOST_WAVES, WAVES_AT_ONCE, N_WAVES = 256, 64, 8


def hypotheses(library: Library) -> dict[EffectKey, Hypothesis]:
    """Return a hypothesis for each form of each effect; the forms of one effect share its prior.

    That a user asks for a few candidates makes none of them more probable: the whole library shares what is expected.
    What the machine does already, as a constant or in another form, is as improbable as that a tolerance is wrong.
    """
    n, forms = len(library.known_names), [key.public for key in library.candidates]

    def odds(key: EffectKey) -> float:
        usual = calibration().log_odds("effect", n, key.public)
        usual += float(np.log(OUT_OF_TOLERANCE)) if key in library.doubles else 0.0
        return library.log_odds(key.public, usual) - float(np.log(forms.count(key.public)))

    return {key: Hypothesis("effect", key.public, key.form, odds(key), key) for key in library.candidates}


def propose(fit: Fit, known: dict[EffectKey, Hypothesis], library: Library) -> list[Proposal]:
    """Return the effects that are not in a fit, with what each would change."""
    return proposals(fit, library.joinable(fit.active), known, library)


def propose_forms(fit: Fit, known: dict[EffectKey, Hypothesis], library: Library) -> list[Proposal]:
    """Return the other forms of the effects of a fit."""
    mine, names = {key.declared for key in fit.active}, {key.public for key in fit.active}
    return proposals(fit, [k for k in library.candidates if k.public in names and k not in mine], known, library)


def propose_with_free_shapes(
    fit: Fit, key: EffectKey, known: dict[EffectKey, Hypothesis], library: Library
) -> list[Proposal]:  # fmt: skip
    """Return the effects with a held shape that one of a fit has free, such as a width of a sign, theirs free as well.

    With another width a twin would look like a stranger.
    """
    if not key.free_shape:
        return []

    def shapes(k: EffectKey) -> set[str]:
        return {name.rpartition(".")[2] for name in library.fixed_shapes(k)}

    rivals = [replace(k, free_shape=True) for k in library.joinable(fit.active) if shapes(k) & shapes(key)]
    return proposals(fit, rivals, known, library)


def proposals(
    fit: Fit, keys: list[EffectKey], known: dict[EffectKey, Hypothesis], library: Library
) -> list[Proposal]:  # fmt: skip
    proposed = library.each(lambda key: proposal(fit, known[key.declared], key, library), keys)
    return [p for p in proposed if p is not None]


def proposal(fit: Fit, hypothesis: Hypothesis, key: EffectKey, library: Library) -> Proposal | None:
    records = records_with(fit, (*fit.active, key), library)
    ranges = library.declared_ranges(records.model, key)
    places, among = waves_tried(fit, records, key, ranges)
    grid = activation_grid(records, key, ranges, SHARES_TRIED, places)
    moved = responses(fit, records, grid)
    good = np.flatnonzero(np.isfinite(moved).all(axis=1) & (np.abs(moved).max(axis=1, initial=0.0) > 0.0))
    if not len(good):
        return None
    chosen = [grid[i] for i in good]
    variants = np.full(len(good), -np.log(len(grid) * among))
    return Proposal(
        hypothesis, moved[good], SCALES_OF_STRENGTH, variants, partial(refit, key, library), one_sided=True, grid=chosen
    )


def positions(fit: Fit) -> Array | None:
    """Return the position at each sample, as a fit simulates it, (n_samples,); None where the plant has none."""
    return train_residuals(fit).variables.get(fit.model.plant.aliases.get("theta", "theta"))


def least_waves(fit: Fit) -> float:
    """Return the smallest wave number that has periods enough in the travel of a fit, 0 where there is no position."""
    travel = positions(fit)
    return 0.0 if travel is None else 2.0 * np.pi * PERIODS / max(float(np.ptp(travel)), 1e-300)


def waves_tried(
    fit: Fit, records: WhiteRecords, key: EffectKey, ranges: Mapping[str, tuple[float, float]]
) -> tuple[dict[str, Array], float]:
    """Return at which wave numbers an effect that repeats with position is tried, and how many were looked at for each.

    Records of a travel L tell wave numbers apart that differ by pi/L. All of them are looked at to first order; those
    that would leave least are tried. Nothing and 1 for an effect without a wave number.
    """
    space = records.space
    null = {n: records.model.parameters[n].null for n in space.free_names if key.owns(n)}
    shapes, strengths = [n for n in null if null[n] is None], {n: v for n, v in null.items() if v is not None}
    if not strengths or len(shapes) != 1 or records.model.parameters[shapes[0]].unit not in OF_WAVES:
        return {}, 1.0
    travel = positions(fit)
    if travel is None:
        return {}, 1.0

    def ends(name: str) -> tuple[float, float]:
        return ranges.get(name, (float(space.low[space.index(name)]), float(space.high[space.index(name)])))

    full = {n: max(ends(n), key=lambda end: abs(end - strengths[n])) for n in strengths}
    (waves,), (low, high) = shapes, ends(shapes[0])
    parts = fit.records.data.by_record(travel)
    longest, fastest = (max(float(np.max(far(part))) for part in parts) for far in (np.ptp, lambda x: abs(np.diff(x))))
    n_waves = int(np.clip((high - low) * longest / np.pi, N_WAVES, MOST_WAVES))
    numbers, squares = np.linspace(low, high, n_waves), list[float]()
    for some in np.array_split(numbers, -(-n_waves // WAVES_AT_ONCE)):
        grid = [Activation(strengths | {waves: float(w), n: end}, strengths, SLOPE)
                for w in some for n, end in full.items()]  # fmt: skip
        moved = np.nan_to_num(responses(fit, in_steps_of_waves(records, fit, fastest * some[-1]), grid))
        squares += [square_along(beyond(fit.basis, columns.T), fit.residual)[0]
                    for columns in moved.reshape(len(some), len(strengths), -1)]  # fmt: skip
    # neighbours of a peak lead to it
    around = np.concatenate([[-np.inf], squares, [-np.inf]])
    peaks = np.flatnonzero((around[1:-1] >= around[:-2]) & (around[1:-1] >= around[2:]))
    tried = peaks[np.argsort(-np.asarray(squares)[peaks])[:N_WAVES]]
    return {waves: numbers[np.sort(tried)]}, n_waves / len(tried)


def in_steps_of_waves(records: WhiteRecords, fit: Fit, phase: float) -> WhiteRecords:
    """Return a problem in steps as coarse as those of a fit, but with four in each period of a wave, to rank waves.

    phase: by which the fastest wave turns from sample to sample [rad]. At the strengths that may be found it is
    simulated as its noise asks for, in many more steps.
    """
    own = {ready.record.file: ready.calibrations for ready in by_record(fit.records.replays)}

    def coarser(ready: ReadyRecord) -> ReadyRecord:
        kept = []
        for one, of_fit in zip(ready.calibrations, own[ready.record.file], strict=True):
            n = max(of_fit.schedule.substeps, int(np.ceil(phase / (0.5 * np.pi))))
            kept.append(one if one.schedule.least <= n else replace(one, schedule=Schedule(n)))
        return replace(ready, calibrations=tuple(kept))

    return replace(records, replays=with_each(records.replays, coarser))


def records_with(fit: Fit, active: tuple[EffectKey, ...], library: Library) -> WhiteRecords:
    """Return the problem with other effects on the records as a fit has them: its constants, faults and cover."""
    problem = problem_about(fit, active, library)
    if fit.records.data.cover is not None:
        problem = replace(problem, data=fit.records.data)
    return moved(problem, [f.unknown for f in fit.others], [f.value for f in fit.others])


def refit(
    key: EffectKey, library: Library, fit: Fit, about: Expansion, ahead: Forecast, limit: float,
    begun: Array | None = None,
) -> Fit | None:  # fmt: skip
    """Return the model with an effect, fitted from the best two of the starts that a forecast gives.

    It can do all that it does without the effect: where it ends worse, the fit begins again there, the effect at rest.
    begun: where its first steps led; the fit goes on from there.
    """
    active = (*fit.active, key)
    problem = records_with(fit, active, library)
    if begun is None:
        starts = np.array(starts_of(fit, ahead, problem, library))
        order = np.argsort(projected(fit, problem, about.scale.weight).chi2(starts), kind="stable")
        best = starts[order[:2]]
    else:
        best = begun[np.newaxis]
    done = fitted(fit, problem, active, list(best), library, about.scale.weight, limit)
    if done is not None and done.chi2 <= fit.chi2:
        return done
    again = fitted(fit, problem, active, [start_of(problem, fit.values)], library, about.scale.weight, limit)
    return done if again is None or (done is not None and done.chi2 <= again.chi2) else again


def fitted(
    fit: Fit, problem: WhiteRecords, active: tuple[EffectKey, ...], starts: list[Array], library: Library,
    weight: float, limit: float = np.inf,
) -> Fit | None:  # fmt: skip
    """Return a model with other effects fitted roughly, its further unknowns those of a fit, free to move from there.

    Held where they are, constants that stand in for the new effect would leave nothing for it to explain.
    problem: with the values that the further unknowns have in the fit.
    """
    if not fit.others:
        return unless_diverged(lambda: fit_from(problem, active, starts, rough=True, limit=limit))
    base = base_of(fit, active, library)
    assert base is not None
    chi2 = projected(fit, problem, weight).chi2(np.array(starts))
    if not np.isfinite(chi2).any():
        return None
    z = starts[int(np.argmin(chi2))]
    near = Fit(active, problem, z, problem.plain.residuals(z)[0], base=base, others=fit.others)
    return unless_diverged(lambda: freed(near, base, [f.unknown for f in fit.others], weight, limit, rough=True))


def base_of(fit: Fit, active: tuple[EffectKey, ...], library: Library) -> WhiteRecords | None:
    """Return the problem with other effects before any further unknown of a fit was moved, None where it has none."""
    return None if fit.base is None else replace(problem_about(fit, active, library), data=fit.base.data)


def first_steps(fit: Fit, about: Expansion, ahead: Forecast, library: Library) -> tuple[float, Array]:
    """Return where the first steps of a fit from the best start lead: the sum of squares, and the candidate."""
    key = ahead.proposal.hypothesis.means
    problem = records_with(fit, (*fit.active, key), library)
    starts, projection = np.array(starts_of(fit, ahead, problem, library)), projected(fit, problem, about.scale.weight)
    chi2 = projection.chi2(starts)
    best = starts[int(np.argmin(chi2))]
    if not np.isfinite(chi2.min()):
        return np.inf, best
    z = descend(projection, [best], ROUGHLY, most=N_FIRST_STEPS)
    return float(projection.chi2(z)[0]), z


def starts_of(fit: Fit, ahead: Forecast, problem: WhiteRecords, library: Library) -> list[Array]:
    """Return extended candidates at expected and tried strengths, with the linear answer of the parameters."""
    starts, grid = [], ahead.proposal.grid
    for variant, strength in ahead.best(N_STARTS_OF_EFFECT):
        for share in dict.fromkeys((float(library.reachable(strength)), grid[variant].share)):
            z = np.clip(fit.z - share * ahead.answer[: fit.n_free, variant], 0.01, 0.99)
            values = dict(zip(fit.values, fit.records.values(z), strict=True)) | grid[variant].at(share)
            starts.append(np.clip(problem.shares(free_values(problem, values)), 1e-3, 1.0 - 1e-3))
    return starts
