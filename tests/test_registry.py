"""What there is to choose from: catalogues, entry points, files of a user."""

import sys
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints

import numpy as np
import pytest
from pymoo.algorithms.soo.nonconvex.de import DE

from armid import registry
from armid.errors import ArmidError
from armid.identifiers import Identifier
from armid.model import Effect, Model, Parameter
from armid.model.plants.driven_axis import driven_axis
from armid.problem.fitness import Fitness
from armid.registry import Registry, load_plugin, load_registry
from armid.study.spec import study_registry
from commands import refusing

LEVEL = (Parameter("c", "effort", 0.0, 0.5, null=0.0),)
OWN = """\
from dataclasses import replace

from armid import Effect, Fitness, Identifier, Parameter
from armid.model.plants.driven_axis import driven_axis
from pymoo.algorithms.soo.nonconvex.de import DE

import beside_it


def drag(omega, c):
    return -c * omega


def largest(measured, simulated):
    return abs(simulated - measured).max(axis=1)


def search(budget):
    return DE(pop_size=20)


plant = replace(driven_axis, name="my_axis")
effect = Effect("drag", (Parameter("c", "effort", 0.0, 0.5, null=0.0),), {"torque": drag})
fitness = Fitness("my_fitness", largest, "samples")
identifier = Identifier("my_search", search)
coulomb = Effect("coulomb", (Parameter("c", "effort", 0.0, 0.5, null=0.0),), {"torque": drag})
pso = search
rmse = largest
text = "none of ours"
"""


def torque(omega, c):
    return -c * omega


def worst(measured, simulated):
    return np.abs(simulated - measured).max(axis=1)


effect = Effect("damper", LEVEL, {"torque": torque})
AXIS = replace(driven_axis, name="other_axis")


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    (folder / "own.py").write_text(OWN)
    (folder / "beside_it.py").write_text("there = True\n")
    return folder / "own.py"


@pytest.fixture
def installed(monkeypatch):
    """Return a function that makes entry points of a distribution: group, name, what it names in this file."""

    def install(*points):
        made = EntryPoints(EntryPoint(name, f"{__name__}:{thing}", f"armid.{kind}") for kind, name, thing in points)
        monkeypatch.setattr(registry, "entry_points", lambda: made)

    return install


@pytest.mark.parametrize(("attribute", "kind", "name"), [
    ("plant", "plants", "my_axis"), ("effect", "effects", "drag"), ("fitness", "fitness", "my_fitness"),
    ("largest", "fitness", "largest"), ("identifier", "identifiers", "my_search"), ("search", "identifiers", "search"),
    ("DE", "identifiers", "DE"),
])  # fmt: skip
def test_a_file_registers_all_four_kinds(own, attribute, kind, name):
    assert load_plugin(f"{own}:{attribute}")[:2] == (kind, name)
    assert getattr(load_registry([f"{own}:{attribute}"]), kind)[name].name == name


def test_what_is_registered_is_ready_to_use_and_catalogues_stay_as_they_are(own):
    loaded = load_registry(f"{own}:{name}" for name in ("effect", "largest", "search", "plant"))
    assert isinstance(loaded.fitness["largest"], Fitness)
    assert isinstance(loaded.identifiers["search"], Identifier)
    assert isinstance(loaded.identifiers["search"].build(100), DE)
    assert "drag.c" in (Model(loaded.plants["my_axis"]) + loaded.effects["drag"]).parameters
    assert load_plugin(f"{own}:effect")[2] is load_plugin(f"{own}:effect")[2]
    assert "drag" not in Registry().effects


def test_a_file_that_has_changed_is_run_again_and_what_it_imports_counts_as_its_content(tmp_path):
    """Equations are read from the file: those of the module must be the same."""
    file = tmp_path / "edited.py"
    file.write_text(OWN)
    before = load_plugin(f"{file}:effect")[2]
    file.write_text("# a line more\n\n" + OWN.replace("drag", "other_drag"))
    after = load_plugin(f"{file}:effect")[2]
    assert (before.name, after.name) == ("drag", "other_drag")
    assert "other_drag.c" in (Model(driven_axis) + after).parameters
    (tmp_path / "whole.py").write_text(OWN.replace("import beside_it", "import beside_that"))
    digests = []
    for text in ("there = 1\n", "there = 2\n"):
        (tmp_path / "beside_that.py").write_text(text)
        digests.append(study_registry([f"{tmp_path / 'whole.py'}:effect"]).digests["effects drag"])
    assert digests[0] != digests[1]


@pytest.mark.parametrize(("attribute", "sentence"), [
    ("coulomb", "effects: 'coulomb' is there already"), ("pso", "identifiers: 'pso' is there already"),
    ("rmse", "fitness: 'rmse' is there already"), ("effect", "effects: 'drag' is there already"),
])  # fmt: skip
def test_a_name_that_is_ours_or_that_of_another_plug_in_is_refused(own, attribute, sentence):
    with pytest.raises(ArmidError, match=sentence):
        load_registry([f"{own}:effect", f"{own}:{attribute}"])


IMPORTED = "from armid import Constant, Input, Parameter, Plant, Scales"


@pytest.mark.parametrize(("text", "fragment"), [
    ("raise RuntimeError('no luck')", "RuntimeError: no luck"), ("def broken(:", "SyntaxError"),
    ("import not_there_at_all", "ModuleNotFoundError: No module named 'not_there_at_all'"),
    ("raise SystemExit(0)", "SystemExit: 0"),
    ("from armid import Parameter\nParameter('a b', '1', 0, 1)", "line 2: parameter 'a b' is not a usable name"),
    (f"{IMPORTED}\nParameter('a', '1', '0', 1)", "line 2: parameter 'a' has low '0': a number is expected"),
    (f"{IMPORTED}\nConstant('c', 1.0, '1', tolerance=2)", "tolerance 2: a share from 0 to below 1 is"),
    (f"{IMPORTED}\nInput('u', 'V', ('drive_V'))", "columns: 'drive_V' stands alone, a tuple is"),
    (f"{IMPORTED}\nPlant('p', Parameter('a', '1', 0, 1), (), Scales(1, 1))", "one Parameter stands alone"),
])  # fmt: skip
def test_a_file_that_fails_is_refused(tmp_path, text, fragment):
    (tmp_path / "failing.py").write_text(text)
    for _ in range(2):
        with refusing(fragment):
            load_plugin(f"{tmp_path / 'failing.py'}:thing")
    assert "armid_plugin_failing" not in sys.modules


def test_entry_points_of_installed_packages(installed):
    installed(("effects", "any", "effect"), ("fitness", "worst_miss", "worst"), ("identifiers", "evolution", "DE"),
              ("plants", "axis", "AXIS"))  # fmt: skip
    loaded = load_registry()
    assert loaded.effects["damper"] is effect
    assert loaded.plants["other_axis"] is AXIS
    assert loaded.fitness["worst_miss"].function is worst
    assert isinstance(loaded.identifiers["evolution"].build(100), DE)


@pytest.mark.parametrize(("point", "fragments"), [
    (("effects", "any", "nothing"), ["'any'", "armid.effects", "cannot be loaded", "nothing"]),
    (("effects", "any", "worst"), ["'any'", "belongs to fitness", "armid.fitness is expected"]),
    (("plants", "any", "LEVEL"), ["'any'", "of type tuple"]),
    (("identifiers", "pso", "DE"), ["identifiers: 'pso' is there already"]),
])  # fmt: skip
def test_a_bad_entry_point_is_refused(installed, point, fragments):
    installed(point)
    with refusing(*fragments):
        load_registry()
