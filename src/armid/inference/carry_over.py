"""What a model predicts of what its fit has not seen: records held out, and parts left out in turn.

Of a held-out record that is missed: by which factor, and what is new in it.

Where the best model leaves more than noise, evidence compares models that are all wrong, and effects that bend to what
is missing win on the records that they saw. There the model in force is the one that predicts parts left out of its fit
(Stone 1974, doi:10.1111/j.2517-6161.1974.tb00994.x), with the fewest effects within one standard error of the best
(Breiman and others 1984).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armid.estimation.corrections import rms
from armid.estimation.least_squares import descend
from armid.inference.checks import Residuals
from armid.inference.decisions import EXPLAINS, NOT_CARRIED, OUTSIDE, OVER_NOISE
from armid.inference.kinds.drifts import LARGEST_DRIFT
from armid.inference.kinds.faults import PLAUSIBLE
from armid.inference.kinds.hypothesis import Hypotheses
from armid.inference.library import Library
from armid.inference.model import ROUGHLY, Fit
from armid.inference.whitening import WhitenedData, WhiteRecords
from armid.model import Array
from armid.problem.problem import Replay
from armid.units import behind, shown

# Parts that are left out in turn; models of each number of effects that are compared.
PARTS_LEFT_OUT, MOST_OF_SIZE = 5, 3
# Shifts at which a held-out record is compared: by half a millisecond.
N_SHIFTS = 201


@dataclass(frozen=True)
class Missed:
    """Say how a held-out record is missed.

    factor: its error over that of the train records, in units of noise and doubt. errors: both, [unit of the output].
    outside: variable -> (its value farthest outside, the nearest end of the range of the train records, unit).
    changes: parameter -> relative change that would take away most of its error. late: shift of its times [s] that
    would, 0 where none does.
    """

    record: str
    factor: float
    errors: tuple[float, float]
    unit: str
    outside: Mapping[str, tuple[float, float, str]]
    changes: Mapping[str, float]
    late: float = 0.0

    @property
    def sentence(self) -> str:
        error, train = (shown(e, self.unit)[0] for e in self.errors)
        unit = shown(1.0, self.unit)[1]
        texts = [f"{self.record} does not carry over: it is missed by {error:.3g} {unit}, the train "
                 f"records by {train:.3g}. Measured by noise and by the doubt "
                 f"of the parameters, this is {self.factor:.3g} times as much."]  # fmt: skip
        if self.outside:
            reach = [f"{name} reaches {shown(value, unit)[0]:.3g}{behind(shown(1.0, unit)[1])} (train: "
                     f"{shown(end, unit)[0]:.3g})" for name, (value, end, unit) in self.outside.items()]  # fmt: skip
            texts.append(f"It leaves the range of the train records: {', '.join(reach)}. Effects that show only there "
                         "cannot be found; train on such a record.")  # fmt: skip
        if self.late:
            word = "late" if self.late > 0.0 else "early"
            texts.append(f"Shifted by {1e3 * abs(self.late):.3g} ms most of this error is gone: does it start {word}?")
        elif self.changes:
            name, change = next(iter(self.changes.items()))
            texts.append(f"A change of {name} by {change:+.1%} would explain most of this error: has it changed?")
        return " ".join(texts)


def missed_sentences(missed: Sequence[Missed]) -> list[str]:
    """Return what is to be known of records that are missed, the worst one in full."""
    if not missed:
        return []
    worst, *others = sorted(missed, key=lambda m: -m.factor)
    rest = [f"The same holds for {', '.join(f'{m.record} ({m.factor:.3g} times)' for m in others)}."] if others else []
    return [" ".join([worst.sentence, *rest])]


def in_doubt_sentences(train: Residuals, holdout: Residuals | None) -> list[str]:
    """Return which held-out records are missed by far more than the train records, as far as the doubt lets them be."""
    if holdout is None:
        return []
    outputs, words, noise = [o.name for o in holdout.model.plant.outputs], [], least_noise(train, holdout)
    for replay, raw, part in zip(holdout.replays, holdout.raw, holdout.data.by_record(holdout.residual), strict=True):
        error, least = rms(raw), noise[outputs[replay.place]]
        if error > NOT_CARRIED * least and rms(part) <= NOT_CARRIED:
            size, unit = shown(error, replay.record.unit)
            words.append(f"{replay.name} by {size:.3g} {unit} ({error / least:.3g} times)")
    if not words:
        return []
    return [f"Held-out records are missed by far more than train records: {', '.join(words)}. Their starts and the "
            "parameters are known so roughly that this neither confirms nor denies the model. Measure what a start "
            "lacks (as an output of the plant), or train on more records."]  # fmt: skip


def missed_records(fit: Fit, train: Residuals, holdout: Residuals | None) -> list[Missed]:
    """Return the held-out records that are missed by more than noise, and by far more than the train records."""
    if holdout is None:
        return []
    outputs, missed = [o.name for o in fit.model.plant.outputs], []
    known = {place: max(rms_of(train, place), 1.0) for place in {r.place for r in train.replays}}
    edges, flags = holdout.data.edges, over_noise_of_each(train, holdout)
    for i, (replay, raw, is_over) in enumerate(zip(holdout.replays, holdout.raw, flags, strict=True)):
        # The doubt is common to all records: an error of one of them would count as one of the others, too.
        if not is_over:
            continue
        inside = slice(int(edges[i]), int(edges[i + 1]))
        # Divided by noise and doubt together: the start of a held-out record is known from few samples.
        factor = rms(holdout.residual[inside]) / known.get(replay.place, 1.0)
        if not np.isfinite(factor) or factor <= NOT_CARRIED:
            continue
        output = outputs[replay.place]
        before = train.errors.outputs[output].rmse if output in train.errors.outputs else holdout.noise_of[output]
        missed.append(Missed(replay.name, factor, (rms(raw), before), replay.record.unit,
                             outside(train, holdout, inside), changes(fit, holdout, inside),
                             late(replay, raw)))  # fmt: skip
    return missed


def over_noise(train: Residuals, holdout: Residuals) -> list[bool]:
    """Return of each held-out record whether it is missed by more than noise, as it is there and on train records."""
    flags = dict[str, bool]()
    for replay, is_over in zip(holdout.replays, over_noise_of_each(train, holdout), strict=True):
        flags[replay.record.file] = flags.get(replay.record.file, False) or is_over
    return list(flags.values())


def over_noise_of_each(train: Residuals, holdout: Residuals) -> list[bool]:
    """Return the same of each signal of the held-out records."""
    outputs, least = [o.name for o in train.model.plant.outputs], least_noise(train, holdout)
    return [not size <= OVER_NOISE * least[outputs[replay.place]]
            for replay, size in zip(holdout.replays, map(rms, holdout.raw), strict=True)]  # fmt: skip


def least_noise(train: Residuals, holdout: Residuals) -> dict[str, float]:
    """Return the least that the noise of each output held out can be, rms: it may be known from differences alone."""
    seen = train.errors.outputs
    return {n: max(level, seen[n].rmse if n in seen else 0.0) for n, level in holdout.noise_of.items()}


def rms_of(seen: Residuals, place: int) -> float:
    """Return the rms of the whitened residual of one output."""
    parts = zip(seen.data.by_record(seen.residual), seen.replays, strict=True)
    return rms(np.concatenate([part for part, replay in parts if replay.place == place]))


def outside(train: Residuals, holdout: Residuals, inside: slice) -> dict[str, tuple[float, float, str]]:
    """Return the variables of the motion that leave the range of the train records."""
    plant, excursions = train.model.plant, {}
    for name, known in train.variables.items():
        values = holdout.variables[name][inside]
        low, high = float(known.min()), float(known.max())
        least, most = float(values.min()), float(values.max())
        margin = OUTSIDE * max(high - low, 1e-300)
        if most - high > max(margin, low - least):
            excursions[name] = (most, high, plant.unit_of(name))
        elif low - least > margin:
            excursions[name] = (least, low, plant.unit_of(name))
    return excursions


def changes(fit: Fit, holdout: Residuals, inside: slice) -> dict[str, float]:
    """Return the parameters whose change would explain the error of a record, the likeliest first."""
    if not fit.n_free:
        return {}
    records = WhiteRecords(holdout.replays, fit.records.space, holdout.data)
    residual, slopes = records.residual_and_slopes(fit.z)
    own, changes = residual[inside], {}
    if not np.isfinite(own).all():
        return {}
    total = float(own @ own)
    for i, (name, value) in enumerate(fit.values.items()):
        column = slopes[inside, i]
        square = float(column @ column)
        if square <= 0.0 or value == 0.0:
            continue
        moved = float(column @ own) / square
        taken = moved**2 * square / total
        change = moved * float(fit.records.span[i]) / abs(value)
        if taken > EXPLAINS and abs(change) <= LARGEST_DRIFT:
            changes[name] = (taken, change)
    return {name: change for name, (_, change) in sorted(changes.items(), key=lambda pair: -pair[1][0])}


def late(replay: Replay, raw: Array) -> float:
    """Return by how much a record is late, where a shift of its times takes away most of its error [s], else 0.

    raw: measured minus simulated, (n_samples,).
    """
    measured, step = replay.measured, replay.record.spacing
    if len(replay.pieces) > 1 or not np.isfinite(raw).all():
        return 0.0
    samples, simulated = np.arange(len(raw)), measured - raw
    shifts = np.linspace(-PLAUSIBLE["late"], PLAUSIBLE["late"], N_SHIFTS)
    left = [rms(measured - np.interp(samples - shift / step, samples, simulated)) ** 2 for shift in shifts]
    best = int(np.argmin(left))
    return float(shifts[best]) if left[best] < (1.0 - EXPLAINS) * rms(raw) ** 2 else 0.0


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
        if own is best or not np.isfinite(own).all():
            return own is best
        apart = own - best
        return bool(np.mean(apart) <= np.std(apart, ddof=1) / np.sqrt(len(apart)))

    near = [(len(m), float(np.mean(x)), i) for i, (m, x) in enumerate(zip(compared, missed, strict=True)) if is_near(x)]
    return compared[min(near)[2]]


def parts_of(data: WhitenedData) -> list[NDArray[np.int64]]:
    """Return what is left out in turn, as numbers of samples: manoeuvres with their repeats, or blocks of time."""
    names = [r.manoeuvre_file for r in data.each]
    indices = data.by_record(np.arange(data.edges[-1]))
    distinct = list(dict.fromkeys(names))
    if len(distinct) > 1:
        # of many manoeuvres several are left out together, spread over the campaign
        groups = [distinct[i::PARTS_LEFT_OUT] for i in range(min(PARTS_LEFT_OUT, len(distinct)))]
        return [np.concatenate([x for x, n in zip(indices, names, strict=True) if n in group]) for group in groups]
    blocks = [np.array_split(x, PARTS_LEFT_OUT) for x in indices]
    return [np.concatenate(block) for block in zip(*blocks, strict=True)]


def misses(fit: Fit) -> Array:
    """Return the logarithm of the mean square by which a model misses each part, fitted without it, (n_parts,).

    It is the deviance of a sample where the scale of each part is unknown. Where a model is wrong no noise is common
    to all parts, and a mean of squares is that of the worst one.
    """
    data, squares = fit.records.data, []
    for part in parts_of(data):
        sound = data.sound.copy()
        sound[part] = 0.0
        problem = replace(fit.records, data=replace(data, sound=sound))
        z = descend(problem, [fit.z], ROUGHLY) if fit.n_free else fit.z
        left = fit.records.plain.residuals(z)[0][part]
        squares.append(float(np.mean(left**2)) if np.isfinite(left).all() else np.inf)
    return np.log(squares)
