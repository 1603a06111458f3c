"""Every registered plant, effect, fitness and identifier keeps its contract."""

from dataclasses import replace

import pytest

from armid.contract.check import check_thing
from armid.contract.equations import check_effect, check_effects
from armid.contract.identifier import check_identifier
from armid.identifiers import IDENTIFIERS, identifier_of
from armid.model import EFFECTS, PLANTS, applicable
from armid.problem.fitness import FITNESS

ARM = PLANTS["shell_transfer_arm"]
AXIS = replace(PLANTS["driven_axis"].for_unit("m/s"), variants=())
COMPOSED = (
    "pso+bobyqa", "de+nelder_mead", "pso+least_squares", "cmaes+least_squares", "multistart:bobyqa",
    "multistart:least_squares", "random+multistart:slsqp", "pymoo_pso+cobyla+sbplx",
)  # fmt: skip


def failures(findings):
    assert findings
    return [f"{f.name}: {f.sentence}" for f in findings if not f.passed]


@pytest.mark.parametrize(("kind", "name", "thing"), [
    pytest.param(kind, name, thing, id=f"{kind}-{name}")
    for kind, things in (("plants", PLANTS), ("fitness", FITNESS), ("identifiers", IDENTIFIERS))
    for name, thing in things.items()
])  # fmt: skip
def test_registered_things_keep_their_contract(kind, name, thing):
    found = check_thing(kind, name, thing)
    assert failures(found) == []
    if name == "driven_axis":
        assert {f.name.split(", ")[1] for f in found} == {"driven_axis in m/s", "driven_axis in rad/s"}


# All effects in one compiled model of a plant, all but one at their nulls.
@pytest.mark.slow
@pytest.mark.parametrize("plant", [ARM, AXIS], ids=["arm", "axis"])
def test_every_effect_keeps_its_contract(plant):
    effects = list(applicable(EFFECTS, plant).values())
    found = check_effects(effects, {plant.name: plant}, strict=True)
    assert {e.name: failures(points) for e, points in zip(effects, found, strict=True) if failures(points)} == {}
    points = {f.name.split(" on ")[0].split(" in ")[0] for f in found[0]}
    assert points >= {"binds", "null values", "documented", "printed", "null law", "acts", "responds", "finite",
                      "deterministic", "compiled"}  # fmt: skip


@pytest.mark.slow
def test_one_effect_keeps_its_contract_by_itself():
    """As `armid check` tries it: compiled alone, in each of its forms."""
    found = check_effect(EFFECTS["worm_speed"], {"driven_axis": AXIS}, strict=True)
    assert failures(found) == []
    assert {f.name.rpartition(" in the form ")[2] for f in found} == {f.form for f in EFFECTS["worm_speed"].every_form}


@pytest.mark.parametrize("name", COMPOSED)
def test_composed_identifiers_keep_their_contract(name):
    assert failures(check_identifier(identifier_of(name, IDENTIFIERS))) == []
