"""Problems to take away: the suite, for people who benchmark optimisers of any kind.

Its records are simulated (synthetic): the parameters that made them are drawn from name, version and instance. Only
problems that are made of somebody's campaigns hold measured ones.
"""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from timeit import repeat
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike
from pymoo.core.problem import Problem

from armid.errors import ArmidError, nearest, quoted
from armid.model import EFFECTS, PLANTS, Array, Manoeuvre, Model
from armid.problem.fitness import FITNESS
from armid.problem.meter import PENALTY
from armid.problem.problem import IdentificationProblem, ready_record, replays, residuals
from armid.problem.space import Space, space_of
from armid.record import Campaign, read_campaign
from armid.record.record import made_record
from armid.units import DEGREE

VERSION = 1
N_INSTANCES = 15
INTERVAL_S = 1e-3
# The truth keeps this share of the range away from each bound.
MARGIN_OF_TRUTH = 0.15
# Start and target angle [deg], with the shell, supply voltage [V].
LOWER, RAISE, SHORT_STROKE, EMPTY = (-48, 22, 1, 28.0), (22, -48, 1, 28.0), (-48, -8, 1, 28.0), (-48, 22, 0, 28.0)
FOUR = (LOWER, RAISE, SHORT_STROKE, EMPTY)
FRICTION = {
    "coulomb.level": (0.0, 80.0), "viscous.slope": (0.0, 60.0), "stribeck.level": (0.0, 60.0),
    "stribeck.fade": (0.04, 0.6),
}  # fmt: skip
STICKING = {
    "presliding.level": (0.0, 120.0), "presliding.way": (0.002, 0.05), "stribeck.level": (0.0, 120.0),
    "stribeck.fade": (0.04, 0.3),
}  # fmt: skip
SUPPLY = {
    "supply_sag.resistance": (0.0, 0.05), "flux_saturation.sharpness": (0.0, 0.01), "brush_drop.drop": (0.0, 3.0),
    "supply_error.error": (-0.1, 0.1),
}  # fmt: skip
LAG_RANGES = {
    "drive_lag.time_constant": (0.0, 0.05), "tachometer_lag.time_constant": (0.0, 0.03),
    "output_lag.time_constant": (0.0, 0.03),
}  # fmt: skip
ROCKING = {
    "shell_rocking.inertia_share": (2.0, 30.0), "shell_rocking.frequency": (3.0, 30.0),
    "shell_rocking.damping_ratio": (0.0, 0.2),
}  # fmt: skip
BALANCE = {"gas_heat_loss.loss_rate": (0.0, 3.0), "line_loss.c": (0.0, 1e5), "gravity_gain.error": (-0.2, 0.2)}
WORM = {"worm_direction.loss": (0.0, 0.6), "worm_speed.loss": (0.0, 0.4), "worm_speed.fade": (0.05, 2.0)}
SENSOR = {
    "gyro_scale.error": (-0.1, 0.1), "gyro_bias.bias": (-0.05, 0.05), "gyro_lag.time_constant": (0.0, 0.012),
    "gyro_lag.damping_ratio": (0.4, 1.2),
}  # fmt: skip
RIPPLE = {
    "torque_ripple.sine": (-60.0, 60.0), "torque_ripple.cosine": (-60.0, 60.0), "torque_ripple.waves": (20.0, 200.0),
}  # fmt: skip
WHOLE_RANGES = FRICTION | SUPPLY | {"drive_lag.time_constant": (0.0, 0.05), "tilt.angle": (-0.1, 0.1)}
OBJECTIVES, UNITS_OF_PARAMETERS = ("one", "records"), ("box", "SI")
N_OF_GRID, N_LINES = 512, 24
# Class of difficulty, the measure that decides it, and the limit above which it holds; fixed before any search was run.
CLASSES_OF_FORMS = (
    ("stair", "stair", 0.05),
    ("plateau", "plateau", 0.15),
    ("rugged", "minima", 1.5),
    ("valley", "valley", 300.0),
)


@dataclass(frozen=True)
class Definition:
    """A problem of the suite; its instances differ in the truth, and in the noise where there is any.

    free: parameter of an effect -> bounds, SI, with the four of the paper's arm. strokes: one record each.
    """

    free: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fitness: str = "rmse"
    strokes: tuple[tuple[float, ...], ...] = (LOWER,)
    duration_s: float = 0.7
    noise_deg_s: float = 0.0


