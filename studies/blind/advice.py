"""Whether the record that a loop advised told a pair of effects apart, and oftener than a random one."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pandas import DataFrame
from scipy.stats import binomtest

from blind.tables import Table, wilson
from stand import RefusalError
from stand.score.judge import Claim, read_claim
from stand.score.targets import Target, aim, without_report

CHOICES = ADVISED, RANDOM = ("advised", "random")
TOLD_APART, TOGETHER, WRONG, NONE, NO_REPORT = "told apart", "still together", "wrong one", "neither", "missing"
ALL = "all pairs"
LIMIT = 0.80
WORDS = "Shares with their 95 % Wilson interval; n: campaigns, each with an advised and with a random record."
RATE_WORDS = (
    "Campaigns of few strokes that left the pair in doubt, the first so many of those tried; one record more each, "
    "advised by the loop, or random among those that the arm can make; share in which the true effect stands alone "
    "after the loop was closed again, with its 95 % Wilson interval. Wrong one: the other effect stands alone. "
    "Promised: mean power that the advice told. p: chance of so great a lead where neither is better (exact sign "
    "test over campaigns on which only one of both told the pair apart)."
)


def separations(key: Mapping[str, Any], reports: Mapping[str, Any]) -> DataFrame:
    """Return one row a campaign with a record more: its pair, who chose the record, what was said then.

    Raises RefusalError for a campaign of which the key does not tell who chose the record.
    """
    rows = []
    for name, entry in key.items():
        if not {"pair", "choice", "base", "power", "tried", "in_doubt"} <= set(entry):
            raise RefusalError(f"the key does not tell of campaign '{name}' who chose its last record")
        (truth,) = [effect["name"] for effect in entry["effects"]]
        claim = read_claim(reports[name]) if name in reports else None
        added = entry.get("next")
        rows.append({
            "campaign": name, "pair": " / ".join(entry["pair"]), "truth": truth, "noise": entry["noise"]["kind"],
            "choice": entry["choice"], "base": entry["base"], "rank": entry.get("rank"), "power": entry["power"],
            "next": ", ".join(f"{k} {v}" for k, v in added.items()) if added else "none",
            "tried": entry["tried"], "in_doubt": entry["in_doubt"], "said": claim.said if claim else "",
            "verdict": claim.verdict if claim else "", "answer": answer(truth, claim),
        })  # fmt: skip
    return DataFrame(rows)


def answer(truth: str, claim: Claim | None) -> str:
    """Return whether the true effect stands alone, nothing else named and no rival left."""
    if claim is None:
        return NO_REPORT
    if claim.verdict == "cannot_tell_apart":
        return TOGETHER
    if claim.groups == {truth: {truth}}:
        return TOLD_APART
    if not claim.groups:
        return NONE
    return TOGETHER if any(truth in group for group in claim.groups.values()) else WRONG


def rates(rows: DataFrame) -> DataFrame:
    """Return, per pair and over all, the share that either choice told apart, with its 95 % Wilson interval.

    Only campaigns count that were closed for both choices. p: chance of so great a lead of the advised record where
    neither is better: exact sign test over the campaigns on which only one of both told the pair apart
    (McNemar 1947, doi:10.1007/BF02295996).
    """
    there = rows[rows["answer"] != NO_REPORT]
    both = there[there.groupby("base")["choice"].transform("nunique") == len(CHOICES)]
    groups = {str(pair): part for pair, part in both.groupby("pair", sort=False)} | {ALL: both}
    lines = []
    for pair, part in groups.items():
        if part.empty:
            continue
        apart = part.assign(apart=part["answer"] == TOLD_APART).pivot(index="base", columns="choice", values="apart")
        line: dict[str, Any] = {"pair": pair, "n": len(apart)}
        if pair != ALL:
            line |= {"tried": part["tried"].iloc[0], "in_doubt": part["in_doubt"].iloc[0]}
        for choice in CHOICES:
            low, high = wilson(int(apart[choice].sum()), len(apart))
            wrong = int(((part["choice"] == choice) & (part["answer"] == WRONG)).sum())
            share = apart[choice].mean()
            line |= {choice: share, f"{choice}_low": low, f"{choice}_high": high, f"{choice}_wrong": wrong}
        wins, losses = (int((apart[one] & ~apart[other]).sum()) for one, other in (CHOICES, CHOICES[::-1]))
        line["power"] = part.loc[part["choice"] == ADVISED, "power"].mean()
        line["p"] = binomtest(wins, wins + losses, alternative="greater").pvalue if wins + losses else 1.0
        lines.append(line)
    return DataFrame(lines)


def targets_of(rows: DataFrame, found: DataFrame) -> list[Target]:
    """Return what is asked of the advice; found: `rates` of the rows."""
    missing = int((rows["answer"] == NO_REPORT).sum())
    lines = [without_report(missing, len(rows))]
    for line in found.to_dict("records"):
        pair, n, share = line["pair"], int(line["n"]), float(line[ADVISED])
        lead = share - float(line[RANDOM])
        lines.append(aim(f"{pair}: told apart by the advised record", share, n, f">= {LIMIT:g}", is_share=True))
        lines.append(aim(f"{pair}: lead over a random record", lead, n, "> 0"))
    return lines


def tables_of(rows: DataFrame, found: DataFrame) -> Sequence[Table]:
    """Return one line a pair, and every campaign."""
    show: dict[str, str | tuple[str, str]] = {
        "pair": "pair", "tried": ("tried", ".0f"), "in_doubt": ("in doubt", ".0f"), "n": ("taken", ".0f"),
        "advised": ("advised [%]", "%"), "advised_low": ("low [%]", "%"), "advised_high": ("high [%]", "%"),
        "advised_wrong": ("wrong one", ".0f"), "power": ("promised [%]", "%"), "random": ("random [%]", "%"),
        "random_low": ("low [%]", "%"), "random_high": ("high [%]", "%"), "random_wrong": ("wrong one", ".0f"),
        "p": ("p", ".2g"),
    }  # fmt: skip
    campaigns = dict.fromkeys(("campaign", "pair", "truth", "noise", "next", "said", "answer"), "")
    return (
        Table("advice", "Told apart by one record more", RATE_WORDS, found.reindex(columns=[*show]), show),
        Table("campaigns", "Campaigns", "Every campaign with its last record and what was said then.",
              rows.replace({None: np.nan}), {key: key for key in campaigns}),
    )  # fmt: skip
