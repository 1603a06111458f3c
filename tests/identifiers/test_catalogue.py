"""Identifiers with options of their own."""

import pytest
from pymoo.algorithms.soo.nonconvex.ga import GA

from armid.errors import ArmidError
from armid.identifiers import IDENTIFIERS, as_identifier


def test_the_swarm_takes_its_options():
    swarm = IDENTIFIERS["pso"].with_options({"velocity_limit": 0.2, "c1": 2, "n_particles": 20}).build(200)
    assert (swarm.velocity_limit, swarm.c1, swarm.n_particles, swarm.n_iterations) == (0.2, 2.0, 20, 10)


def test_no_options_leave_it_as_it_is():
    assert IDENTIFIERS["pso"].with_options({}) is IDENTIFIERS["pso"]


def test_a_misspelt_option_is_refused():
    with pytest.raises(ArmidError, match="velocity_limit"):
        IDENTIFIERS["pso"].with_options({"velocity_limt": 0.2}).build(200)


def test_an_identifier_without_options_refuses_them():
    with pytest.raises(ArmidError, match="takes no options"):
        as_identifier("ga", lambda budget: GA()).with_options({"pop_size": 10})
