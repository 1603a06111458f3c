"""Made-up campaigns of a blind suite: what may be true of them, and what a loop may say."""

from typing import Any

import numpy as np

NAMES = ("coulomb", "seal_friction", "tilt", "viscous", "supply_sag", "brush_drop")
TRUE = {"p0": 3e6, "k": 1.0, "eta3": 0.6, "n": 1.2}
VERDICTS = ("no_discrepancy", "explained", "partly_explained", "unexplained", "cannot_tell_apart")
CLASSES = ("control", "single", "two", "unlisted", "one_stroke")


def made_entry(rng: np.random.Generator) -> dict[str, Any]:
    label = str(rng.choice(CLASSES))
    n = {"control": 0, "two": 2, "one_stroke": int(rng.integers(0, 2))}.get(label, 1)
    names = [str(name) for name in rng.choice(NAMES, n, replace=False)]
    told = {"port": "torque", "form": "f", "listed": label != "unlisted", "strength": 1, "sizes": {}}
    holdout = None if label == "one_stroke" and rng.random() < 0.5 else 0.005
    return {
        "class": label,
        "parameters": TRUE,
        "effects": [{"name": name, "matching": bool(rng.random() < 0.7), **told} for name in names],
        "noise": {"kind": str(rng.choice(["white", "coloured"]))},
        "floor": {"train": 0.005, "holdout": holdout},
        "declared_fit": {"holdout_ratio": 2.0, "matters": bool(rng.random() < 0.8)} if names else None,
    }


def made_report(rng: np.random.Generator, entry: dict[str, Any]) -> dict[str, Any]:
    """Draw what a loop may say of it: often near the truth, at times anything."""
    near = [effect["name"] for effect in entry["effects"] if rng.random() < 0.7]
    names = near + [str(n) for n in rng.choice(NAMES, rng.integers(0, 3), replace=False) if rng.random() < 0.3]
    steps = [
        {"effect": n, "alternatives": [str(a) for a in rng.choice(NAMES, rng.integers(0, 6), replace=False) if a != n],
         "empirical": False, "claimed": bool(rng.random() < 0.5)}
        for n in dict.fromkeys(names)
    ]  # fmt: skip
    probable = {str(n): float(rng.uniform(0.1, 1.0)) for n in NAMES if rng.random() < 0.9}
    held = None if entry["floor"]["holdout"] is None else {"rmse": 0.005 * float(rng.uniform(0.95, 9.0))}
    after = None if held is None else {"rmse": 0.005 * float(rng.uniform(0.95, 1.3))}
    found = {
        n: {"value": v * float(rng.normal(1.0, 0.02)), "trusted": bool(rng.random() < 0.5)} for n, v in TRUE.items()
    }
    return {
        "verdict": str(rng.choice(VERDICTS)), "also": [], "effects": [step["effect"] for step in steps], "steps": steps,
        "probabilities": {"effects": probable},
        "error": {"before": {"train": None, "holdout": held}, "after": {"train": None, "holdout": after}},
        "parameters": {"before": found, "after": found},
    }  # fmt: skip
