"""Every registered plant, effect, fitness and identifier keeps its contract; what judges the engine is right itself."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest

from arm_cases import REFERENCE, candidate_of, index_rows, manoeuvre_of
from armid.contract.check import check_identifier, check_thing
from armid.contract.equations import check_effects
from armid.contract.trials import simulate_plainly
from armid.identifiers import IDENTIFIERS, identifier_of
from armid.model import PLANTS, Effect, Guard, Manoeuvre, Model, Parameter, State
from armid.problem.fitness import FITNESS
from commands import python
from smallest_plants import tried_on

ARM = PLANTS["shell_transfer_arm"]
AXIS = replace(PLANTS["driven_axis"].for_unit("m/s"), variants=())
LONG = ("shell_transfer_arm_elastic", "flexible_link")
COMPOSED = ("pso+least_squares", "multistart:bobyqa", "random+multistart:slsqp", "pymoo_pso+cobyla+sbplx")


def failures(findings):
    assert findings
    return [f"{f.name}: {f.sentence}" for f in findings if not f.passed]


@pytest.mark.parametrize(("kind", "name", "thing"), [
    pytest.param(kind, name, thing, id=f"{kind}-{name}", marks=[pytest.mark.slow] if name in LONG else [])
    for kind, things in (("plants", PLANTS), ("fitness", FITNESS), ("identifiers", IDENTIFIERS))
    for name, thing in things.items() if not getattr(thing, "package", "")
] + [("identifiers", name, identifier_of(name, IDENTIFIERS)) for name in COMPOSED])  # fmt: skip
def test_registered_things_keep_their_contract(kind, name, thing):
    found = list(check_thing(kind, name, thing))
    assert failures(found) == []
    if name == "driven_axis":
        assert {f.name.split(", ")[1] for f in found} == {"driven_axis in m/s", "driven_axis in rad/s"}


@pytest.mark.nightly
@pytest.mark.parametrize("name", [name for name, i in IDENTIFIERS.items() if i.package])
def test_identifiers_of_other_libraries_keep_their_contract(name, monkeypatch):
    pytest.importorskip(IDENTIFIERS[name].package)
    monkeypatch.setattr("armid.contract.check.TRIAL_BUDGET", 140)
    assert failures(check_identifier(IDENTIFIERS[name])) == []


# The effects in one compiled model of a plant, all but one at their nulls.
@pytest.mark.nightly
@pytest.mark.parametrize("plant", [AXIS, ARM, PLANTS["flexible_link"]], ids=["axis", "arm", "link"])
def test_every_effect_keeps_its_contract(plant):
    effects = tried_on(plant)
    found = list(check_effects(effects, {plant.name: plant}))
    documented = {f.sentence for _, f in found if f.name.startswith("documented")}
    assert documented == {"every function has a docstring"}
    assert {name for name, _ in found} == {e.name for e in effects}
    assert [(name, f) for name, f in found if not f.passed] == []
    forms = {(name, f.name.partition(" in the form ")[2]) for name, f in found}
    assert forms == {(e.name, form.form) for e in effects for form in e.every_form}
    points = {f.name.split(" on ")[0].split(" in ")[0] for name, f in found if name == effects[0].name}
    assert points >= {"binds", "null values", "documented", "printed", "null law", "acts", "responds", "finite",
                      "deterministic", "compiled"}  # fmt: skip


OWN = [n for n, i in IDENTIFIERS.items() if not i.package]
NAMES = (*OWN, "pso+bobyqa", "de+nelder_mead+sbplx", "cmaes+least_squares", "multistart:lbfgs")
SCRIPT = """
import hashlib, json, sys
from armid.contract.check import TRIAL_BUDGET, Trial, run
from armid.identifiers import IDENTIFIERS, identifier_of
from armid.problem.meter import Meter
found = {}
for name in sys.argv[1:]:
    log = run(identifier_of(name, IDENTIFIERS), 7, Trial(Meter(TRIAL_BUDGET), holes=True))[0].log()
    found[name] = hashlib.sha256(log.X.tobytes() + log.F.tobytes()).hexdigest()
print(json.dumps(found))
"""


def logs(hash_seed):
    """Fingerprint of each identifier's log, from a process of its own."""
    done = python("-c", SCRIPT, *NAMES, env=os.environ | {"PYTHONHASHSEED": hash_seed})
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_two_processes_ask_for_the_same():
    first, second = logs("1"), logs("2")
    assert set(first) == set(NAMES)
    # bipop_cmaes is cmaes until its first restart, which this budget does not reach.
    assert first.pop("bipop_cmaes") == first["cmaes"]
    assert len(set(first.values())) == len(first)
    assert second == first | {"bipop_cmaes": first["cmaes"]}


TIMES = 0.01 * np.arange(151)


@pytest.mark.parametrize("number", [0, 1, 6])
def test_agrees_with_reference_trajectories(number):
    row = index_rows()[number]
    expected = np.loadtxt(REFERENCE / row["file"], delimiter=",", skiprows=1)[:801:4, 2]
    found = simulate_plainly(Model(PLANTS["shell_transfer_arm"]), manoeuvre_of(row, 0.004, 201), candidate_of(row))[0]
    assert np.abs(found - expected).max() <= 2e-8


COASTING = Manoeuvre(0.01, 151, {"start_speed": 0.9}, {"u": np.zeros(151)})


def test_switches_once_between_samples_lands_on_kinks_and_carries_added_states():
    late = Effect("late", (Parameter("level", "effort", 0, 9, null=0.0),), {"torque": lambda on, level: -level * on},
                  guards=(Guard("on", lambda time: 0.503 - time, latch=True),))  # fmt: skip
    found = simulate_plainly(Model(PLANTS["driven_axis"]) + late, COASTING, np.array([3.0, 6.0]))[0]
    np.testing.assert_allclose(found, 0.9 - 2.0 * np.maximum(TIMES - 0.503, 0.0), atol=1e-9)
    # Above 0.7 the speed falls exponentially to it and never arrives.
    bent = Effect("bent", (Parameter("level", "effort", 0, 9, null=0.0),),
                  {"torque": lambda v, level: -level * np.maximum(v - 0.7, 0.0)},
                  (State("way", "m", lambda v: v, lambda: 0.0),), (Guard("edge", lambda v: v - 0.7),))  # fmt: skip
    found = simulate_plainly(Model(PLANTS["driven_axis"]) + bent, COASTING, np.array([3.0, 6.0]))[0]
    np.testing.assert_allclose(found, 0.7 + 0.2 * np.exp(-2.0 * TIMES), atol=1e-9)
