"""Problems to take away: the suite, for people who benchmark optimisers of any kind.

All records are simulated (synthetic): the parameters that made them are drawn from name, version and instance.
"""

import hashlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike
from pymoo.core.problem import Problem

from armid.errors import ArmidError, nearest
from armid.model import EFFECTS, PLANTS, Array, Manoeuvre, Model
from armid.problem.fitness import FITNESS
from armid.problem.meter import PENALTY
from armid.problem.problem import IdentificationProblem, replay_of, residuals
from armid.problem.space import Space, space_of
from armid.record import Noise, Piece, Record
from armid.units import DEGREE

VERSION = 1
N_INSTANCES = 15
INTERVAL_S = 1e-3
# The truth keeps this share of the range away from each bound.
MARGIN = 0.15
# Start and target angle [deg], with the shell, supply voltage [V].
LOWER, RAISE, SHORT, EMPTY = (-48, 22, 1, 28.0), (22, -48, 1, 28.0), (-48, -8, 1, 28.0), (-48, 22, 0, 28.0)
FOUR = (LOWER, RAISE, SHORT, EMPTY)
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
LAGS = {
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
WHOLE = FRICTION | SUPPLY | {"drive_lag.time_constant": (0.0, 0.05), "tilt.angle": (-0.1, 0.1)}
OBJECTIVES, UNITS = ("one", "records"), ("box", "SI")
N_STEPS, N_LINES = 512, 24
# Class of difficulty, the measure that decides it, and the limit above which it holds; fixed before any search was run.
CLASSES = (
    ("stair", "stair", 0.05),
    ("plateau", "plateau", 0.15),
    ("rugged", "minima", 1.5),
    ("valley", "valley", 300.0),
)


@dataclass(frozen=True)
class Definition:
    """A problem of the suite; its instances differ in the truth, and in the noise where there is any.

    free: parameter of an effect -> bounds, SI, beside the four of the paper's arm. strokes: one record each.
    """

    free: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fitness: str = "rmse"
    strokes: tuple[tuple[float, ...], ...] = (LOWER,)
    duration_s: float = 0.7
    noise_deg_s: float = 0.0


SIMILAR, NOISY, LONG = "similarity", 0.3, 1.2
DEFINITIONS: dict[str, Definition] = {
    "arm": Definition(),
    "arm_noisy": Definition(noise_deg_s=NOISY),
    "arm_similarity": Definition(fitness=SIMILAR),
    "arm_similarity_noisy": Definition(fitness=SIMILAR, noise_deg_s=NOISY),
    "arm_shape": Definition(fitness="shape_similarity"),
    "arm_short": Definition(duration_s=0.6, noise_deg_s=NOISY),
    "arm_four": Definition(strokes=FOUR, duration_s=LONG),
    "friction": Definition(FRICTION),
    "friction_noisy": Definition(FRICTION, noise_deg_s=NOISY),
    "friction_similarity": Definition(FRICTION, SIMILAR),
    "ripple": Definition(RIPPLE, strokes=(LOWER, RAISE)),
    "ripple_noisy": Definition(RIPPLE, noise_deg_s=NOISY),
    "sticking": Definition(STICKING, strokes=(RAISE,), duration_s=LONG),
    "sticking_similarity": Definition(STICKING, SIMILAR, strokes=(RAISE,), duration_s=LONG),
    "supply": Definition(SUPPLY),
    "supply_four": Definition(SUPPLY, strokes=FOUR, duration_s=LONG, noise_deg_s=NOISY),
    "lags_similarity": Definition(LAGS, SIMILAR, strokes=(LOWER, SHORT)),
    "rocking": Definition(ROCKING),
    "rocking_similarity": Definition(ROCKING, SIMILAR),
    "rocking_friction": Definition(ROCKING | FRICTION, strokes=(LOWER, RAISE), duration_s=LONG),
    "balance": Definition(BALANCE | WORM, strokes=(LOWER, RAISE), duration_s=LONG),
    "sensor": Definition(SENSOR | LAGS, noise_deg_s=NOISY),
    "whole": Definition(WHOLE, strokes=FOUR, duration_s=LONG, noise_deg_s=NOISY),
    "whole_similarity": Definition(WHOLE, SIMILAR, strokes=FOUR, duration_s=LONG),
}  # fmt: skip
"""Name -> problem, in the order of the suite; a change of one of them changes VERSION."""


def suite(objectives: str = "one", units: str = "box") -> "Suite":
    """Return all instances of all problems, each made when it is asked for; none is compiled before its first call.

    Parameters
    ----------
    objectives
        "one", or "records": an objective a record, and then those problems alone that have several.
    units
        "box": candidates in the unit cube; "SI": in the parameters' own units.

    Returns
    -------
    Suite
        A sequence of `SuiteProblem`, which takes names too.

    Raises
    ------
    ArmidError
        For another word.

    >>> problems = suite()
    >>> len(problems), problems[0].name, problems["whole/15"].n_var
    (360, 'arm/1', 14)
    """
    for what, given, known in (("objectives", objectives, OBJECTIVES), ("units", units, UNITS)):
        if given not in known:
            raise ArmidError(f"{what} is {given!r}, {nearest(str(given), known)}")
    several = [name for name, d in DEFINITIONS.items() if objectives == "one" or len(d.strokes) > 1]
    return Suite(tuple((name, i) for name in several for i in range(1, N_INSTANCES + 1)), objectives, units)


@dataclass(frozen=True)
class Suite(Sequence["SuiteProblem"]):
    """Hold instances by place or name, such as `arm/1`; a slice is a suite too. keys: (problem, instance from 1)."""

    keys: tuple[tuple[str, int], ...]
    objectives: str = "one"
    units: str = "box"

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
        return SuiteProblem(*self.keys[which], self.objectives, self.units)


class SuiteProblem(Problem):  # type: ignore[misc]
    """Minimise how far the arm at a candidate is from a simulated record whose truth is known.

    `problem(x)` is a number, `problem(X)` an array, (n_candidates,), for candidates (n_candidates, n_var); with several
    objectives they have a last axis more. A candidate that diverges has the value 1e100.

    name, version: from which everything follows, such as `arm/1` and 1. definition: what the problem is.
    n_var, xl, xu: number and bounds of the parameters, whose names and SI units are `names` and `parameter_units`.
    """

    def __init__(self, problem_name: str, instance: int, objectives: str = "one", units: str = "box") -> None:
        self.problem_name, self.instance, self.version = problem_name, instance, VERSION
        self.name, self.definition = f"{problem_name}/{instance}", DEFINITIONS[problem_name]
        self.objectives, self.units = objectives, units
        self.model, self.space = composed(problem_name)
        self.names = self.space.free_names
        self.parameter_units = tuple(u for u, f in zip(self.space.units, self.space.free, strict=True) if f)
        self._low, self._high = self.space.low[self.space.free], self.space.high[self.space.free]
        n_obj = len(self.definition.strokes) if objectives == "records" else 1
        low, high = (self._low, self._high) if units == "SI" else (np.zeros(len(self.names)), np.ones(len(self.names)))
        super().__init__(n_var=len(self.names), n_obj=n_obj, xl=low, xu=high)

    def __call__(self, x: ArrayLike) -> Any:
        """Return the value of a candidate, (n_var,), or those of several, (n_candidates, n_var)."""
        X = np.asarray(x, dtype=np.float64)
        values = self.evaluate(np.atleast_2d(X), return_values_of=["F"])
        found = values[:, 0] if self.n_obj == 1 else values
        return found if X.ndim > 1 else (float(found[0]) if self.n_obj == 1 else found[0])

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

    @cached_property
    def _drawn(self) -> tuple[Array, np.random.Generator]:
        """The truth, SI, and the generator from which the noise is drawn next."""
        words = f"{self.problem_name} {self.version} {self.instance}".encode()
        rng = np.random.default_rng(np.frombuffer(hashlib.sha256(words).digest(), dtype="<u4"))
        share = MARGIN + (1.0 - 2.0 * MARGIN) * rng.random(self.n_var)
        return self._low + share * (self._high - self._low), rng

    @cached_property
    def identification(self) -> IdentificationProblem:
        """The problem in SI with its model, space and records; compiles the model."""
        from scipy.special import ndtri

        given, (truth, rng), replays = self.definition, self._drawn, []
        for number, (start, target, shell, supply) in enumerate(given.strokes, 1):
            n_samples = round(given.duration_s / INTERVAL_S) + 1
            constants = {"theta_C": start * DEGREE, "theta_D": target * DEGREE, "shell": shell, "U": supply}
            manoeuvre, rms = Manoeuvre(INTERVAL_S, n_samples, constants), given.noise_deg_s * DEGREE
            empty = np.zeros(n_samples)
            record = Record(
                file=f"{self.name}, record {number}", role="train", unit=self.model.plant.output_unit,
                manoeuvre=manoeuvre, measured=empty, rest=np.empty(0),
                noise=Noise(rms, 0.0, 0.0, 1.0, n_samples, "known"),
                pieces=(Piece(manoeuvre, empty, slice(0, n_samples)),), whole_pieces=(),
                output=self.model.plant.outputs[0].name,
            )  # fmt: skip
            replay = replay_of(record, self.model, self.space, "standard")
            # recorded at the very steps of the search, so that the truth is the optimum of what has no noise, bit for
            # bit; normal numbers by the inverse distribution, as numpy's own may change between its versions
            measured = replay.signal(self.space.complete(truth[np.newaxis]))[0] + rms * ndtri(rng.random(n_samples))
            pieces = (Piece(manoeuvre, measured, slice(0, n_samples)),)
            replays.append(replace(replay, record=replace(record, measured=measured, pieces=pieces), pieces=pieces))
        return IdentificationProblem(self.space, tuple(replays), FITNESS[given.fitness])

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
        from scipy.optimize import least_squares

        def vector(u: Array) -> Array:
            return np.asarray(self._residuals(u)[0])

        found = least_squares(vector, self._cube(self._drawn[0]), bounds=(0.0, 1.0), xtol=1e-12, ftol=1e-14)
        return self.own(np.asarray(self._low + found.x * (self._high - self._low)))

    @cached_property
    def optimum_value(self) -> float | None:
        """Value at `optimum_x`, None where that is not known."""
        return None if self.optimum_x is None else float(self.identification.value(self.si(self.optimum_x))[0])

    @cached_property
    def cost_s(self) -> float:
        """Time of one evaluation on this machine, one thread, measured in populations of 64 [s]."""
        X = self.spread(64)
        spans = []
        for _ in range(3):
            began = time.perf_counter()
            self.identification.value(X)
            spans.append(time.perf_counter() - began)
        return min(spans) / len(X)

    def spread(self, n: int) -> Array:
        """Return candidates drawn uniformly from the box, SI, the same at each call, (n, n_var)."""
        return self._low + np.random.default_rng(VERSION).random((n, self.n_var)) * (self._high - self._low)

    def _values(self, u: Array) -> Array:
        """Return the fitness of points of the unit cube, (n_candidates,)."""
        return self.identification.value(self._low + u * (self._high - self._low))

    def _residuals(self, u: Array) -> Array:
        """Return the residuals of points of the unit cube, (n_candidates, n_total) [rad/s]."""
        replays = self.identification.replays
        X: Array = self._low + np.atleast_2d(u) * (self._high - self._low)
        return residuals(replays, self.space, X, np.ones(len(replays)))

    @cached_property
    def landscape(self) -> dict[str, float]:
        """What is hard about it, measured without any search.

        valley: largest over smallest singular value of the residuals' derivatives by the parameters in the unit cube,
        at the truth. stair: share of steps of 0.1 % of the range, from random points in random directions, that leave
        the value exactly as it was. plateau: share of steps of 5 % that change it by less than 0.2 % of the distance
        from its median over the box to the floor. minima: local minima on a straight line through the truth from bound
        to bound, mean over 24 lines of 201 points. holes: share of the box where the simulation diverges.
        """
        rng, truth = np.random.default_rng(VERSION), self._cube(self._drawn[0])
        shifts = 1e-4 * np.eye(self.n_var)
        slopes = self._residuals(truth + shifts) - self._residuals(truth - shifts)
        widths = np.linalg.svd(slopes, compute_uv=False)
        points, directions = rng.random((N_STEPS, self.n_var)), rng.standard_normal((N_STEPS, self.n_var))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        here, near, far = (self._values(np.clip(points + step * directions, 0.0, 1.0)) for step in (0.0, 1e-3, 0.05))
        finite = np.isfinite([here, near, far]).all(axis=0)
        height = float(np.median(here)) - self.floor
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
        return next((name for name, measure, limit in CLASSES if of[measure] > limit), "smooth")


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
    known = values[np.isfinite(values)]
    steps = np.sign(np.diff(known))
    steps = np.concatenate([[-1.0], steps[steps != 0.0], [1.0]])
    return int(((steps[:-1] < 0.0) & (steps[1:] > 0.0)).sum())
