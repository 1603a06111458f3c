"""Constants within tolerances: the interval that they widen, products, and what is known up to a common factor."""

from types import SimpleNamespace

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.estimation.constants import Product, columns_of, common_factors
from armid.estimation.information import information_of
from armid.model import PLANTS
from armid.record import read_campaign, write_table
from armid.record.campaign import tolerances_of
from armid.record.table import read_table

ARM = PLANTS["shell_transfer_arm"]


class Linear:
    replays = ()
    space = SimpleNamespace(free_names=("a", "b"))
    span = np.array([2.0, 4.0])

    def walls(self, z):
        return np.zeros(len(z)), np.ones(len(z))

    def __init__(self, jacobian):
        self.jacobian = jacobian

    def whole(self, Z):
        return Z

    def residual_and_slopes(self, z):
        return np.zeros(len(self.jacobian)), self.jacobian


def test_the_interval_counts_what_is_not_known_jointly_and_common_factors_are_told():
    rng = np.random.default_rng(1)
    jacobian, doubts = rng.normal(size=(50, 2)), rng.normal(size=(50, 3))
    found = information_of(Linear(jacobian), np.array([0.5, 0.5]), None, doubts)
    whole = np.hstack([jacobian, doubts])
    joint = np.linalg.inv(whole.T @ whole + np.diag([0.0, 0.0, 1.0, 1.0, 1.0]))
    assert found.deviation == pytest.approx(np.sqrt(np.diag(joint)[:2]) * Linear.span)
    without = information_of(Linear(jacobian), np.array([0.5, 0.5]), None, columns_of((), 50))
    assert (without.deviation < found.deviation).all()
    rng = np.random.default_rng(2)
    a, b, c, d = rng.normal(size=(4, 40))
    slopes = np.column_stack([a, b, c])
    mass = Product(("mass",), (1.0,), 0.02, -(a + b))
    gain = Product(("gain", "drive"), (1.0, 1.0), 0.03, 2.0 * c)
    factors = common_factors(("p", "q", "r"), slopes, [mass, gain, Product(("other",), (1.0,), 0.02, d)])
    assert factors == (
        "these records give p, q, mass up to a common factor",
        "these records do not tell a change of r +1 %, gain*drive -0.5 %, made together",
    )  # fmt: skip
    three = Product(("mass",), (1.0,), 0.02, -(a + b + c))
    factors = common_factors(("p", "q", "r"), slopes, [three, Product(("other",), (1.0,), 0.02, d)])
    assert factors == ("these records give p, q, r, mass up to a common factor",)
    assert gain.public == "constant:gain*drive"
    assert common_factors(("p",), slopes[:, :1], [Product(("other",), (1.0,), 0.02, d)]) == ()


def test_tolerances_of_a_campaign_of_a_plant_of_neither_and_of_what_records_alone_set(write_axis, tmp_path):
    usual = tolerances_of({}, ARM, "campaign.toml")
    assert usual["R"] == 0.02
    assert not {"g", "theta_C", "shell", "U"} & set(usual)
    assert tolerances_of({"default": 0.0}, ARM, "campaign.toml") == {}
    told = tolerances_of({"default": 0.05, "R": 0.0, "g": 0.001}, ARM, "campaign.toml")
    assert (told["K"], told["g"], "R" in told) == (0.05, 0.001, False)
    assert tolerances_of({}, PLANTS["driven_axis"], "campaign.toml") == {}
    assert set(tolerances_of({"default": 0.1}, PLANTS["driven_axis"], "")) == {"gain", "gravity_moment"}
    with pytest.raises(ArmidError, match="tolerances: constant 'RR' is unknown, did you mean 'R'"):
        tolerances_of({"RR": 0.1}, ARM, "campaign.toml")
    # The declared gravity moment is 0, of which no share is known; that of the record is not.
    known = []
    for more in ("", "constants = { gravity_moment = 1.2 }\n"):
        folder = write_axis(tmp_path / str(len(known)), more=f"{more}[tolerances]\ngravity_moment = 0.05\n")
        columns = dict(read_table(folder / "move.csv", "move.csv").columns)
        write_table(folder / "move.csv", columns | {"position_m": np.cumsum(columns["velocity_m_s"]) / 200.0})
        known.append(read_campaign(folder).tolerances)
    assert known == [{}, {"gravity_moment": 0.05}]
