"""All effects in one compiled model of a plant: in pairs and all at once; each alone is tried by tests/contract.

An effect at its null adds exactly nothing (tested), so one compiled model serves for each effect: all but it are at
their nulls. The judge is scipy on the plain functions of the plant with these effects alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest
from numpy.typing import NDArray

from armid.contract.trials import away, middle, simulate_plainly
from armid.engine import Schedule, simulate
from armid.model import EFFECTS, PLANTS, Effect, Manoeuvre, Model, applicable
from armid.model.plants.driven_axis import linear_axis, rotary_axis

Array = NDArray[np.float64]
ARM = PLANTS["shell_transfer_arm"]
# Fine enough that the engine is within 1e-7 rad/s of the truth, but for the brushes' width.
FINE_STEPS, AGREES, AWAY = Schedule(24), 5e-6, 0.3
PAIRS = [("arm", "stribeck"), ("arm", "shell_rocking"), ("arm", "controller_delay"), ("arm", "worm_direction"),
         ("arm", "gas_heat_loss"), ("axis", "asymmetric_viscous"), ("axis", "drive_gain"), ("axis", "output_lag"),
         ("axis", "load_friction")]  # fmt: skip


@dataclass(frozen=True)
class Whole:
    """A plant with every effect that it takes, and one manoeuvre."""

    model: Model
    manoeuvre: Manoeuvre
    own: dict[str, float]

    def candidate(self, model: Model, values: Array | None = None) -> Array:
        """Return the candidate of this model that moves as that one: effects that it has not are at their nulls."""
        known = {} if values is None else dict(zip(model.parameters, values, strict=True))
        nominal = {n: middle(p) if p.null is None else p.null for n, p in self.model.parameters.items()}
        return np.array(list((nominal | known | self.own).values()))

    def alone(self, *effects: Effect) -> Model:
        return Model(self.model.plant, effects)

    def values(self, model: Model, candidate: Array) -> Array:
        """Return the part of a candidate that a smaller model has."""
        known = dict(zip(self.model.parameters, candidate, strict=True))
        return np.array([known[name] for name in model.parameters])

    def moved(self, candidates: Array) -> Array:
        """Return the signals of candidates, (n_candidates, n_samples); none may fail."""
        run = simulate(self.model, self.manoeuvre, candidates, FINE_STEPS)
        assert not run.failed.any()
        return run.output

    @cached_property
    def still(self) -> Array:
        return self.moved(self.candidate(self.model)[np.newaxis])[0]

    def misses(self, *effects: Effect) -> float:
        """Return the largest difference to scipy with some effects away from null."""
        model = self.alone(*effects)
        candidate = self.candidate(self.model)
        for effect in effects:
            moved = self.candidate(self.alone(effect), away(self.alone(effect), effect, AWAY))
            candidate = np.where(moved != self.candidate(self.model), moved, candidate)
        plain = simulate_plainly(model, self.manoeuvre, self.values(model, candidate))[0]
        assert np.abs(plain - self.still).max() > 1e-3
        return float(np.abs(self.moved(candidate[np.newaxis])[0] - plain).max())


def whole_arm() -> Whole:
    """Lowering with the shell, the switch at 0.578 s, to 0.75 s."""
    return Whole(Model(ARM, tuple(applicable(EFFECTS, ARM).values())), Manoeuvre(5e-3, 151), {})


def whole_axis() -> Whole:
    """A light hanging axis under a sine that turns it over twice; all scales are 1."""
    times = 5e-3 * np.arange(201)
    manoeuvre = Manoeuvre(5e-3, 201, {"gravity_moment": 0.4, "start_speed": 0.1}, {"u": 0.1 + 0.5 * np.sin(9 * times)})
    return Whole(Model(linear_axis, tuple(applicable(EFFECTS, linear_axis).values())), manoeuvre, {"mass": 0.06})


@pytest.fixture(scope="module")
def whole() -> Callable[[str], Whole]:
    """Return a function that gives the plant with everything; each is made once."""
    made: dict[str, Whole] = {}

    def get(where: str) -> Whole:
        if where not in made:
            made[where] = whole_arm() if where == "arm" else whole_axis()
        return made[where]

    return get


@pytest.mark.slow
@pytest.mark.parametrize(("where", "name"), PAIRS)
def test_pairs_compose(whole, where, name):
    assert whole(where).misses(EFFECTS["coulomb"], EFFECTS[name]) <= AGREES


@pytest.mark.slow
@pytest.mark.parametrize("where", ["arm", "axis"])
def test_all_at_once_move_as_their_plain_functions(whole, where):
    w = whole(where)
    candidate = w.candidate(w.model)
    for effect in w.model.effects:
        moved = w.candidate(w.alone(effect), away(w.alone(effect), effect, 0.03))
        candidate = np.where(moved != w.candidate(w.model), moved, candidate)
    plain = simulate_plainly(w.model, w.manoeuvre, candidate)[0]
    assert np.abs(w.moved(candidate[np.newaxis])[0] - plain).max() <= AGREES


@pytest.mark.slow
def test_some_of_their_own_move_as_within_the_whole(whole):
    """Compiled apart, with few effects only, and in the other order; linear and rotary are the same equations."""
    w = whole("axis")
    few = Model(rotary_axis, (EFFECTS["quadratic_drag"], EFFECTS["output_lag"], EFFECTS["coulomb"]))
    for effect in few.effects[:2]:
        values = dict(zip(few.parameters, away(few, effect, AWAY), strict=True))
        values |= {"inertia": w.own["mass"], "coulomb.level": 0.05}
        within = w.candidate(w.alone()) * 1.0
        for i, key in enumerate(w.model.parameters):
            within[i] = values.get(key, within[i])
        apart = simulate(few, w.manoeuvre, np.array([list(values.values())]), FINE_STEPS).output[0]
        assert np.abs(apart - w.moved(within[np.newaxis])[0]).max() <= 1e-9
