"""Hold the reports of closed loops against the truth: one row a campaign."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pandas import DataFrame, Series

from armid.model import ArmidError
from armid.study.loops.claim import claim_of, judgement, matched
from armid.study.loops.key import Entry

NOTHING, SEVERAL = "nothing", "; "
# Answers on one true effect, from the best to the worst.
ANSWERS = ("right alone", "named first of a group", "held by a group", "right and one more", "cannot tell apart",
           "unnamed term", "nothing", "wrong group", "wrong alone")  # fmt: skip
MISSING = "missing"


def judged(loops: DataFrame, key: Mapping[str, Entry], names: list[str]) -> DataFrame:
    """Return one row a campaign that the study asks for: truth, claim, judgement, errors over noise, bias.

    loops: case, seconds, cpu_seconds, report. names: of the campaigns; one without a report is judged "missing".

    Raises ArmidError for a campaign that the key does not know, and for a report of another shape.
    """
    found = {str(case): row for case, (_, row) in zip(loops["case"], loops.iterrows(), strict=True)}
    rows = []
    for name in names:
        if name not in key:
            raise ArmidError(f"the key tells nothing of campaign '{name}': campaigns and key are not of one suite")
        try:
            rows.append(row_of(name, key[name], found.get(name)))
        except (KeyError, TypeError) as error:
            raise ArmidError(f"campaign '{name}': {error} of its report or of the key is not as expected") from error
    return DataFrame(rows)


def row_of(name: str, entry: Entry, found: "Series[Any] | None") -> dict[str, Any]:
    """Return the row of one campaign."""
    row = told(name, entry)
    if found is None:
        return row | {"judgement": MISSING, "answer": MISSING}
    report, truths = found["report"], [e["name"] for e in entry["effects"] if e["listed"]]
    claim = claim_of(report)
    match = matched(truths, claim)
    own = [len(group) for group in claim.groups.values() if group & set(truths)]
    wrong = [len(claim.groups[name]) for name in match.extra]
    row |= {
        "verdict": claim.verdict,
        "named": claim.said,
        "first": next(iter((*claim.groups, *claim.empirical)), NOTHING),
        "judgement": judgement(entry["class"], truths, claim, match),
        "wrong_alone": 1 in wrong,
        "wrong_group": any(size > 1 for size in wrong),
        "largest_group": max(map(len, claim.groups.values()), default=0),
        "group_of_truth": max(own, default=0),
        "has_empirical": bool(claim.empirical),
        "seconds": found["seconds"],
        "cpu_seconds": found["cpu_seconds"],
    }
    return row | {"answer": answer_of(row)} | errors(entry, report) | parameters(entry, report)


def told(name: str, entry: Entry) -> dict[str, Any]:
    """Return what the key tells of a campaign."""
    effects, fit = entry["effects"], entry["declared_fit"]
    return {
        "campaign": name,
        "class": entry["class"],
        "noise": entry["noise"]["kind"],
        "truth": SEVERAL.join(e["name"] for e in effects) or NOTHING,
        "form": SEVERAL.join(e["form"] for e in effects),
        "matching": all(e["matching"] for e in effects),
        "strength": SEVERAL.join(str(e["strength"]) for e in effects),
        "matters": bool(fit and fit["matters"]),
        "floor": number(entry["floor"]["holdout"]),
    }


def answer_of(row: Mapping[str, Any]) -> str:
    """Return the answer in words that readers tell apart at a glance, a member of ANSWERS for one true effect."""
    word = str(row["judgement"])
    if word == "right":
        return ANSWERS[0] if row["group_of_truth"] <= 1 else ANSWERS[1]
    if word == "wrong":
        return ANSWERS[8] if row["wrong_alone"] else ANSWERS[7]
    known = {"group": ANSWERS[2], "right_with_extra": ANSWERS[3], "cannot_tell": ANSWERS[4], "empirical": ANSWERS[5],
             "none": ANSWERS[6]}  # fmt: skip
    return known.get(word, word)


def errors(entry: Entry, report: Mapping[str, Any]) -> dict[str, float]:
    """Return held-out RMSE before and after [SI], over the noise, and by which share it fell; NaN without holdout.

    excess_cut: the fall of what is above the noise, 1 - sqrt((after^2 - floor^2)/(before^2 - floor^2)).
    """
    floor = number(entry["floor"]["holdout"])
    before, after = (number((report["error"][when]["holdout"] or {}).get("rmse")) for when in ("before", "after"))
    excess = [float(np.sqrt(np.maximum(0.0, rmse**2 - floor**2))) for rmse in (before, after)]
    return {
        "before": before,
        "after": after,
        "before_over_floor": before / floor,
        "after_over_floor": after / floor,
        "cut": 1.0 - after / before,
        "excess_cut": 1.0 - excess[1] / excess[0] if excess[0] else np.nan,
    }


def parameters(entry: Entry, report: Mapping[str, Any]) -> dict[str, Any]:
    """Return the relative error of each true parameter before and after, and whether it is trusted after."""
    row: dict[str, Any] = {}
    for name, truth in entry["parameters"].items():
        for when in ("before", "after"):
            row[f"bias_{when}_{name}"] = report["parameters"][when][name]["value"] / truth - 1.0
        row[f"trusted_{name}"] = bool(report["parameters"]["after"][name]["trusted"])
    return row


def number(value: float | None) -> float:
    """Return a number, NaN for none."""
    return np.nan if value is None else float(value)
