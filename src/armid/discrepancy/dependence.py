"""On what a missing signal depends: on which variable of the motion, at which port."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.stretch import Stretch
from armid.discrepancy.sums import Sums, left_out_share, removed_share, solved
from armid.model import Model
from armid.simulation import along

Array = NDArray[np.float64]
N_KNOTS = 8
# Two variables whose values order the samples alike tell the same story: the second is left out.
SAME_STORY = 0.999
N_BLOCKS = 4


@dataclass(frozen=True, eq=False)
class Dependence:
    """Say that a signal at a port is factor x curve(variable), the curve straight between evenly spaced knots.

    factor: "1", "direction" (sign of the speed) or "drive_effort". removed: share of the squared residual beyond the
    reach of the free parameters that it removes; share: of records (or blocks of time) left out of its fit, below 0
    where it makes their prediction worse. heights: of the curve at its knots from `first` to `last` [unit of the
    variable], fitted on all train records, (n_knots,).
    """

    port: str
    variable: str
    factor: str
    removed: float
    share: float
    first: float
    last: float
    heights: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Hold the variables of the simulated motion at the knots of one stretch: name -> (n_knots,)."""

    stretch: Stretch
    variables: dict[str, Array]
    factors: dict[str, Array] = field(default_factory=dict)


def motions(model: Model, candidate: Array, whole: Sequence[Stretch]) -> list[Motion]:
    """Return the variables of each stretch: states, inputs, time and the effort of the drive.

    candidate: whole, SI, (n_parameters,). Those that never move, and those that order the motion as an earlier one
    does, are left out.
    """
    names = variable_names(model)
    asked = [*names, *(n for n in ("omega", "drive_effort") if knows(model, n) and n not in names)]
    tables = []
    for stretch in whole:
        values = along(model, stretch.piece.manoeuvre, candidate, stretch.schedule, asked)
        times = stretch.piece.manoeuvre.times()
        tables.append({name: np.interp(stretch.knots, times, v) for name, v in values.items()})
    kept = told_apart({name: np.concatenate([t[name] for t in tables]) for name in names})
    return [Motion(s, {n: t[n] for n in kept}, factors(t, model)) for s, t in zip(whole, tables, strict=True)]


def variable_names(model: Model) -> list[str]:
    """Return speed and position, the other states that files show, inputs, the effort of the drive, time."""
    shown = [s.name for s in model.plant.states if s.column] or [s.name for s in model.plant.states]
    first = [model.plant.aliases.get(a, a) for a in ("omega", "theta")]
    ordered = [n for n in first if n in shown] + [n for n in shown if n not in first]
    effort = [n for n in ("drive_effort",) if knows(model, n)]
    return [*ordered, *(i.name for i in model.plant.inputs), *effort, "time"]


def knows(model: Model, name: str) -> bool:
    """Tell whether equations of the model may use a name."""
    return model.plant.aliases.get(name, name) in model.graph.nodes


def factors(values: dict[str, Array], model: Model) -> dict[str, Array]:
    """Return what a curve may be multiplied by, at the knots."""
    found = {"1": np.ones(len(next(iter(values.values()))))}
    speed = values.get(model.plant.aliases.get("omega", "omega"), values.get("omega"))
    if speed is not None:
        found["direction"] = speed / np.hypot(speed, 0.005 * model.plant.scales.speed)
    if "drive_effort" in values:
        found["drive_effort"] = values["drive_effort"]
    return found


def told_apart(variables: dict[str, Array]) -> list[str]:
    """Return the names of variables that move and whose order of samples no earlier one has."""
    ranks: dict[str, Array] = {}
    for name, values in variables.items():
        if np.ptp(values) <= 1e-9 * max(float(np.abs(values).max()), 1e-300):
            continue
        rank = np.argsort(np.argsort(values)).astype(float)
        if all(abs(np.corrcoef(rank, other)[0, 1]) < SAME_STORY for other in ranks.values()):
            ranks[name] = rank
    return list(ranks)


def dependences(moved: Sequence[Motion]) -> list[Dependence]:
    """Return every port, variable and factor, the one that removes most first."""
    ports, pairs = moved[0].stretch.gains, [(v, f) for v in moved[0].variables for f in moved[0].factors if v != f]
    found = [dependence(moved, port, variable, factor) for port in ports for variable, factor in pairs]
    return sorted(found, key=lambda d: -d.removed)


def dependence(moved: Sequence[Motion], port: str, variable: str, factor: str) -> Dependence:
    """Fit one curve, and again without each group, to see what it predicts there."""
    values = np.concatenate([m.variables[variable] for m in moved])
    first, last = float(values.min()), float(values.max())
    columns = [m.stretch.gains[port] @ weights(m, variable, factor, first, last) for m in moved]
    design = np.concatenate([np.hstack([m.stretch.jacobian, c]) for m, c in zip(moved, columns, strict=True)])
    residual = np.concatenate([m.stretch.residual for m in moved])
    sums = [Sums.of(design[g == n], residual[g == n]) for g in (groups(moved),) for n in np.unique(g)]
    n_free = moved[0].stretch.jacobian.shape[1]
    heights = solved(Sums.total(sums), n_free)[n_free:]
    removed, share = removed_share(Sums.total(sums), n_free), left_out_share(sums, n_free)
    return Dependence(port, variable, factor, removed, share, first, last, heights)


def weights(motion: Motion, variable: str, factor: str, first: float, last: float) -> Array:
    """Return what each knot of the curve adds to the missing signal of a stretch, (n_knots, n_heights)."""
    return hats(motion.variables[variable], first, last) * motion.factors[factor][:, np.newaxis]


def hats(values: Array, first: float, last: float, n_knots: int = N_KNOTS) -> Array:
    """Return triangles over a range: at each value the weights of the two knots beside it, (n, n_knots)."""
    place = np.clip((values - first) / (last - first), 0.0, 1.0) * (n_knots - 1)
    return np.maximum(0.0, 1.0 - np.abs(place[:, np.newaxis] - np.arange(n_knots)))


def groups(moved: Sequence[Motion]) -> NDArray[np.int64]:
    """Return to which record each sample belongs, or to which block of time where there is one record only."""
    numbers = np.concatenate([np.full(len(m.stretch.residual), m.stretch.group) for m in moved])
    if len(set(numbers.tolist())) > 1:
        return numbers
    return np.asarray(np.arange(len(numbers)) * N_BLOCKS // len(numbers))