SIMILAR, NOISY, LONG_STROKE = "similarity", 0.3, 1.2
DEFINITIONS: dict[str, Definition] = {
    "arm": Definition(),
    "arm_noisy": Definition(noise_deg_s=NOISY),
    "arm_similarity": Definition(fitness=SIMILAR),
    "arm_similarity_noisy": Definition(fitness=SIMILAR, noise_deg_s=NOISY),
    "arm_shape": Definition(fitness="shape_similarity"),
    "arm_short": Definition(duration_s=0.6, noise_deg_s=NOISY),
    "arm_four": Definition(strokes=FOUR, duration_s=LONG_STROKE),
    "friction": Definition(FRICTION),
    "friction_noisy": Definition(FRICTION, noise_deg_s=NOISY),
    "friction_similarity": Definition(FRICTION, SIMILAR),
    "ripple": Definition(RIPPLE, strokes=(LOWER, RAISE)),
    "ripple_noisy": Definition(RIPPLE, noise_deg_s=NOISY),
    "sticking": Definition(STICKING, strokes=(RAISE,), duration_s=LONG_STROKE),
    "sticking_similarity": Definition(STICKING, SIMILAR, strokes=(RAISE,), duration_s=LONG_STROKE),
    "supply": Definition(SUPPLY),
    "supply_four": Definition(SUPPLY, strokes=FOUR, duration_s=LONG_STROKE, noise_deg_s=NOISY),
    "lags_similarity": Definition(LAG_RANGES, SIMILAR, strokes=(LOWER, SHORT_STROKE)),
    "rocking": Definition(ROCKING),
    "rocking_similarity": Definition(ROCKING, SIMILAR),
    "rocking_friction": Definition(ROCKING | FRICTION, strokes=(LOWER, RAISE), duration_s=LONG_STROKE),
    "balance": Definition(BALANCE | WORM, strokes=(LOWER, RAISE), duration_s=LONG_STROKE),
    "sensor": Definition(SENSOR | LAG_RANGES, noise_deg_s=NOISY),
    "whole": Definition(WHOLE_RANGES, strokes=FOUR, duration_s=LONG_STROKE, noise_deg_s=NOISY),
    "whole_similarity": Definition(WHOLE_RANGES, SIMILAR, strokes=FOUR, duration_s=LONG_STROKE),
}  # fmt: skip
"""Name -> problem, in the order of the suite; a change of one of them changes VERSION."""


def suite(
    objectives: str = "one", units: str = "box", campaigns: Iterable[Campaign | str | Path] | Campaign | str | Path = ()
) -> "Suite":
    """Return all instances of all problems, each made when it is asked for; none is compiled before its first call.

    Parameters
    ----------
    objectives
        "one", or "records": the problems with several records, one objective for each record.
    units
        "box": candidates in the unit cube; "SI": in the parameters' own units.
    campaigns
        One or several campaigns of measured machines, or their folders. Each is a further problem, `NAME/1`.

    Returns
    -------
    Suite
        A sequence of `SuiteProblem`, which takes names too.

    Raises
    ------
    ArmidError
        For another word, a campaign that cannot be used, and a name that is there twice.

    >>> problems = suite()
    >>> len(problems), problems[0].name, problems["whole/15"].n_var
    (360, 'arm/1', 14)
    """
    for what, given, known in (("objectives", objectives, OBJECTIVES), ("units", units, UNITS_OF_PARAMETERS)):
        if given not in known:
            raise ArmidError(f"{what} is {given!r}, {nearest(str(given), known)}")
    names = [name for name, d in DEFINITIONS.items() if objectives == "one" or len(d.strokes) > 1]
    keys = [(name, i) for name in names for i in range(1, N_INSTANCES + 1)]
    measured: dict[str, Campaign] = {}
    for one in [campaigns] if isinstance(campaigns, Campaign | str | Path) else campaigns:
        campaign = one if isinstance(one, Campaign) else read_campaign(one)
        if campaign.name in (*DEFINITIONS, *measured):
            raise ArmidError(f"campaign {quoted(campaign.name)}: the suite has a problem of that name already, another "
                             "name is expected in campaign.toml")  # fmt: skip
        measured[campaign.name] = campaign
        if objectives == "one" or sum(len(r.signals) for r in campaign.train) > 1:
            keys.append((campaign.name, 1))
    return Suite(tuple(keys), objectives, units, measured)


