"""Each point of a contract is missed by something: here is what misses it."""

import random
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from threading import Thread
from time import sleep
from typing import Any

import numpy as np
import pytest
from pymoo.algorithms.soo.nonconvex.de import DE
from pymoo.algorithms.soo.nonconvex.pattern import PatternSearch

from armid.contract.check import check_fitness, check_identifier
from armid.contract.equations import check_effect, check_effects, check_plant
from armid.contract.trials import ContractPoint
from armid.identifiers import as_identifier
from armid.model import PLANTS, Effect, Guard, Parameter, State
from armid.problem.fitness import Fitness

AXIS = {"driven_axis": replace(PLANTS["driven_axis"], variants=())}
LEVEL = Parameter("level", "effort", 0.0, 1.0, null=0.0)


def drag(omega, level):
    """Friction in proportion to speed."""
    return -level * omega


def failed(points: Iterable[ContractPoint]) -> dict[str, str]:
    """Name -> sentence of the points that do not hold, without the plant's name."""
    findings = list(points)
    assert all(f.sentence and "\n" not in f.sentence for f in findings)
    return {f.name.split(" on driven")[0].split(", driven")[0]: f.sentence for f in findings if not f.passed}


def effect(function: Callable[..., Any] = drag, *parameters: Parameter, name: str = "own", **more: Any) -> Effect:
    return Effect(name, parameters or (LEVEL,), {"torque": function}, **more)


def shaped(omega, level, width):
    """Vanishes at null only for some widths."""
    return -level * omega + (0.001 if width > 0.9 else 0.0)


def idle(omega, level):
    """Nothing at all."""
    return 0.0 * level * omega


def late(omega, level):
    """Nothing to first order in its strength."""
    return -50.0 * level**2 * omega


def explosive(omega, level):
    """Drive that grows with the cube of the speed."""
    return 1e6 * level * omega**3 + 1e3 * level


def branching(omega, level):
    """Statements that arrays cannot take."""
    if omega > 0:
        return -level * omega
    return -0.5 * level * omega


def jumping(omega, level):
    """Coulomb friction as it is written on paper: at rest it jumps to and fro, and no guard says so."""
    return -level * np.sign(omega)


def uncompilable(omega, level):
    """Something that numba does not know."""
    return level * np.linalg.norm(omega)


# Each vanishes at null, so that one compiled model serves for all of them.
BESIDE = {"acts": idle, "responds": late, "finite": explosive, "on arrays": branching, "compiled": jumping}
DECLARED = {
    "bounds": effect(drag, replace(LEVEL, low=-1e308, high=float("inf"))),
    "values": effect(drag, replace(LEVEL, low=0.1, high=0.5)),
    "null values": effect(drag, replace(LEVEL, null=None, nominal=0.0)),
    "units": effect(drag, replace(LEVEL, unit=" ")),
    "binds": effect(lambda altitude, level: altitude),
}


@pytest.mark.slow
def test_effects_miss_points_beside_others_that_keep_them() -> None:
    given = [effect(function, name=function.__name__) for function in (*BESIDE.values(), drag)]
    with np.errstate(all="ignore"):
        found = list(check_effects(given, AXIS))
    for point, function in (*BESIDE.items(), ("", drag)):
        missed = failed(found_point for name, found_point in found if name == function.__name__)
        assert point in missed if point else missed == {}, point


@pytest.mark.slow
def test_an_effect_that_does_not_vanish_at_null_is_found() -> None:
    assert "null law" in failed(check_effect(effect(shaped, LEVEL, Parameter("width", "1", 0.0, 1.0)), AXIS))


def test_an_effect_that_does_not_compile_is_found() -> None:
    assert "compiles" in failed(check_effect(effect(uncompilable), AXIS))


@pytest.mark.parametrize(("point", "given"), DECLARED.items())
def test_an_effect_misses_a_point_of_its_declaration(point: str, given: Effect) -> None:
    assert point in failed(check_effect(given, {} if point != "binds" else AXIS))
    assert point != "binds" or "altitude" in failed(check_effect(given, AXIS))["binds"]


def test_silence_is_said_and_only_the_catalogue_fails_for_it() -> None:
    silent = effect(lambda omega, level: -level * omega, states=(State("x", "1", drag, lambda: 0.0),))
    said = next(f for f in check_effect(silent, {}) if f.name == "documented")
    assert said.passed
    assert said.sentence == "no docstring: own__torque, initial__own__x"
    assert "documented" in failed(check_effect(silent, {}, strict=True))


