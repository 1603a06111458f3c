"""Each point of a contract is missed by something: here is what misses it."""

import random
import re
from contextlib import suppress
from dataclasses import replace
from threading import Thread
from time import sleep

import numpy as np
import pytest
from pymoo.algorithms.soo.nonconvex.de import DE
from pymoo.algorithms.soo.nonconvex.pattern import PatternSearch

from armid.contract.check import check_fitness, check_identifier
from armid.contract.equations import check_effect, check_effects, check_plant
from armid.errors import ArmidError
from armid.identifiers import as_identifier
from armid.model import PLANTS, Effect, Guard, Parameter, State
from armid.problem.fitness import Fitness

AXIS = {"driven_axis": replace(PLANTS["driven_axis"], variants=())}
LEVEL = Parameter("level", "effort", 0.0, 1.0, null=0.0)


def drag(omega, level):
    """Friction in proportion to speed."""
    return -level * omega


def failed(points):
    """Name -> sentence of the points that do not hold, without the plant's name."""
    findings = list(points)
    assert all(f.sentence and "\n" not in f.sentence for f in findings)
    return {f.name.split(" on driven")[0].split(", driven")[0]: f.sentence for f in findings if not f.passed}


def effect(function=drag, *parameters, name="own", **more):
    return Effect(name, parameters or (LEVEL,), {"torque": function}, **more)


def branching(omega, level):
    """Statements that arrays cannot take."""
    if omega > 0:
        return -level * omega
    return -0.5 * level * omega


# Each vanishes at null, so that one compiled model serves for all of them.
# The last is Coulomb friction as it is written on paper: at rest it jumps to and fro, and no guard says so.
BESIDE = {
    "acts": lambda omega, level: 0.0 * level * omega,
    "responds": lambda omega, level: -50.0 * level**2 * omega,
    "finite": lambda omega, level: 1e6 * level * omega**3 + 1e3 * level,
    "on arrays": branching,
    "compiled": lambda omega, level: -level * np.sign(omega),
}
DECLARED = {
    "bounds": effect(drag, replace(LEVEL, low=-1e308, high=float("inf"))),
    "values": effect(drag, replace(LEVEL, low=0.1, high=0.5)),
    "null values": effect(drag, replace(LEVEL, null=None, nominal=0.0)),
    "units": effect(drag, replace(LEVEL, unit=" ")),
    "binds": effect(lambda altitude, level: altitude),
}


@pytest.mark.nightly
def test_effects_miss_points_beside_others_that_keep_them():
    named = {f"own_{i}": pair for i, pair in enumerate((*BESIDE.items(), ("", drag)))}
    with np.errstate(all="ignore"):
        found = list(check_effects([effect(function, name=name) for name, (_, function) in named.items()], AXIS))
    for own, (point, _) in named.items():
        missed = failed(found_point for name, found_point in found if name == own)
        assert point in missed if point else missed == {}, point


@pytest.mark.slow
def test_an_effect_that_does_not_vanish_at_null_is_found():
    shaped = effect(lambda omega, level, width: -level * omega + (0.001 if width > 0.9 else 0.0), LEVEL,
                    Parameter("width", "1", 0.0, 1.0))  # fmt: skip
    assert "null law" in failed(check_effect(shaped, AXIS))


@pytest.mark.parametrize(("point", "given"), DECLARED.items())
def test_an_effect_misses_a_point_of_its_declaration(point, given):
    assert point in failed(check_effect(given, {} if point != "binds" else AXIS))
    assert point != "binds" or "altitude" in failed(check_effect(given, AXIS))["binds"]


def test_silence_is_said_and_is_no_fault_and_what_does_not_compile_is_found():
    silent = effect(lambda omega, level: -level * omega, states=(State("x", "1", drag, lambda: 0.0),))
    said = next(f for f in check_effect(silent, {}) if f.name == "documented")
    assert said.passed
    assert said.sentence == "no docstring: own__torque, initial__own__x"
    assert "compiles" in failed(check_effect(effect(lambda omega, level: level * np.linalg.norm(omega)), AXIS))


@pytest.mark.slow
def test_a_plant_misses_points():
    axis = AXIS["driven_axis"]
    broken = replace(
        axis,
        guards=(Guard("never", lambda mass: mass), Guard("later", lambda v: v - 0.1, latch=True)),
        parameters=(replace(axis.parameters[0], unit="", nominal=9.0),),
    )
    points = failed(check_plant(broken))
    assert set(points) == {"guards", "units", "values"}
    assert points["guards"] == "nothing depends on guard never, later, or it never moves"