@dataclass(frozen=True)
class Suite(Sequence["SuiteProblem"]):
    """Hold instances by place or name, such as `arm/1`; a slice is a suite too.

    keys: (problem, instance from 1). measured: problem -> the campaign that it is made of.
    """

    keys: tuple[tuple[str, int], ...]
    objectives: str = "one"
    units: str = "box"
    measured: Mapping[str, Campaign] = field(default_factory=dict)

    def __repr__(self) -> str:
        problems = ", ".join(dict.fromkeys(name for name, _ in self.keys))
        return f"<Suite of {len(self)} problems, NAME/INSTANCE: {problems}>"

    def __len__(self) -> int:
        return len(self.keys)

    @overload
    def __getitem__(self, which: int | str) -> "SuiteProblem": ...
    @overload
    def __getitem__(self, which: slice) -> "Suite": ...
    def __getitem__(self, which: int | str | slice) -> "SuiteProblem | Suite":
        if isinstance(which, slice):
            return replace(self, keys=self.keys[which])
        if isinstance(which, str):
            names = [f"{name}/{instance}" for name, instance in self.keys]
            if which not in names:
                raise ArmidError(f"problem '{which}' is not in the suite: {nearest(which, names)}")
            which = names.index(which)
        problem, instance = self.keys[which]
        if problem in self.measured:
            return MeasuredProblem(self.measured[problem], self.objectives, self.units)
        return SuiteProblem(problem, instance, self.objectives, self.units)


