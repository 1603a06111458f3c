"""Effects that do what the declared model does already: one law, whatever the motion.

Viscous friction is the damping of a machine that has one: records cannot tell two shares of one quantity, and its
interval would reach from none of it to all. Laws are compared and not records, since on one stroke friction does what a
pressure does. At states and inputs drawn independently, an effect and a parameter are one law where one change of the
parameter changes all rates and outputs as the effect does. Then also while something else acts at the other ports: a
wrong gain of the drive looks like another mass only until something else acts. An effect in exactly the form of a
parameter is not tried. One in another form (a sign that is smoothed otherwise) is improbable.

No record can separate some effects from a change of all free parameters together. A gain of the drive is one of them
if all that it moves is free. Such an effect is tried, since the intervals have to hold both.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from armid.engine import along
from armid.engine.simulate import flat
from armid.inference.candidates import Double, EffectKey
from armid.inference.kinds.effects import records_with
from armid.inference.library import Library
from armid.inference.model import Fit, candidate_at
from armid.inference.whitening import WhiteRecords
from armid.model import Array, Model
from armid.model.graph import LATE_LEAVES
from armid.problem.problem import by_record

# Two forms of one law differ by up to 4e-4 of their square, two laws by 2e-3 and more (measured on nine machines).
ROUNDING_OF_LAW, SAME_LAW = 1e-9, 1e-3
# States at which laws are compared, and by which share of their range they leave that of the records to either side.
N_STATES, FARTHER = 1000, 0.5
# Share of its size or value by which each parameter is changed.
CHANGED = 1e-4


@dataclass(frozen=True, eq=False)
class States:
    """Hold states at which the equations of a model are evaluated: key of a leaf -> one value, or one of each state.

    added: what acts at ports besides, port -> one of each state.
    """

    model: Model
    values: Mapping[str, Any]
    added: Mapping[str, Array] = field(default_factory=dict)

    @cached_property
    def rates(self) -> dict[str, Array]:
        """Rates of all states, and the outputs."""
        graph, values = self.model.graph, dict(self.values)
        keys = [n.key for n in graph.of_kind("rate")] + [o.signal for o in self.model.plant.outputs]
        with np.errstate(all="ignore"):
            for node in graph.order(keys):
                value = node.value(values)
                values[node.key] = value + self.added[node.key] if node.key in self.added else value
        return {key: np.broadcast_to(values[key], N_STATES) for key in keys}

    def disturbed(self, but: Collection[str]) -> "States":
        """Return the same states with something else at each port but some, which moves rates by their own size."""
        sizes, rng, added = {key: size_of(x) for key, x in self.rates.items()}, np.random.default_rng(1), {}
        for port in self.model.plant.ports:
            draw = rng.standard_normal(N_STATES)
            if port in but:
                continue
            tried = replace(self, added={port: draw}).rates
            moved = max((size_of(tried[key] - self.rates[key]) / x for key, x in sizes.items() if x > 0.0), default=0.0)
            if moved > 0.0:
                added[port] = draw / moved
        return replace(self, added=added)

    def moved(self, changes: Mapping[str, float]) -> "States":
        """Return the same states with other parameters or constants; changes: name -> what is added."""
        return replace(self, values={**self.values, **{flat(n): self.values[flat(n)] + x for n, x in changes.items()}})

    def change(self, name: str, size: float, both: bool = False) -> Array:
        """Return the change of rates and outputs by a change of a parameter or constant, (n, n_states).

        Each over its size. both: the mean of a change to either side, without what bends.
        """
        ends = [self.moved({name: step * CHANGED * size}).rates for step in ((0.5, -0.5) if both else (1.0, 0.0))]
        return np.array([(ends[0][key] - ends[1][key]) / (size_of(rate) or 1.0) for key, rate in self.rates.items()])

    def changes(self, own: Iterable[str], both: bool = False) -> dict[str, Array]:
        """Return the change by each of some parameters and constants."""
        return {n: self.change(n, self.values[flat(n)] or 1.0, both) for n in own}


def doubles(fit: Fit, library: Library) -> dict[EffectKey, Double]:
    """Return the effects of one strength that are a free parameter of the declared model, or a constant.

    fit: of the declared model. Constants are those that are known within a tolerance.
    """
    # laws are the same whatever the width over which each smooths a sign
    values = {name: value for name, value in fit.values.items() if name not in library.own_shapes}
    own = [*values, *(p.names[0] for p in fit.products(library.tolerances))]
    known: dict[int, tuple[States, dict[str, Array]]] = {}
    found: dict[EffectKey, Double] = {}
    for key in library.joinable(()):
        records = records_with(fit, (key,), library)
        if id(records.model) not in known:
            states = scattered(records, candidate_at(records, values))
            known[id(records.model)] = states, states.changes(own)
        one = double(records, key, *known[id(records.model)], library)
        found |= {key: one} if one else {}
    return found


def done_together(fit: Fit, key: EffectKey, library: Library) -> tuple[str, ...]:
    """Return the parameters of a model that do together exactly what an effect does, empty where they do not."""
    values = {name: value for name, value in fit.values.items() if name not in library.own_shapes}
    records = records_with(fit, (*fit.active, key), library)
    name = only_strength(records, key)
    if name is None:
        return ()
    states = scattered(records, candidate_at(records, values))
    change = states.change(name, library.strength_of(name, records.model.parameters[name])).ravel()
    columns = np.column_stack([x.ravel() for x in states.changes(values, both=True).values()])
    good = np.isfinite(change) & np.isfinite(columns).all(axis=1)
    change, columns = change[good], columns[good]
    sizes = np.linalg.norm(columns, axis=0)
    if not (change.any() and sizes.all()):
        return ()
    shares = np.linalg.lstsq(columns / sizes, change, rcond=None)[0]
    left = change - columns / sizes @ shares
    if left @ left > ROUNDING_OF_LAW * (change @ change):
        return ()
    return tuple(n for n, share in zip(values, shares, strict=True) if share**2 > ROUNDING_OF_LAW * np.max(shares**2))


def double(
    records: WhiteRecords, key: EffectKey, alone: States, own: Mapping[str, Array], library: Library
) -> Double | None:  # fmt: skip
    """Return which parameter or constant is the law of an effect, None for none.

    alone: no effect acts there. own: change by each parameter and constant there.
    """
    name = only_strength(records, key)
    if name is None:
        return None
    size, ports = library.strength_of(name, records.model.parameters[name]), library.candidates[key].adds.keys()
    change = alone.change(name, size)
    same = {n: share for n, other in own.items() if (share := apart(change, other)) < SAME_LAW}
    if not same:
        return None
    # Something else acts at the other ports.
    acting = alone.disturbed(ports)
    change = acting.change(name, size)
    shares = {n: apart(change, other) for n, other in acting.changes(same).items()}
    best = min(shares, key=lambda n: shares[n])
    return Double(best, same[best] < ROUNDING_OF_LAW) if shares[best] < SAME_LAW else None


def only_strength(records: WhiteRecords, key: EffectKey) -> str | None:
    """Return the name of an effect's strength where it has but one, and no time."""
    declared = records.model.parameters
    own = [n for n in records.space.names if key.owns(n)]
    strengths = [n for n in own if declared[n].null is not None]
    return strengths[0] if len(strengths) == 1 and all(declared[n].unit != "s" for n in own) else None


