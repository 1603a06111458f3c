"""Every registered plant, effect, fitness and identifier keeps its contract; what breaks one is found."""

from dataclasses import replace

import numpy as np
import pytest

from armid.contract import check_effect, check_fitness, check_identifier, check_plant, check_thing
from armid.fitness import FITNESS, Fitness
from armid.identifiers import IDENTIFIERS
from armid.model import EFFECTS, PLANTS, Effect, Parameter

# Compiling takes some 15 s an effect, so all but one of them are left to continuous integration.
LATER = [name for name in EFFECTS if name != "coulomb"]
AXIS = {"driven_axis": replace(PLANTS["driven_axis"], variants=())}
ALL = [
    pytest.param(kind, name, thing, id=f"{kind}-{name}", marks=[pytest.mark.slow] if name in LATER else [])
    for kind, things in (
        ("plants", PLANTS), ("effects", EFFECTS), ("fitness", FITNESS), ("identifiers", IDENTIFIERS),
    ) for name, thing in things.items()
]  # fmt: skip


def failures(findings):
    assert findings
    return [f"{f.name}: {f.sentence}" for f in findings if not f.passed]


@pytest.mark.parametrize(("kind", "name", "thing"), ALL)
def test_registered_things_keep_their_contract(kind, name, thing):
    assert failures(check_thing(kind, name, thing)) == []


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
