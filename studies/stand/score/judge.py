"""Judge what the report of one campaign says against the truth."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stand import RefusalError
from stand.arm import PARAMETERS

Entry = Mapping[str, Any]
LARGEST_GROUP = 4
# As probable as this is a group, one of which is claimed to be there.
SURE = 0.95


@dataclass(frozen=True)
class Claim:
    """Hold what a report claims: each named effect with its group, itself included."""

    groups: Mapping[str, frozenset[str]]
    verdict: str

    @property
    def said(self) -> str:
        """Write the names, each with what it cannot be told from."""
        return "; ".join(" or ".join((name, *sorted(group - {name}))) for name, group in self.groups.items())


def read_claim(report: Entry) -> Claim:
    """Read what a report claims: names, and groups of which one is there, whichever.

    A name that is claimed stands alone. Any other step is a candidate, unless it is as probable as a claim together
    with what may stand in its place. Nothing is claimed that records held out deny.
    """
    chances, groups = report["probabilities"]["effects"], {}
    denied = "does_not_carry_over" in (report["verdict"], *report["also"])
    for step in report["steps"]:
        name, group = step["effect"], frozenset((step["effect"], *step["alternatives"]))
        if step["claimed"]:
            groups[name] = frozenset((name,))
        elif len(group) > 1 and not denied and sum(chances.get(each, 0.0) for each in group) >= SURE:
            groups[name] = group
    return Claim(groups, report["verdict"])


def match(truths: Sequence[str], claim: Claim) -> tuple[list[str], list[str], list[str]]:
    """Give which truths are named, which are held by a group alone, and which names belong to no truth.

    Each truth has the name that is its own, else one group that holds it; a group of more than 4 holds nothing.
    """
    named = [truth for truth in truths if truth in claim.groups]
    free = {name: group for name, group in claim.groups.items() if name not in named}
    grouped = []
    for truth in truths:
        holds = [name for name, group in free.items() if truth in group and len(group) <= LARGEST_GROUP]
        if truth not in named and holds:
            grouped.append(truth)
            del free[holds[0]]
    return named, grouped, list(free)


def judgement(label: str, truths: Sequence[str], claim: Claim) -> str:
    """Give one word for a campaign of a class.

    control: right, false_alarm. unlisted: claimed (a library's names are said to explain all), else partial, none.
    Others: right, group (held by a group that cannot be told apart), right_with_extra, half, half_with_extra (of two),
    wrong, cannot_tell, none.
    """
    if label == "unlisted":
        return "none" if not claim.groups else "claimed" if claim.verdict == "explained" else "partial"
    if not truths:
        return "right" if not claim.groups and claim.verdict == "no_discrepancy" else "false_alarm"
    named, grouped, extra = match(truths, claim)
    found = len(named) + len(grouped)
    if not found and not claim.groups:
        return "cannot_tell" if claim.verdict == "cannot_tell_apart" else "none"
    if not found:
        return "wrong"
    whole = "right" if found == len(truths) else "half"
    if extra:
        return f"{whole}_with_extra"
    return "group" if whole == "right" and grouped else whole


def judge(campaign: str, entry: Entry, report: Entry) -> dict[str, Any]:
    """Give one row: truth, claim and judgement, held-out errors over their noise, bias of the four parameters.

    Raises KeyError for a key that the report lacks.
    """
    claim = read_claim(report)
    truths = [each["name"] for each in entry["effects"] if each["listed"]]
    own = [len(group) for name, group in claim.groups.items() if group & set(truths)]
    wrong = [len(claim.groups[name]) for name in match(truths, claim)[2]]
    row = {
        **told(campaign, entry),
        "verdict": claim.verdict,
        "named": claim.said,
        "first": next(iter(claim.groups), "nothing"),
        "judgement": judgement(entry["class"], truths, claim),
        "wrong_alone": 1 in wrong,
        "wrong_group": any(size > 1 for size in wrong),
        "largest_group": max((len(group) for group in claim.groups.values()), default=0),
        "group_of_truth": max(own, default=0),
        **_errors(entry, report),
    }
    for name in PARAMETERS:
        for when in ("before", "after"):
            row[f"bias_{when}_{name}"] = report["parameters"][when][name]["value"] / entry["parameters"][name] - 1.0
        row[f"trusted_{name}"] = bool(report["parameters"]["after"][name]["trusted"])
    return row


def judge_all(key: Mapping[str, Any], reports: Mapping[str, Any]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Judge every campaign of the key; those without a report come second."""
    rows, missing = [], []
    for campaign, entry in key.items():
        if campaign not in reports:
            missing.append(told(campaign, entry) | {"judgement": "missing"})
            continue
        try:
            rows.append(judge(campaign, entry, reports[campaign]))
        except (KeyError, TypeError) as error:
            said = f"the report of {campaign} is not a report of a closed loop: {error} is not as expected"
            raise RefusalError(said) from error
    return rows, missing


def read_json(file: Path) -> Any:
    try:
        return json.loads(file.read_text())
    except OSError as error:
        raise RefusalError(f"{file} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise RefusalError(f"{file} is not JSON: {error}") from error


def told(campaign: str, entry: Entry) -> dict[str, Any]:
    """Give what the key tells of a campaign."""
    effects, fit = entry["effects"], entry["declared_fit"]
    return {
        "campaign": campaign,
        "class": entry["class"],
        "noise": entry["noise"]["kind"],
        "truth": "; ".join(each["name"] for each in effects),
        "form": "; ".join(each["form"] for each in effects),
        "matching": all(each["matching"] for each in effects),
        "strength": "; ".join(str(each["strength"]) for each in effects),
        "matters": bool(fit and fit["matters"]),
        "floor": entry["floor"]["holdout"],
    }


def _errors(entry: Entry, report: Entry) -> dict[str, float | None]:
    """Give held-out rmse before and after [rad/s], over the noise, and how much of it went."""
    floor = entry["floor"]["holdout"]
    before, after = ((report["error"][when]["holdout"] or {}).get("rmse") for when in ("before", "after"))
    if before is None or after is None or floor is None:
        return dict.fromkeys(("before", "after", "before_over_floor", "after_over_floor", "cut", "excess_cut"))
    excess = [math.sqrt(max(0.0, rmse**2 - floor**2)) for rmse in (before, after)]
    return {
        "before": before,
        "after": after,
        "before_over_floor": before / floor,
        "after_over_floor": after / floor,
        "cut": 1.0 - after / before,
        "excess_cut": 1.0 - excess[1] / excess[0] if excess[0] else None,
    }