@pytest.mark.slow
def test_a_plant_misses_points() -> None:
    def never(mass):
        """A guard of what does not move."""
        return mass

    def later(v):
        """A switch that nobody asks for."""
        return v - 0.1

    axis = AXIS["driven_axis"]
    broken = replace(
        axis,
        guards=(Guard("never", never), Guard("later", later, latch=True)),
        parameters=(replace(axis.parameters[0], unit="", nominal=9.0),),
    )
    points = failed(check_plant(broken))
    assert set(points) == {"guards", "units", "values"}
    assert points["guards"] == "nothing depends on guard never, later, or it never moves"


def test_a_plant_that_does_not_bind_is_told_so() -> None:
    axis = AXIS["driven_axis"]
    broken = replace(axis, quantities={**axis.quantities, "drive_effort": lambda gain, voltage: gain})
    assert set(failed(check_plant(broken))) == {"binds"}


def test_a_plant_that_runs_away_is_told_so() -> None:
    axis = AXIS["driven_axis"]

    def push(gain, u, v):
        """Effort that grows with speed."""
        return gain * u + 1e5 * v**3

    assert "finite" in failed(check_plant(replace(axis, quantities={**axis.quantities, "drive_effort": push})))


def ranks(measured, simulated):
    """Places among the candidates."""
    return np.argsort(np.argsort(np.abs(simulated - measured).sum(axis=1))).astype(float)


def changes(measured, simulated):
    """Overwrite what is given."""
    simulated -= measured
    return np.abs(simulated).sum(axis=1)


def drawn(measured, simulated):
    """Add noise."""
    return np.abs(simulated - measured).sum(axis=1) + np.random.default_rng().random(len(simulated))


def total(measured, simulated):
    """One value for all."""
    return np.abs(simulated - measured).sum()


def endless(measured, simulated):
    """Infinite where the misfit is large."""
    misfit = np.abs(simulated - measured).max(axis=1)
    return np.where(misfit > 0.5, np.inf, misfit)


def upside_down(measured, simulated):
    """Least where the misfit is largest."""
    return -np.abs(simulated - measured).max(axis=1)


FITNESS_BROKEN = {
    "others untouched": ranks, "leaves its arguments alone": changes, "deterministic": drawn,
    "one value per candidate": total, "finite": endless, "least at a perfect match": upside_down,
}  # fmt: skip


@pytest.mark.parametrize(("point", "function"), FITNESS_BROKEN.items())
def test_a_fitness_misses_a_point(point: str, function: Callable[..., Any]) -> None:
    assert point in failed(check_fitness(Fitness("own", function)))


class Global(DE):  # type: ignore[misc]
    """Differential evolution that starts where the global generators say."""

    def _initialize_infill(self) -> Any:
        found = super()._initialize_infill()
        found[0].X = self.problem.xl + random.random() * (self.problem.xu - self.problem.xl)
        return found


class Outside(DE):  # type: ignore[misc]
    """Differential evolution that starts beside the box."""

    def _initialize_infill(self) -> Any:
        found = super()._initialize_infill()
        found[0].X = self.problem.xu + 1.0
        return found


class Swallowing(DE):  # type: ignore[misc]
    """Differential evolution that takes an error of the problem for an end."""

    def next(self) -> None:
        with suppress(Exception):
            return super().next()
        self.termination.terminate()
        self.termination.update(self)


class Leaving(DE):  # type: ignore[misc]
    """Differential evolution that leaves a thread behind."""

    def _setup(self, problem: Any, **options: Any) -> None:
        super()._setup(problem, **options)
        Thread(target=sleep, args=(1.0,), daemon=True).start()


class Poisoned(DE):  # type: ignore[misc]
    """Differential evolution that stops at the first NaN."""

    def _initialize_advance(self, infills: Any = None, **options: Any) -> None:
        super()._initialize_advance(infills, **options)
        if np.isnan(infills.get("F")).any():
            self.termination.terminate()


@pytest.mark.parametrize(("kind", "point"), [
    (Swallowing, "errors come out"), (Leaving, "errors come out"), (Poisoned, "survives NaN"),
])  # fmt: skip
def test_an_identifier_misses_one_point(kind: type[DE], point: str) -> None:
    assert set(failed(check_identifier(as_identifier("own", kind)))) == {point}


def test_an_identifier_misses_points() -> None:
    random.seed(5)
    state = random.getstate()
    assert set(failed(check_identifier(as_identifier("own", DE)))) == set()
    # the global generators are left alone
    assert random.getstate() == state
    assert "reproducible" in failed(check_identifier(as_identifier("own", Global)))
    assert "inside the box" in failed(check_identifier(as_identifier("own", Outside)))
    declared = replace(as_identifier("own", DE), is_stochastic=False)
    assert set(failed(check_identifier(declared))) == {"seed"}


def test_an_identifier_that_forgets_its_seed_is_found() -> None:
    missed = set(failed(check_identifier(as_identifier("pattern", lambda budget: PatternSearch()))))
    assert missed & {"reproducible", "survives failures", "survives NaN"}
