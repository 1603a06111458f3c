"""Effects that do what the declared model does already: one law, whatever the motion.

Viscous friction is the damping of a machine that has one: records cannot tell two shares of one quantity, and its
interval would reach from none of it to all. Laws are compared and not records, since on one stroke friction does what a
pressure does. At states and inputs drawn independently, an effect and a parameter are one law where one change of the
parameter changes all rates and outputs as the effect does. Other effects act meanwhile: a wrong gain of the drive looks
like another mass only until something else acts.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armid.engine import simulate
from armid.engine.simulate import flat
from armid.inference.candidates import EffectKey
from armid.inference.kinds.effects import beside
from armid.inference.library import Library
from armid.inference.model import Fit, candidate_at
from armid.inference.whitening import WhiteRecords
from armid.model import Array, Model
from armid.model.graph import LATE_LEAVES

# Two forms of one law differ by up to 4e-4 of their square, two laws by 2e-3 and more, and by 0.05 where other effects
# act (measured on nine machines).
SAME_LAW, SAME_IN_COMPANY = 1e-3, 0.01
# States at which laws are compared, and by which share of their range they leave that of the records to either side.
N_STATES, FARTHER = 2000, 0.5
# Share of their size with which other effects act, and of its size or value by which each parameter is changed.
COMPANY, CHANGED = 0.1, 1e-4


def doubles(fit: Fit, library: Library) -> dict[EffectKey, str]:
    """Return the effects of one strength that are a free parameter of the declared model, or a constant, and its name.

    fit: of the declared model. Constants are those that are known within a tolerance.
    """
    own = [*fit.values, *(p.names[0] for p in fit.products(library.tolerances))]
    known: dict[int, dict[str, Any]] = {}
    found: dict[EffectKey, str] = {}
    for key in library.joinable(()):
        records = beside(fit, (key,), library)
        if id(records.model) not in known:
            known[id(records.model)] = scattered(records, candidate_at(records, fit.values))
        name = double(records, key, own, known[id(records.model)], library)
        found |= {key: name} if name else {}
    return found


def double(records: WhiteRecords, key: EffectKey, own: Sequence[str], values: dict[str, Any], library: Library) -> str:
    """Return which parameter or constant is the law of an effect, "" for none."""
    model, all_strengths = records.model, strengths(records, library)
    names, shares = all_strengths.get(key, []), dict.fromkeys(own, 0.0)
    if len(names) != 1:
        return ""
    ports = library.candidates[key].adds.keys()
    company = {n: library.strength_of(n, model.parameters[n]) for other, theirs in all_strengths.items()
               if not ports & library.candidates[other].adds.keys() for n in theirs}  # fmt: skip
    size = library.strength_of(names[0], model.parameters[names[0]])
    for share, most in ((0.0, SAME_LAW), (COMPANY, SAME_IN_COMPANY)):
        here = values | {flat(n): values[flat(n)] + share * strength for n, strength in company.items()}
        change = change_of(model, here, names[0], size)
        shares = {n: apart(change, change_of(model, here, n, here[flat(n)] or 1.0)) for n in shares}
        shares = {n: x for n, x in shares.items() if x < most}
    return min(shares, key=lambda n: shares[n], default="")


def strengths(records: WhiteRecords, library: Library) -> dict[EffectKey, list[str]]:
    """Return the strengths of each candidate of a compiled model, but of those whose shapes are times."""
    parameters: dict[EffectKey, list[str]] = {}
    for name in records.space.names:
        owner = library.owner(name)
        if owner is not None:
            parameters.setdefault(owner, []).append(name)
    declared = records.model.parameters
    return {key: [n for n in names if declared[n].null is not None] for key, names in parameters.items()
            if all(declared[n].unit != "s" for n in names)}  # fmt: skip


def scattered(records: WhiteRecords, candidate: Array) -> dict[str, Any]:
    """Return what the equations of a model begin from: a candidate, and states and inputs independent of each other.

    Each is even over the range that it has on the records, and beyond.
    """
    model, seen = records.model, dict[str, list[Array]]()
    values: dict[str, Any] = {}
    for replay in records.replays:
        for piece, calibration in zip(replay.pieces, replay.calibrations, strict=True):
            manoeuvre = piece.manoeuvre
            run = simulate(model, manoeuvre, candidate[np.newaxis], calibration.schedule, states=True)
            values |= dict(zip(model.constants, model.constant_values(manoeuvre.constants), strict=True))
            motion = {name: state[0] for name, state in run.states.items()} | {"time": manoeuvre.times()}
            for name, signal in (motion | {i.name: manoeuvre.inputs[i.name] for i in model.plant.inputs}).items():
                seen.setdefault(flat(name), []).append(np.asarray(signal, dtype=float))
    values |= dict(zip(map(flat, model.parameters), map(float, candidate), strict=True))
    values |= dict.fromkeys(map(flat, model.latches), 0.0)
    rng = np.random.default_rng(0)

    def drawn(name: str) -> Array:
        low, high = np.nanmin(np.concatenate(seen[name])), np.nanmax(np.concatenate(seen[name]))
        beyond = FARTHER * (high - low)
        return rng.uniform(low - beyond, high + beyond, N_STATES)

    values |= {name: drawn(name) for name in seen}
    return values | {node.key: drawn(node.needs[0]) for node in model.graph.of_kind(*LATE_LEAVES)}


def change_of(model: Model, values: Mapping[str, Any], name: str, size: float) -> Array:
    """Return the change of all rates and outputs per change of one parameter or constant, (n, n_states).

    Each over how much it varies from state to state.
    """
    keys = [n.key for n in model.graph.of_kind("rate")] + [o.signal for o in model.plant.outputs]
    changed, rows = dict(values), []
    with np.errstate(all="ignore"):
        before = model.graph.values(keys, values)
        changed[flat(name)] = values[flat(name)] + CHANGED * size
        after = model.graph.values(keys, changed)
        for key in keys:
            spread = float(np.nanstd(before[key]))
            rows.append(np.broadcast_to((after[key] - before[key]) / (spread or 1.0), N_STATES))
    return np.array(rows)


def apart(one: Array, other: Array) -> float:
    """Return which share of the squares of a change another one cannot make, whatever its size."""
    good = np.isfinite(one) & np.isfinite(other)
    a, b = one[good], other[good]
    square, mixed, others = float(a @ a), float(a @ b), float(b @ b)
    return 1.0 - mixed**2 / (square * others) if square > 0.0 and others > 0.0 else 1.0
