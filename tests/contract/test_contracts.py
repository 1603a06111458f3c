"""Every registered plant, effect, fitness and identifier keeps its contract; what breaks one is found."""

from dataclasses import replace

import numpy as np
import pytest

from armid.contract.check import check_thing
from armid.contract.effect import check_effect
from armid.contract.fitness import check_fitness
from armid.contract.identifier import check_identifier
from armid.contract.plant import check_plant
from armid.identifiers import IDENTIFIERS, identifier_of
from armid.model import EFFECTS, PLANTS, Effect, Parameter, applicable
from armid.problem.fitness import FITNESS, Fitness

# Compiling takes some 10 s an effect and plant, so all but one of them are left to continuous integration. What every
# effect keeps is tried on one compiled model of all of them (tests/model/effects); here, whole, one of each kind: a
# plain torque, states, a switch with states, and two forms.
WHOLE = ("coulomb", "gyro_lag", "controller_delay", "flux_saturation")
LATER = [name for name in EFFECTS if name != "coulomb"]
ROTARY = PLANTS["driven_axis"].for_unit("rad/s")
AXIS = {"driven_axis": replace(PLANTS["driven_axis"], variants=())}
COMPOSED = (
    "pso+bobyqa", "de+nelder_mead", "pso+least_squares", "cmaes+least_squares", "multistart:bobyqa",
    "multistart:least_squares", "random+multistart:slsqp", "pymoo_pso+cobyla+sbplx",
)  # fmt: skip
ALL = [
    pytest.param(kind, name, thing, id=f"{kind}-{name}", marks=[pytest.mark.slow] if name in LATER else [])
    for kind, things in (
        ("plants", PLANTS), ("effects", {name: EFFECTS[name] for name in WHOLE}), ("fitness", FITNESS),
        ("identifiers", IDENTIFIERS),
    ) for name, thing in things.items()
]  # fmt: skip


def failures(findings):
    assert findings
    return [f"{f.name}: {f.sentence}" for f in findings if not f.passed]


@pytest.mark.parametrize(("kind", "name", "thing"), ALL)
def test_registered_things_keep_their_contract(kind, name, thing):
    assert failures(check_thing(kind, name, thing)) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, e in applicable(EFFECTS, ROTARY).items() if name not in WHOLE])
def test_effects_of_any_shaft_keep_their_contract_on_an_axis(name):
    assert failures(check_effect(EFFECTS[name], {"driven_axis": ROTARY}, strict=True)) == []


@pytest.mark.parametrize("name", COMPOSED)
def test_composed_identifiers_keep_their_contract(name):
    assert failures(check_identifier(identifier_of(name, IDENTIFIERS))) == []


def test_effect_that_does_not_vanish_at_null_is_found():
    def torque(omega, slope):
        """Friction with an offset."""
        return -slope * omega - 1.0

    stubborn = Effect("stubborn", (Parameter("slope", "effort/speed", 0, 0.1, null=0.0),), {"torque": torque})
    assert any("null law" in text for text in failures(check_effect(stubborn, AXIS)))


def test_effect_that_fits_nothing_is_found():
    lost = Effect("lost", (Parameter("c", "1", 0, 1, null=0.0),), {"torque": lambda altitude, c: c * altitude})
    assert any("binds" in text and "altitude" in text for text in failures(check_effect(lost, PLANTS)))


def test_fitness_that_prefers_a_misfit_is_found():
    upside_down = Fitness("upside_down", lambda measured, simulated: -np.abs(simulated - measured).max(axis=1))
    assert any("perfect match" in text for text in failures(check_fitness(upside_down)))


def test_identifier_that_forgets_its_seed_is_found():
    from pymoo.algorithms.soo.nonconvex.pattern import PatternSearch

    from armid.identifiers import as_identifier

    findings = check_identifier(as_identifier("pattern", lambda budget: PatternSearch()))
    assert any("reproducible" in text or "survives" in text for text in failures(findings))


def test_plant_contract_reports_every_sibling():
    names = {f.name.split(", ")[1] for f in check_plant(PLANTS["driven_axis"])}
    assert names == {"driven_axis in m/s", "driven_axis in rad/s"}
