"""Does a model carry over to the records held out? By which factor they are missed, and what is new in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from armid.inference.checks import Residuals
from armid.inference.decisions import EXPLAINS, NOT_CARRIED, OUTSIDE, OVER_NOISE
from armid.inference.model import Fit
from armid.inference.whitening import WhiteRecords
from armid.units import shown


@dataclass(frozen=True)
class Missed:
    """Say how a held-out record is missed.

    factor: its error over that of the train records, in units of noise and doubt. errors: both, [unit of the output].
    outside: variable -> (its value farthest outside, the nearest end of the range of the train records, unit).
    changes: parameter -> relative change that would take away most of its error.
    """

    record: str
    factor: float
    errors: tuple[float, float]
    unit: str
    outside: Mapping[str, tuple[float, float, str]]
    changes: Mapping[str, float]

    @property
    def sentence(self) -> str:
        error, train = (shown(e, self.unit)[0] for e in self.errors)
        unit = shown(1.0, self.unit)[1]
        said = [f"{self.record} does not carry over: it is missed by {error:.3g} {unit}, the train "
                f"records by {train:.3g}. In noise and doubt this is {self.factor:.3g} times as much."]  # fmt: skip
        if self.outside:
            reach = [f"{name} reaches {shown(value, unit)[0]:.3g} {shown(1.0, unit)[1]} (train: "
                     f"{shown(end, unit)[0]:.3g})" for name, (value, end, unit) in self.outside.items()]  # fmt: skip
            said.append(f"It leaves the range of the train records: {', '.join(reach)}. Effects that show only there "
                        "cannot be found; train on such a record.")  # fmt: skip
        if self.changes:
            name, change = next(iter(self.changes.items()))
            said.append(f"A change of {name} by {change:+.1%} would explain most of this error: has it changed?")
        return " ".join(said)


def missed_sentences(missed: Sequence[Missed]) -> list[str]:
    """Return what is to be known of records that are missed, the worst one in full."""
    if not missed:
        return []
    worst, *others = sorted(missed, key=lambda m: -m.factor)
    rest = [f"The same holds for {', '.join(f'{m.record} ({m.factor:.3g} times)' for m in others)}."] if others else []
    return [" ".join([worst.sentence, *rest])]


def missed_records(fit: Fit, train: Residuals, holdout: Residuals | None) -> list[Missed]:
    """Return the held-out records that are missed by more than noise, and by far more than the train records."""
    if holdout is None:
        return []
    outputs, found = [o.name for o in fit.model.plant.outputs], []
    known = {place: max(rms_of(train, place), 1.0) for place in {r.place for r in train.replays}}
    edges = holdout.data.edges
    for i, (replay, raw) in enumerate(zip(holdout.replays, holdout.raw, strict=True)):
        inside = slice(int(edges[i]), int(edges[i + 1]))
        # Divided by noise and doubt together: the start of a held-out record is known from few samples.
        factor = float(np.sqrt(np.mean(holdout.residual[inside] ** 2))) / known.get(replay.place, 1.0)
        if not np.isfinite(factor) or factor <= NOT_CARRIED:
            continue
        output = outputs[replay.place]
        before = train.errors.outputs[output].rmse if output in train.errors.outputs else holdout.noise_of[output]
        found.append(Missed(replay.name, factor, (float(np.sqrt(np.mean(raw**2))), before), replay.record.unit,
                            outside(train, holdout, inside), changes(fit, holdout, inside)))  # fmt: skip
    return found


def over_noise(train: Residuals, holdout: Residuals) -> list[bool]:
    """Return of each held-out record whether it is missed by more than noise, as it is there and on train records."""
    outputs, found = [o.name for o in train.model.plant.outputs], dict[str, bool]()
    for replay, raw in zip(holdout.replays, holdout.raw, strict=True):
        name, file = outputs[replay.place], replay.record.file
        seen = train.errors.outputs[name].rmse if name in train.errors.outputs else 0.0
        is_noise = float(np.sqrt(np.mean(raw**2))) <= OVER_NOISE * max(holdout.noise_of[name], seen)
        found[file] = found.get(file, False) or not is_noise
    return list(found.values())


def rms_of(seen: Residuals, place: int) -> float:
    """Return the rms of the whitened residual of one output."""
    parts = zip(seen.data.by_record(seen.residual), seen.replays, strict=True)
    return float(np.sqrt(np.mean(np.concatenate([part for part, replay in parts if replay.place == place]) ** 2)))


def outside(train: Residuals, holdout: Residuals, inside: slice) -> dict[str, tuple[float, float, str]]:
    """Return the variables of the motion that leave the range of the train records."""
    plant, found = train.model.plant, {}
    units = {s.name: s.unit for s in plant.states} | {i.name: i.unit for i in plant.inputs}
    for name, known in train.variables.items():
        values = holdout.variables[name][inside]
        low, high = float(known.min()), float(known.max())
        least, most = float(values.min()), float(values.max())
        margin = OUTSIDE * max(high - low, 1e-300)
        unit = units.get(name, plant.scales.effort_unit)
        if most - high > max(margin, low - least):
            found[name] = (most, high, unit)
        elif low - least > margin:
            found[name] = (least, low, unit)
    return found


def changes(fit: Fit, holdout: Residuals, inside: slice) -> dict[str, float]:
    """Return the parameters whose change would explain the error of a record, the likeliest first."""
    if not fit.n_free:
        return {}
    records = WhiteRecords(holdout.replays, fit.records.space, holdout.data)
    residual, slopes = records.residual_and_slopes(fit.z)
    own, found = residual[inside], {}
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
        if taken > EXPLAINS:
            found[name] = (taken, moved * float(fit.records.span[i]) / abs(value))
    return {name: change for name, (_, change) in sorted(found.items(), key=lambda pair: -pair[1][0])}
