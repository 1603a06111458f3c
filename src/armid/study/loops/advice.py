"""Whether one record more told two effects apart: the advised one against a random one."""

from collections.abc import Mapping
from typing import Any

from pandas import DataFrame

from armid.model import ArmidError
from armid.study.loops.claim import Claim, claim_of
from armid.study.loops.key import Entry
from armid.study.loops.targets import Target
from armid.study.metrics import wilson

ADVISED, RANDOM = "advised", "random"
TOLD_APART, TOGETHER, WRONG, NONE, MISSING = "told apart", "still together", "wrong one", "neither", "missing"
ALL = "all pairs"
DOUBT = "cannot_tell_apart"


def separations(loops: DataFrame, key: Mapping[str, Entry], names: list[str]) -> DataFrame:
    """Return one row a campaign with a record more: its pair, who chose the record, what was said then.

    loops: case, report. names: of the campaigns that the study asks for.

    Raises ArmidError for a campaign of which the key does not tell who chose the record.
    """
    reports = dict(zip(loops["case"], loops["report"], strict=True))
    rows = []
    for name in names:
        entry = key.get(name, {})
        if not {"pair", "choice", "base", "power", "tried", "in_doubt"} <= set(entry):
            raise ArmidError(f"the key does not tell of campaign '{name}' who chose its last record")
        (truth,) = [effect["name"] for effect in entry["effects"]]
        said = claim_of(reports[name]) if name in reports else None
        rows.append({
            "campaign": name, "pair": " / ".join(entry["pair"]), "truth": truth, "noise": entry["noise"]["kind"],
            "choice": entry["choice"], "base": entry["base"], "rank": entry.get("rank"), "power": entry["power"],
            "next": words_of(entry.get("next")), "tried": entry["tried"], "in_doubt": entry["in_doubt"],
            "said": said.said if said else "", "verdict": said.verdict if said else "",
            "answer": answer_of(truth, said),
        })  # fmt: skip
    return DataFrame(rows)


def words_of(manoeuvre: Mapping[str, Any] | None) -> str:
    """Return a manoeuvre as its keys say it, "none" where the machine could make none."""
    return ", ".join(f"{k} {v}" for k, v in manoeuvre.items()) if manoeuvre else "none"


def answer_of(truth: str, claim: Claim | None) -> str:
    """Return whether the true effect stands alone, nothing else named and no rival left."""
    if claim is None:
        return MISSING
    if claim.verdict == DOUBT:
        return TOGETHER
    if set(claim.groups) == {truth} and not claim.empirical:
        return TOLD_APART
    return WRONG if claim.groups and truth not in claim.groups else TOGETHER if claim.groups else NONE


def rates(rows: DataFrame) -> DataFrame:
    """Return, per pair and over all, the share that either choice told apart, with its 95 % Wilson interval.

    p: chance of so great a lead of the advised record over the random one where neither is better: exact sign test
    over the campaigns on which only one of both told the pair apart (McNemar 1947, doi:10.1007/BF02295996).
    """
    there = rows[rows["answer"] != MISSING]
    whole = there[there["base"].isin(both(there))]
    groups = {str(pair): part for pair, part in whole.groupby("pair", sort=False)}
    return DataFrame([rate_line(pair, part) for pair, part in (groups | {ALL: whole}).items() if len(part)])


def both(rows: DataFrame) -> list[str]:
    """Return the first campaigns that both choices were made for."""
    counts = rows.groupby("base")["choice"].nunique()
    return [str(base) for base in counts.index[counts == 2]]


def rate_line(pair: str, rows: DataFrame) -> dict[str, Any]:
    """Return the rates of one pair."""
    apart = rows.assign(apart=rows["answer"] == TOLD_APART).pivot(index="base", columns="choice", values="apart")
    advised, random = apart[ADVISED].astype(bool), apart[RANDOM].astype(bool)
    line: dict[str, Any] = {"pair": pair, "n": len(apart)}
    if pair != ALL:
        line |= {"tried": rows["tried"].iloc[0], "in_doubt": rows["in_doubt"].iloc[0]}
    for choice, found in ((ADVISED, advised), (RANDOM, random)):
        low, high = wilson(int(found.sum()), len(found))
        wrong = int(((rows["choice"] == choice) & (rows["answer"] == WRONG)).sum())
        line |= {choice: float(found.mean()), f"{choice}_low": low, f"{choice}_high": high, f"{choice}_wrong": wrong}
    line |= {"power": rows.loc[rows["choice"] == ADVISED, "power"].mean()}
    return line | {"p": sign_test(int((advised & ~random).sum()), int((random & ~advised).sum()))}


def sign_test(wins: int, losses: int) -> float:
    """Return the one-sided chance of at least so many wins of a fair coin, 1 where nothing was won or lost."""
    from scipy.stats import binomtest  # noqa: PLC0415 - takes time to import

    return float(binomtest(wins, wins + losses, alternative="greater").pvalue) if wins + losses else 1.0


def advice_targets(rows: DataFrame) -> list[Target]:
    """Return what is asked of the advice."""
    found = rates(rows)
    missing = int((rows["answer"] == MISSING).sum())
    lines = [Target("all", "campaigns without a report", float(missing), len(rows), 0.0, "count")]
    for line in found.to_dict("records"):
        pair, n = str(line["pair"]), int(line["n"])
        lead = float(line[ADVISED] - line[RANDOM])
        lines.append(Target(pair, "told apart by the advised record", line[ADVISED], n, 0.80, "share", False, True))
        lines.append(Target(pair, "lead over a random record", lead, n, 0.0, at_most=False, is_strict=True))
    return lines
