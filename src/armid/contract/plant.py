"""The contract of a plant."""

import numpy as np

from armid.contract.effect import REFERENCE_TOLERANCE, middle
from armid.contract.finding import Finding
from armid.contract.manoeuvres import trial_manoeuvres
from armid.contract.reference import simulate_plainly
from armid.model import ArmidError, Model, Plant
from armid.simulation import FINE, calibrate, probes, simulate


def check_plant(plant: Plant) -> list[Finding]:
    """Try a plant and its siblings on trial manoeuvres."""
    return [f for p in (plant, *plant.variants) for f in check_one(p)]


def check_one(plant: Plant) -> list[Finding]:
    """Try one plant."""
    where = f"{plant.name} in {plant.output_unit}"
    try:
        model = Model(plant)
    except ArmidError as error:
        return [Finding(f"binds, {where}", False, str(error))]
    findings = [
        Finding(f"binds, {where}", True, f"{len(model.parameters)} parameters, {len(model.states)} states"),
        Finding(f"unit, {where}", plant.output_unit in ("rad/s", "m/s"), f"records {plant.output_unit}"),
        Finding(f"equations, {where}", bool(str(model)), "its equations can be printed"),
    ]
    low = np.array([p.low for p in model.parameters.values()])
    high = np.array([p.high for p in model.parameters.values()])
    x = np.array([middle(p) for p in model.parameters.values()])
    for i, m in enumerate(trial_manoeuvres(plant)):
        spread = probes(low, high, 16)
        failed = int(simulate(model, m, spread, calibrate(model, m, spread, spans=False).schedule).failed.sum())
        run = simulate(model, m, x, calibrate(model, m, x[np.newaxis], FINE).schedule)
        off = float(np.max(np.abs(run.output[0] - simulate_plainly(model, m, x))))
        findings += [
            Finding(f"finite, {where}, {i + 1}", failed == 0, f"{failed} of 16 candidates over the box diverge"),
            Finding(f"compiled, {where}, {i + 1}", off <= REFERENCE_TOLERANCE * plant.scales.speed,
                    f"the compiled plant is within {off:.2g} of its plain functions under scipy"),
        ]  # fmt: skip
    return findings