def scattered(records: WhiteRecords, candidate: Array) -> States:
    """Return a candidate with states and inputs that are independent of each other.

    Each is even over the range that it has on the records, and beyond.
    """
    model, seen = records.model, dict[str, list[Array]]()
    values: dict[str, Any] = {}
    moving = [*model.states, *(i.name for i in model.plant.inputs), "time"]
    for ready in by_record(records.replays):
        for piece, calibration in zip(ready.record.pieces, ready.calibrations, strict=True):
            manoeuvre = piece.manoeuvre
            values |= dict(zip(model.constants, model.constant_values(manoeuvre.constants), strict=True))
            for name, signal in along(model, manoeuvre, candidate, calibration.schedule, moving).items():
                seen.setdefault(flat(name), []).append(signal)
    values |= dict(zip(map(flat, model.parameters), map(float, candidate), strict=True))
    values |= dict.fromkeys(map(flat, model.latches), 0.0)
    rng = np.random.default_rng(0)

    def drawn(name: str) -> Array:
        low, high = np.nanmin(np.concatenate(seen[name])), np.nanmax(np.concatenate(seen[name]))
        beyond = FARTHER * (high - low)
        return rng.uniform(low - beyond, high + beyond, N_STATES)

    values |= {name: drawn(name) for name in seen}
    values |= {node.key: drawn(node.needs[0]) for node in model.graph.of_kind(*LATE_LEAVES)}
    return States(model, values)


def size_of(signal: Array) -> float:
    """Return the root mean square of what is finite, 0 where nothing is."""
    good = signal[np.isfinite(signal)]
    return float(np.sqrt(np.mean(good**2))) if good.size else 0.0


def apart(one: Array, other: Array) -> float:
    """Return which share of the squares of a change another one cannot make, whatever its size."""
    good = np.isfinite(one) & np.isfinite(other)
    a, b = one[good], other[good]
    square, mixed, others = float(a @ a), float(a @ b), float(b @ b)
    return 1.0 - mixed**2 / (square * others) if square > 0.0 and others > 0.0 else 1.0