class SuiteProblem(Problem):  # type: ignore[misc]
    """Minimise how far the arm at a candidate is from a simulated record whose truth is known.

    `problem(x)` is a number, `problem(X)` an array, (n_candidates,), for candidates (n_candidates, n_var); with several
    objectives they have a last axis more. A candidate that diverges has the value 1e100.

    name, version: from which everything follows, such as `arm/1` and 1. definition: what the problem is.
    n_var, xl, xu: number and bounds of the parameters, whose names and SI units are `names` and `parameter_units`.
    """

    def __init__(self, problem_name: str, instance: int, objectives: str = "one", units: str = "box") -> None:
        self.definition = DEFINITIONS[problem_name]
        model, space = composed(problem_name)
        self._declare(problem_name, instance, model, space, len(self.definition.strokes), objectives, units)

    def _declare(
        self, problem_name: str, instance: int, model: Model, space: Space, n_records: int, objectives: str, units: str
    ) -> None:
        self.problem_name, self.instance, self.version = problem_name, instance, VERSION
        self.name, self.objectives, self.units = f"{problem_name}/{instance}", objectives, units
        self.model, self.space, self.names = model, space, space.free_names
        self.parameter_units = tuple(u for u, f in zip(space.units, space.free, strict=True) if f)
        self._low, self._high = space.low[space.free], space.high[space.free]
        n_obj = n_records if objectives == "records" else 1
        low, high = (self._low, self._high) if units == "SI" else (np.zeros(len(self.names)), np.ones(len(self.names)))
        super().__init__(n_var=len(self.names), n_obj=n_obj, xl=low, xu=high)

    def __str__(self) -> str:
        # pymoo's own calls name, which is a word here
        return f"<{type(self).__name__} {self.name}, version {self.version}: {', '.join(self.names)}>"

    __repr__ = __str__

    def __call__(self, x: ArrayLike) -> Any:
        """Return the value of a candidate, (n_var,), or those of several, (n_candidates, n_var)."""
        X = np.asarray(x, dtype=np.float64)
        values = self.evaluate(np.atleast_2d(X), return_values_of=["F"])
        objectives = values[:, 0] if self.n_obj == 1 else values
        return objectives if X.ndim > 1 else (float(objectives[0]) if self.n_obj == 1 else objectives[0])

    def _evaluate(self, X: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        problem, candidates = self.identification, self.si(X)
        if self.objectives == "one":
            F = problem.value(candidates)[:, np.newaxis]
        else:
            F = np.column_stack([IdentificationProblem(self.space, (replay,), problem.fitness).value(candidates)
                                 for replay in problem.replays])  # fmt: skip
        out["F"] = np.where(np.isfinite(F), F, PENALTY)

    def si(self, x: ArrayLike) -> Array:
        """Return candidates in SI units, in the shape of x."""
        X = np.asarray(x, dtype=np.float64)
        return X if self.units == "SI" else self._low + X * (self._high - self._low)

    def own(self, x: Array) -> Array:
        """Return SI candidates in the units of this problem: the inverse of `si`."""
        return x if self.units == "SI" else self._cube(x)

    def _cube(self, x: Array) -> Array:
        return np.asarray((x - self._low) / (self._high - self._low))

    @cached_property
    def truth(self) -> Array:
        """The parameters that made the records, in the units of the problem, (n_var,)."""
        return self.own(self._drawn[0])

    @property
    def _reference(self) -> Array:
        """The point about which the landscape is measured, SI, (n_var,)."""
        return self._drawn[0]

    @cached_property
    def _drawn(self) -> tuple[Array, np.random.Generator]:
        """The truth, SI, and the generator from which the noise is drawn next."""
        words = f"{self.problem_name} {self.version} {self.instance}".encode()
        rng = np.random.default_rng(np.frombuffer(hashlib.sha256(words).digest(), dtype="<u4"))
        share = MARGIN_OF_TRUTH + (1.0 - 2.0 * MARGIN_OF_TRUTH) * rng.random(self.n_var)
        return self._low + share * (self._high - self._low), rng

    @cached_property
    def identification(self) -> IdentificationProblem:
        """The problem in SI with its model, space and records; compiles the model."""
        from scipy.special import ndtri

        given, (truth, rng), ready = self.definition, self._drawn, []
        for number, (start, target, shell, supply) in enumerate(given.strokes, 1):
            n_samples = round(given.duration_s / INTERVAL_S) + 1
            constants = {"theta_C": start * DEGREE, "theta_D": target * DEGREE, "shell": shell, "U": supply}
            manoeuvre, rms = Manoeuvre(INTERVAL_S, n_samples, constants), given.noise_deg_s * DEGREE
            name, output = f"{self.name}, record {number}", self.model.plant.outputs[0]
            record = made_record(name, "train", manoeuvre, output, np.zeros(n_samples), rms)
            (replay,) = ready_record(record, self.model, self.space, "standard").each
            # recorded at the very steps of the search, so that the truth is the optimum of what has no noise, bit for
            # bit; normal numbers by the inverse distribution, as numpy's own may change between its versions
            measured = replay.signal(self.space.complete(truth[np.newaxis]))[0] + rms * ndtri(rng.random(n_samples))
            ready.append(replay.measuring(measured))
        return IdentificationProblem(self.space, tuple(ready), FITNESS[given.fitness])

    @cached_property
    def floor(self) -> float:
        """Value at the truth: what the noise leaves, 0 without noise. A lower one fits the noise."""
        return float(self.identification.value(self._drawn[0])[0])

    @cached_property
    def optimum_x(self) -> Array | None:
        """Where the optimum is, (n_var,): the truth without noise; with noise what least squares finds from there.

        None for a noisy similarity, whose optimum nobody knows.
        """
        if not self.definition.noise_deg_s:
            return self.truth
        if self.definition.fitness != "rmse":
            return None
        return self.own(self._least_squares(self._drawn[0]))

    def _least_squares(self, start: Array) -> Array:
        """Return what least squares finds from a point, both SI."""
        from scipy.optimize import least_squares

        def vector(u: Array) -> Array:
            return np.asarray(self._residuals(u)[0])

        solution = least_squares(vector, self._cube(start), bounds=(0.0, 1.0), xtol=1e-12, ftol=1e-14)
        return np.asarray(self._low + solution.x * (self._high - self._low))

    @cached_property
    def optimum_value(self) -> float | None:
        """Value at `optimum_x`, None where that is not known."""
        return None if self.optimum_x is None else float(self.identification.value(self.si(self.optimum_x))[0])

    @cached_property
    def cost_s(self) -> float:
        """Time of one evaluation on this machine, one thread, measured in populations of 64 [s]."""
        X = self.spread(64)
        return min(repeat(lambda: self.identification.value(X), number=1, repeat=3)) / len(X)

    def spread(self, n: int) -> Array:
        """Return candidates drawn uniformly from the box, SI, the same at each call, (n, n_var)."""
        return self._low + np.random.default_rng(VERSION).random((n, self.n_var)) * (self._high - self._low)

    def _values(self, u: Array) -> Array:
        """Return the fitness of points of the unit cube, (n_candidates,)."""
        return self.identification.value(self._low + u * (self._high - self._low))

    def _residuals(self, u: Array) -> Array:
        """Return the residuals of points of the unit cube, (n_candidates, n_total) [signal's unit, or in its noise]."""
        X: Array = self._low + np.atleast_2d(u) * (self._high - self._low)
        return residuals(self.identification.replays, self.space, X, 1.0 / self.identification.sizes)

    @cached_property
    def landscape(self) -> dict[str, float]:
        """What is hard about it, measured without any search.

        valley: largest over smallest singular value of the residuals' derivatives by the parameters in the unit cube,
        at the truth. stair: share of steps of 0.1 % of the range, from random points in random directions, that leave
        the value exactly as it was. plateau: share of steps of 5 % that change it by less than 0.2 % of the distance
        from its median over the box to the floor. minima: local minima on a straight line through the truth from bound
        to bound, mean over 24 lines of 201 points. holes: share of the box where the simulation diverges.
        """
        rng, truth = np.random.default_rng(VERSION), self._cube(self._reference)
        shifts = 1e-4 * np.eye(self.n_var)
        slopes = self._residuals(truth + shifts) - self._residuals(truth - shifts)
        widths = np.linalg.svd(slopes, compute_uv=False)
        points, directions = rng.random((N_OF_GRID, self.n_var)), rng.standard_normal((N_OF_GRID, self.n_var))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        here, near, far = (self._values(np.clip(points + step * directions, 0.0, 1.0)) for step in (0.0, 1e-3, 0.05))
        finite = np.isfinite([here, near, far]).all(axis=0)
        height = float(np.median(here) - self._values(truth)[0])
        with np.errstate(invalid="ignore"):
            flat = np.abs(far - here)[finite] < 2e-3 * height
        return {
            "valley": float(widths[0] / max(widths[-1], 1e-300)), "stair": float(np.mean((near == here)[finite])),
            "plateau": float(np.mean(flat)), "holes": float(np.mean(~np.isfinite(here))),
            "minima": float(np.mean([n_minima(self._values(line_across(truth, d))) for d in directions[:N_LINES]])),
        }  # fmt: skip

    @property
    def difficulty(self) -> str:
        """The first class whose limit the landscape exceeds: stair, plateau, rugged, valley; else smooth."""
        of = self.landscape
        return next((name for name, measure, limit in CLASSES_OF_FORMS if of[measure] > limit), "smooth")


class MeasuredProblem(SuiteProblem):
    """Minimise the rmse of the declared model of a campaign on its train records; `SuiteProblem` says how to call it.

    campaign: its plant, the effects that it declares, and its bounds make the problem; its name and records are the
    only thing that says which version it is. Outputs of several units count in units of their noise each.
    Nobody knows the truth of a machine: `truth`, `optimum_x` and `optimum_value` are None. `floor` is what the noise
    of the records leaves; what the model lacks comes on top, so that a search may end far above it. The landscape is
    measured about the best point that least squares finds from 4 of 64 spread ones.
    """

    def __init__(self, campaign: Campaign, objectives: str = "one", units: str = "box") -> None:
        self.campaign, model = campaign, campaign.model()
        space, n_records = space_of(model, campaign.parameters), sum(len(r.signals) for r in campaign.train)
        self._declare(campaign.name, 1, model, space, n_records, objectives, units)

    truth = optimum_x = optimum_value = None  # type: ignore[assignment]

    @cached_property
    def identification(self) -> IdentificationProblem:
        """The problem in SI with its model, space and records; compiles the model."""
        ready = replays(self.campaign.train, self.model, self.space, "standard")
        return IdentificationProblem(self.space, ready, FITNESS["rmse"])

    @cached_property
    def floor(self) -> float:
        """The rmse that the noise of the records leaves, as far as they tell it."""
        problem = self.identification
        noise = np.array([r.record.noise.rms for r in problem.replays]) / problem.sizes
        return float(np.sqrt(np.average(noise**2, weights=problem.record_weights)))

    @cached_property
    def _reference(self) -> Array:
        spread = self.spread(64)
        starts = spread[np.argsort(self.identification.value(spread), kind="stable")[:4]]
        ends = np.array([self._least_squares(start) for start in starts])
        return np.asarray(ends[int(np.argmin(self.identification.value(ends)))])


@cache
def first_of(problem_name: str) -> SuiteProblem:
    return SuiteProblem(problem_name, 1)


@cache
def composed(problem_name: str) -> tuple[Model, Space]:
    free = DEFINITIONS[problem_name].free
    model = Model(PLANTS["shell_transfer_arm"], tuple(EFFECTS[e] for e in dict.fromkeys(n.split(".")[0] for n in free)))
    return model, space_of(model, bounds=free)


def line_across(point: Array, direction: Array) -> Array:
    """Return points on a line through a point of the unit cube, from bound to bound, (201, n)."""
    with np.errstate(divide="ignore"):
        ends = np.array([-point, 1.0 - point]) / direction
    reach = np.linspace(ends.min(axis=0).max(), ends.max(axis=0).min(), 201)
    return np.asarray(np.clip(point + reach[:, np.newaxis] * direction, 0.0, 1.0))


def n_minima(values: Array) -> int:
    """Return the number of local minima of a sequence, its ends among them; a flat stretch counts once."""
    from scipy.signal import find_peaks

    return len(find_peaks(-np.pad(values[np.isfinite(values)], 1, constant_values=np.inf))[0])