@pytest.mark.parametrize(("point", "drive"), [
    ("binds", lambda gain, voltage: gain), ("finite", lambda gain, u, v: gain * u + 1e5 * v**3),
])  # fmt: skip
def test_a_plant_that_does_not_bind_or_runs_away_is_told_so(point, drive):
    axis = AXIS["driven_axis"]
    assert point in failed(check_plant(replace(axis, quantities={**axis.quantities, "drive_effort": drive})))


def misfit(measured, simulated):
    return np.abs(simulated - measured).max(axis=1)


def changes(measured, simulated):
    """Overwrite what is given."""
    simulated -= measured
    return np.abs(simulated).sum(axis=1)


FITNESS_BROKEN = {
    "others untouched": lambda measured, simulated: np.argsort(np.argsort(misfit(measured, simulated))).astype(float),
    "leaves its arguments alone": changes,
    "deterministic": lambda measured, simulated: misfit(measured, simulated) + np.random.default_rng().random(),
    "one value per candidate": lambda measured, simulated: misfit(measured, simulated).sum(),
    "finite": lambda measured, simulated: np.where(misfit(measured, simulated) > 0.5, np.inf, 0.0),
    "least at a perfect match": lambda measured, simulated: -misfit(measured, simulated),
}


@pytest.mark.parametrize(("point", "function"), FITNESS_BROKEN.items())
def test_a_fitness_misses_a_point(point, function):
    assert point in failed(check_fitness(Fitness("own", function)))


class Beginning(DE):
    """Differential evolution whose first candidate comes from elsewhere."""

    def __init__(self, first):
        super().__init__()
        self.first = first

    def _initialize_infill(self):
        found = super()._initialize_infill()
        found[0].X = self.first(self.problem)
        return found


class Swallowing(DE):
    """Differential evolution that takes an error of the problem for an end."""

    def next(self):
        with suppress(Exception):
            return super().next()
        self.termination.terminate()
        self.termination.update(self)


class Leaving(DE):
    """Differential evolution that leaves a thread behind."""

    def _setup(self, problem, **options):
        super()._setup(problem, **options)
        Thread(target=sleep, args=(1.0,), daemon=True).start()


class Poisoned(DE):
    """Differential evolution that stops at the first NaN."""

    def _initialize_advance(self, infills=None, **options):
        super()._initialize_advance(infills, **options)
        if np.isnan(infills.get("F")).any():
            self.termination.terminate()


@pytest.mark.parametrize(("kind", "point"), [
    (Swallowing, "errors come out"), (Leaving, "errors come out"), (Poisoned, "survives NaN"),
])  # fmt: skip
def test_an_identifier_misses_one_point(kind, point):
    assert set(failed(check_identifier(as_identifier("own", kind)))) == {point}


def test_an_identifier_misses_points():
    random.seed(5)
    state = random.getstate()
    assert set(failed(check_identifier(as_identifier("own", DE)))) == set()
    # the global generators are left alone
    assert random.getstate() == state
    # a start where the global generators say, and one on the far side of the box
    for point, first in (("reproducible", lambda box: box.xl + random.random() * (box.xu - box.xl)),
                         ("inside the box", lambda box: box.xu + 1.0)):  # fmt: skip
        assert point in failed(check_identifier(as_identifier("own", lambda budget, first=first: Beginning(first))))
    declared = replace(as_identifier("own", DE), is_stochastic=False)
    assert set(failed(check_identifier(declared))) == {"seed"}
    missed = set(failed(check_identifier(as_identifier("pattern", lambda budget: PatternSearch()))))
    assert missed & {"reproducible", "survives failures", "survives NaN"}


def test_a_search_of_a_user_that_leaves_the_box_or_asks_for_nothing_is_told_so():
    def unit(value, low, high, random):
        """Take the box for the unit cube."""
        while True:
            value(random.random((8, len(low))))

    points = failed(check_identifier(as_identifier("unit", unit)))
    assert re.match(r"'unit' asked for \d+ candidates outside `low` to `high`", points["inside the box"])
    points = failed(check_identifier(as_identifier("never", lambda value: None)))
    assert points == {"exact budget": "0 of 403 simulations used: it asked for no candidate"}
    with pytest.raises(ArmidError, match=r"an array of shape \(3, 1\), one candidate \(3,\) or several"):
        failed(check_identifier(as_identifier("column", lambda value, low: value(low[:, None]))))
