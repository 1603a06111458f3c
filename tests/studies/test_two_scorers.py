"""The report's judgements and the stand's own are written apart, and say the same of whatever a loop may claim."""

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from armid.study.blind.scores import ANSWERS, judged, targets_of
from stand.score.judge import judge
from stand.score.targets import targets_of as targets_of_stand

NAMES = ("coulomb", "seal_friction", "tilt", "viscous", "supply_sag", "brush_drop")
TRUE = {"p0": 3e6, "k": 1.0, "eta3": 0.6, "n": 1.2}
VERDICTS = ("no_discrepancy", "explained", "partly_explained", "unexplained", "cannot_tell_apart")
CLASSES = ("control", "single", "two", "unlisted", "one_stroke")
# The report's question -> the stand's, which ends in this.
SAME = {
    ("controls", "false alarms"): "controls: false alarms",
    ("single effects", "those that"): "20 %: share of all",
    ("20 %", "right name, or"): "20 %: right name, or a group that holds it",
    ("20 %", "wrong name alone"): "20 %: wrong name alone",
    ("two effects", "both right"): "two effects: both right",
    ("matching form", "held-out error"): "listed effects in a matching form: held-out error over noise, median",
    ("matching form", "bias"): "bias of the four parameters, median",
    ("no library", "no library name"): "no library name said to explain all",
    ("no library", "cut"): "cut of the held-out error, median",
    ("one stroke", "wrong name alone"): "one stroke: wrong name alone",
    ("one stroke", "trust"): "eta3 or n trusted",
}


def made_entry(rng: np.random.Generator) -> dict[str, Any]:
    """Draw what may be true of a campaign."""
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
         "empirical": False}
        for n in dict.fromkeys(names)
    ]  # fmt: skip
    if rng.random() < 0.2:
        steps.append({"effect": "unnamed:torque", "alternatives": [], "empirical": True})
    effects = [step["effect"] for step in steps if rng.random() < 0.95]
    held = None if entry["floor"]["holdout"] is None else {"rmse": 0.005 * float(rng.uniform(0.95, 9.0))}
    after = None if held is None else {"rmse": 0.005 * float(rng.uniform(0.95, 1.3))}
    found = {
        n: {"value": v * float(rng.normal(1.0, 0.02)), "trusted": bool(rng.random() < 0.5)} for n, v in TRUE.items()
    }
    return {
        "verdict": str(rng.choice(VERDICTS)), "effects": effects, "steps": steps,
        "error": {"before": {"train": None, "holdout": held}, "after": {"train": None, "holdout": after}},
        "parameters": {"before": found, "after": found},
    }  # fmt: skip


@pytest.fixture(scope="module")
def both() -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Six hundred made-up campaigns judged by either."""
    rng = np.random.default_rng(5)
    key = {f"c{i:03d}": made_entry(rng) for i in range(600)}
    reports = {name: made_report(rng, entry) for name, entry in key.items()}
    loops = pd.DataFrame({"case": list(reports), "seconds": 1.0, "cpu_seconds": 1.0, "report": list(reports.values())})
    return judged(loops, key, list(key)), [judge(name, key[name], reports[name]) for name in key]


def test_both_say_the_same_of_each_campaign(both: Any) -> None:
    ours, theirs = both
    assert set(ours["judgement"]) >= {"right", "group", "wrong", "half", "false_alarm", "claimed", "none", "empirical"}
    shared = [c for c in ours.columns if c in theirs[0] and c not in ("truth", "strength")]
    assert len(shared) > 25
    for (_, row), other in zip(ours.iterrows(), theirs, strict=True):
        for name in shared:
            mine, his = row[name], other[name]
            same = math.isnan(mine) if his is None else mine == his or mine == pytest.approx(his, abs=1e-12)
            assert same, (other["campaign"], name, mine, his)


def test_both_reckon_the_same_targets(both: Any) -> None:
    ours, theirs = both
    known = {t.question: t for t in targets_of_stand(theirs, 0)}
    aims = targets_of(ours)
    for (topic, words), question in SAME.items():
        (mine,) = [t for t in aims if topic in t.topic and words in t.question]
        (his,) = [t for q, t in known.items() if q.endswith(question)]
        assert (mine.found, mine.n, mine.met) == (pytest.approx(his.found, abs=1e-12), his.among, his.met), question


def test_every_answer_on_one_effect_is_one_of_few_words(both: Any) -> None:
    ours, _ = both
    assert set(ours.loc[ours["class"] == "single", "answer"]) <= set(ANSWERS)


def test_a_campaign_without_a_report_is_missing_and_no_aim_is_met_by_it(both: Any) -> None:
    entry = made_entry(np.random.default_rng(1))
    rows = judged(pd.DataFrame(columns=["case", "seconds", "cpu_seconds", "report"]), {"c000": entry}, ["c000"])
    assert rows["judgement"].tolist() == ["missing"]
    (only,) = targets_of(rows)
    assert (only.found, only.met) == (1.0, False)
