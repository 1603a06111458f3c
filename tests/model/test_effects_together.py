"""All effects of a plant at once, as scipy moves their plain functions; each alone is tried by tests/contract."""

import numpy as np
import pytest

from armid.contract.trials import away, middle, simulate_plainly
from armid.engine import Schedule, simulate
from armid.model import EFFECTS, PLANTS, Manoeuvre, Model, applicable
from armid.model.plants.driven_axis import linear_axis

TIMES = 5e-3 * np.arange(201)
# Lowering with the shell, the switch at 0.578 s, to 0.75 s; a light hanging axis under a sine that turns it over twice.
MOTIONS = {
    "arm": (PLANTS["shell_transfer_arm"], Manoeuvre(5e-3, 151), {}),
    "axis": (linear_axis, Manoeuvre(5e-3, 201, {"gravity_moment": 0.4, "start_speed": 0.1},
                                    {"u": 0.1 + 0.5 * np.sin(9 * TIMES)}), {"mass": 0.06}),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("where", MOTIONS)
def test_all_at_once_move_as_their_plain_functions(where):
    """In steps so fine that the engine is within 1e-7 rad/s of the truth, but for the brushes' width."""
    plant, manoeuvre, own = MOTIONS[where]
    model = Model(plant, tuple(applicable(EFFECTS, plant).values()))
    values = {n: middle(p) if p.null is None else p.null for n, p in model.parameters.items()} | own
    still = np.array(list(values.values()))
    for effect in model.effects:
        alone = Model(plant, (effect,))
        moved = dict(zip(alone.parameters, away(alone, effect, 0.03), strict=True))
        values |= {n: v for n, v in moved.items() if n.startswith(f"{effect.name}.")}
    candidate = np.array(list(values.values()))
    plain = simulate_plainly(model, manoeuvre, candidate)[0]
    run = simulate(model, manoeuvre, np.array([candidate, still]), Schedule(24))
    assert not run.failed.any()
    assert np.abs(run.output[0] - plain).max() <= 5e-6
    assert np.abs(run.output[1] - plain).max() > 1e-3
