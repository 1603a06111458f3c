"""Made-up campaigns of a blind suite: what may be true of them, and what a loop may say."""

import copy

NAMES = ("coulomb", "seal_friction", "tilt", "viscous", "supply_sag", "brush_drop")
VERDICTS = ("no_discrepancy", "explained", "partly_explained", "unexplained", "cannot_tell_apart")
CLASSES = ("control", "single", "two", "unlisted", "one_stroke")
FLOOR = 0.005
TRUE = {"p0": 3e6, "k": 1.0, "eta3": 0.6, "n": 1.2}


def entry(label, *names, listed=True, matching=True, matters=True):
    told = {"port": "torque", "form": "f", "matching": matching, "listed": listed, "strength": 1, "sizes": {}}
    return {
        "class": label,
        "parameters": TRUE,
        "effects": [{"name": name, **told} for name in names],
        "noise": {"kind": "white"},
        "floor": {"train": FLOOR, "holdout": None if label == "one_stroke" else FLOOR},
        "declared_fit": {"holdout_ratio": 3.0, "matters": matters} if names else None,
    }


def report(verdict, *steps, after=FLOOR, bias=0.0):
    """Return a report: steps as (effect, alternatives, claimed); a group is as probable as a claim."""
    probable = {n: 0.99 / (1 + len(others)) for name, others, claimed in steps for n in (name, *others)
                if claimed or others}  # fmt: skip
    held = {"train": {"rmse": 0.0}, "holdout": {"rmse": 0.02}}
    found = {name: {"value": value * (1.0 + bias), "trusted": bias == 0.0} for name, value in TRUE.items()}
    return {
        "verdict": verdict,
        "also": [],
        "effects": [name for name, *_ in steps],
        "steps": [{"effect": name, "alternatives": list(others), "claimed": sure} for name, others, sure in steps],
        "probabilities": {"effects": probable},
        "error": {"before": held, "after": {"train": {"rmse": 0.0}, "holdout": {"rmse": after}}},
        "parameters": {"before": copy.deepcopy(found), "after": found},
    }


def made_entry(rng):
    label = str(rng.choice(CLASSES))
    n = {"control": 0, "two": 2, "one_stroke": int(rng.integers(0, 2))}.get(label, 1)
    names = [str(name) for name in rng.choice(NAMES, n, replace=False)]
    listed, matching, matters = label != "unlisted", bool(rng.random() < 0.7), bool(rng.random() < 0.8)
    return entry(label, *names, listed=listed, matching=matching, matters=matters)


def made_report(rng, told):
    """Draw what a loop may say of it: often near the truth, at times anything."""
    near = [effect["name"] for effect in told["effects"] if rng.random() < 0.7]
    names = near + [str(n) for n in rng.choice(NAMES, rng.integers(0, 3), replace=False) if rng.random() < 0.3]
    steps = [(n, tuple(str(a) for a in rng.choice(NAMES, rng.integers(0, 6), replace=False) if a != n),
              bool(rng.random() < 0.5)) for n in dict.fromkeys(names)]  # fmt: skip
    said = report(str(rng.choice(VERDICTS)), *steps, after=FLOOR * rng.uniform(0.95, 1.3), bias=rng.normal(0.0, 0.02))
    for step in said["steps"]:
        step["empirical"] = False
    if told["floor"]["holdout"] is None:
        said["error"]["before"]["holdout"] = said["error"]["after"]["holdout"] = None
    return said
