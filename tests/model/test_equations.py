"""The equations as `print(model)` shows them, and the constants of the reference arm."""

from pathlib import Path

import numpy as np
import pytest

from armid.model import EFFECTS, PLANTS, Model

GOLDEN = Path(__file__).parents[1] / "golden" / "arm_with_friction.txt"


def test_equations_as_composed():
    model = Model(PLANTS["shell_transfer_arm"]) + EFFECTS["coulomb"] + EFFECTS["viscous"]
    assert str(model) + "\n" == GOLDEN.read_text()


@pytest.mark.parametrize(("name", "value"), [
    ("I01", 2.0e-3), ("I23", 4.0e-3), ("I45", 1.2e-2), ("I6_loaded", 64.0), ("I6_empty", 31.1), ("i1", 120.0),
    ("i2", 60.0), ("i3", 24.0), ("eta1", 0.97), ("eta2", 0.97), ("m_loaded", 118.0), ("L_loaded", 0.58),
    ("m_empty", 72.5), ("L_empty", 0.4106), ("alpha", np.radians(5)), ("g", 9.81), ("l", 0.060), ("S", 1.9635e-3),
    ("V0", 0.40e-3), ("U", 28.0), ("R", 0.40), ("L_a", 2.0e-3), ("K", 4.5e-5), ("C_e", 20.0), ("C_T", 20.0),
    ("K_p", 280.0), ("K_d", 70.0), ("u_th", 0.5), ("delta_E", np.radians(25)), ("theta_A", np.radians(-55)),
])  # fmt: skip
def test_reference_constants(name, value):
    assert Model(PLANTS["shell_transfer_arm"]).constants[name] == pytest.approx(value, rel=1e-12)


def test_every_estimate_is_called_one():
    known = {"g", "theta_C", "theta_D", "shell", "U"}
    assert all("estimate" in c.note for c in PLANTS["shell_transfer_arm"].constants if c.name not in known)


def test_box_of_table_one():
    box = {n: (p.low, p.high) for n, p in Model(PLANTS["shell_transfer_arm"]).parameters.items()}
    assert box == {"p0": (2.6e6, 3.5e6), "k": (0.6, 1.1), "eta3": (0.45, 0.70), "n": (0.9, 1.5)}


def test_the_plain_functions_run_on_arrays():
    model = Model(PLANTS["shell_transfer_arm"])
    function = model.plant.quantities["voltage"]
    demand = np.array([-100.0, -5.0, -0.2, 0.0, 0.3, 5.0, 100.0])
    np.testing.assert_allclose(function(demand, 0.5, 28.0), [-28.0, -4.5, 0.0, 0.0, 0.0, 4.5, 28.0])
