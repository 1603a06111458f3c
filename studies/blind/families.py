"""What closed loops said of campaigns as real ones are: a faulty record, constants that are off, sets of effects.

The truth is the key of `studies/stand/families.py`. What a report claims is read as the stand's judge reads it.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from pandas import DataFrame

from blind import tables
from stand.arm import PARAMETERS
from stand.score.judge import LARGEST_GROUP, read_claim
from stand.score.targets import Target, aim, share, without_report

Row = dict[str, Any]
Show = dict[str, str | tuple[str, str]]
WORDS = (
    "Shares with their 95 % Wilson interval; `n` counts campaigns, of parameters: values. A fault that moves its "
    "record by no more than twice the noise may pass unseen. A name stands alone when no other effect may stand in its "
    "place. Intervals count that the loop says hold; they count the tolerances of the constants and effects that may "
    "be missing, those of noise alone do not. Lines without a target inform."
)
BY_KIND = (
    "Campaigns in which one record is at fault, by kind. Seen: record and kind are right. Intervals: those of noise "
    "alone, where they are said to hold."
)
BY_FAMILY = "Time of the processor to close one campaign, and what was withdrawn, by family."
MISSES = "Every campaign that speaks against a target, and why."
# A fault counts that moves its record by so many times the noise; held-out is at the noise within this factor of it.
MOVES, AT_NOISE = 2.0, 1.1
# Held-out is worse that is by more than this share, and above the noise.
WORSE = 1.02
# A parameter is wrong that is off by more than this share.
OFF = 0.01


def parts(
    key: Mapping[str, Any], reports: Mapping[str, Any], times: Mapping[str, tuple[float, float]], out: Path
) -> tuple[list[Target], dict[str, list["tables.Table | str"]]]:
    """Return targets and sections of a suite of families; a file with a line a campaign is written."""
    rows = [
        judged(campaign, key[campaign], reports[campaign]) | {"cpu_seconds": times.get(campaign, (None, None))[1]}
        for campaign in key if campaign in reports
    ]  # fmt: skip
    targets = targets_of(rows, len(key) - len(rows))
    sections: dict[str, list[tables.Table | str]] = {"Targets": [tables.targets_table(targets, WORDS)]}
    if rows:
        frame = DataFrame(rows)
        (out / "campaigns.csv").write_text(frame.to_csv(index=False, lineterminator="\n"))
        sections["Campaigns"] = [by_kind(frame), by_family(frame), misses(frame)]
    return targets, sections


def judged(campaign: str, entry: Mapping[str, Any], report: Mapping[str, Any]) -> Row:
    """Return one row: what was planted, what was said, and what of it is wrong."""
    truths, fault = {e["name"] for e in entry["effects"]}, entry["fault"]
    claim = read_claim(report)
    claims = claim.groups
    held = {t for t in truths if any(t in g and len(g) <= LARGEST_GROUP for g in claims.values())}
    wrong = [name for name, group in claims.items() if not group & truths]
    accused = [s for s in report["suspects"] if entry["dirt"] != "gap" or s["kind"] != "gap"]
    before, after = (report["error"][when]["holdout"]["rmse"] for when in ("before", "after"))
    floor, found = entry["floor"]["holdout"], report["parameters"]["after"]
    row = {
        "campaign": campaign, "family": entry["class"], "truth": " + ".join(sorted(truths)), "dirt": entry["dirt"],
        "fault": fault.get("kind", ""), "size": fault.get("size"), "record": fault.get("record", ""),
        "moves": fault.get("moves"), "constants": ", ".join(f"{n} {v:+.1%}" for n, v in entry["constants"].items()),
        "verdict": report["verdict"],
        "said": "; ".join([*filter(None, [claim.said]), *(f"({n})" for n in report["effects"] if n not in claims)]),
        "suspects": "; ".join(f"{s['record']} {s['kind']}" for s in report["suspects"]),
        "seen": any((s["record"], s["kind"]) == (fault.get("record"), fault.get("kind"))
                    and fault.get("parameter", "") in s.get("parameter", "").split(", ") for s in report["suspects"]),
        "accused": bool(accused), "all_named": held == truths, "wrong": ", ".join(wrong),
        "wrong_alone": any(len(claims[n]) == 1 for n in wrong),
        "withdrawn": report["withdrawn"] is not None, "before_over_floor": before / floor,
        "after_over_floor": after / floor, "worse": after > max(WORSE * before, AT_NOISE * floor),
    }  # fmt: skip
    for name in PARAMETERS:
        truth, p = entry["parameters"][name], found[name]
        row |= {
            f"off_{name}": p["value"] / truth - 1.0,
            f"holds_{name}": p["low"] <= truth <= p["high"] if p["interval_holds"] else None,
            f"alone_{name}": p["noise_low"] <= truth <= p["noise_high"] if p["interval_holds"] else None,
            f"trusted_{name}": p["trusted"],
            f"narrow_{name}": p["trusted"] and 0.5 * (p["high"] - p["low"]) < OFF * abs(p["value"]),
        }
    return row


def targets_of(rows: Sequence[Row], missing: int) -> list[Target]:
    """Reckon the targets of the families, each for those campaigns that tell of it."""
    family = {name: [r for r in rows if r["family"] == name] for name in dict.fromkeys(r["family"] for r in rows)}
    faults, one, controls = (family.get(name, []) for name in ("fault", "constant", "control"))
    constants = [*one, *family.get("constants", [])]
    moved = [r for r in faults if r["moves"] > MOVES]
    held = [r[f"holds_{name}"] for r in faults for name in PARAMETERS]
    trusted, of_noise = values(constants, "off", "trusted"), "parameters inside the interval of noise alone"
    of_record = f"one faulty record, moved by more than {MOVES:g} times its noise"
    found = [
        without_report(missing, len(rows) + missing),
        share(f"{of_record}: record and kind are right", moved, lambda r: r["seen"], ">= 0.9"),
        share("one faulty record: a physical name is claimed", faults, lambda r: bool(r["wrong"]), "<= 0.01"),
        share("one faulty record: parameters inside their interval", values(faults, "holds"), bool, ">= 0.93"),
        share(f"one faulty record: {of_noise}", values(faults, "alone"), bool, ">= 0.93"),
        share("one faulty record: parameters with an interval that is said to hold", held, lambda v: v is not None),
        share("constants off: a wrong physical name alone", constants, lambda r: r["wrong_alone"], "<= 0.01"),
        share("constants off: a wrong physical name, alone or beside others", constants, lambda r: bool(r["wrong"])),
        share("constants off: trusted parameters off by more than 1 %", trusted, is_off, "<= 0.01"),
        share("constants off: parameters inside their interval", values(constants, "holds"), bool, ">= 0.93"),
        share("one constant off: held-out error up to 1.1 of the noise", one, is_at_noise, ">= 0.9"),
    ]
    for word, limit in (("two", ">= 0.95"), ("three", ">= 0.85")):
        some = family.get(word, [])
        found += [
            share(f"{word} effects: all named, alone or in a group", some, lambda r: r["all_named"], limit),
            share(f"{word} effects: a wrong name is claimed", some, lambda r: bool(r["wrong"]), "<= 0.01"),
        ]
    found += [
        share("controls: false claims", controls, lambda r: bool(r["wrong"]), "<= 0.005"),
        share("controls: unexplained", controls, lambda r: r["verdict"] == "unexplained", "<= 0.02"),
        share("controls: a record is accused", controls, lambda r: r["accused"], "<= 0.02"),
        share("controls: anything but `no_discrepancy`", controls, lambda r: r["verdict"] != "no_discrepancy"),
        share("all: trusted parameters off by more than 1 %", values(rows, "off", "trusted"), is_off),
        share("all: of these with an interval below 1 %", values(rows, "off", "narrow"), is_off, "<= 0.01"),
        share("all: parameters inside their interval", values(rows, "holds"), bool),
        share(f"all but constants off: {of_noise}", values([r for r in rows if not r["constants"]], "alone"), bool),
        share("all: additions withdrawn", rows, lambda r: r["withdrawn"], "<= 0.02"),
        share("all: held-out error of the model in force worse than of the declared", rows, lambda r: r["worse"],
              "<= 0"),
    ]  # fmt: skip
    trends = [r for r in family.get("trend", []) if r["moves"] > MOVES]
    if trends:
        found += [
            share("a trend over records: told, of the right parameter", trends, lambda r: r["seen"]),
            share("a trend over records: a physical name is claimed", trends, lambda r: bool(r["wrong"]), "<= 0.01"),
            share("a trend over records: parameters inside their interval", values(trends, "holds"), bool),
        ]
    seconds = [r["cpu_seconds"] for r in rows if r["cpu_seconds"] is not None]
    for word, limit, of in (("median", 6.0, median), ("worst", 60.0, max)):
        value = of(seconds) if seconds else None
        found.append(aim(f"CPU time of a campaign, {word} [s]", value, len(seconds), f"<= {limit:g}"))
    return found


def values(rows: Sequence[Mapping[Any, Any]], what: str, where: str = "") -> list[Any]:
    """Return a column of every parameter, where it has a value; where: only those for which this column is true."""
    return [r[f"{what}_{name}"] for r in rows for name in PARAMETERS
            if r[f"{what}_{name}"] is not None and (not where or r[f"{where}_{name}"])]  # fmt: skip


def is_off(error: float) -> bool:
    return abs(error) > OFF


def is_at_noise(row: Mapping[Any, Any]) -> bool:
    return bool(row["after_over_floor"] <= AT_NOISE)


def by_kind(frame: DataFrame) -> tables.Table:
    lines = []
    for kind, part in frame[frame["fault"] != ""].groupby("fault"):
        rows = part.to_dict("records")
        held = values(rows, "alone")
        lines.append({"kind": kind, "n": len(part), "moves": part["moves"].median(),
                      "large": (part["moves"] > MOVES).sum(), "seen": part["seen"].mean(),
                      "wrong": (part["wrong"] != "").mean(),
                      "holds": sum(held) / len(held) if held else None, "n_held": len(held),
                      "after": part["after_over_floor"].median()})  # fmt: skip
    show: Show = {"kind": "kind", "n": ("n", ".0f"), "moves": ("moves its record, median [noise]", ".3g"),
            "large": (f"more than {MOVES:g}", ".0f"), "seen": ("seen [%]", "%"),
            "wrong": ("physical name claimed [%]", "%"), "holds": ("interval holds the truth [%]", "%"),
            "n_held": ("of", ".0f"), "after": ("held-out error/noise", ".3g")}  # fmt: skip
    return tables.Table("faults", "Faults of one record", BY_KIND, DataFrame(lines, columns=list(show)), show)


def by_family(frame: DataFrame) -> tables.Table:
    lines = frame.groupby("family", sort=False).agg(
        n=("campaign", "size"), withdrawn=("withdrawn", "mean"), median=("cpu_seconds", "median"),
        most=("cpu_seconds", "max"),
    ).reset_index()  # fmt: skip
    show: Show = {"family": "family", "n": ("n", ".0f"), "withdrawn": ("withdrawn [%]", "%"),
            "median": ("CPU median [s]", ".3g"), "most": ("CPU most [s]", ".3g")}  # fmt: skip
    return tables.Table("by_family", "Families", BY_FAMILY, lines, show)


def misses(frame: DataFrame) -> tables.Table:
    lines = [{**row, "why": "; ".join(why)} for row in frame.to_dict("records") if (why := faults_found(row))]
    show: Show = {"campaign": "campaign", "family": "family", "why": "why", "truth": "effects", "fault": "fault",
            "record": "record", "size": ("size", ".3g"), "moves": ("moves [noise]", ".3g"),
            "constants": "constants off", "dirt": "dirt", "verdict": "verdict",
            "said": "said", "suspects": "suspects"}  # fmt: skip
    return tables.Table("misses", "Misses", MISSES, DataFrame(lines, columns=list(show)), show)


def faults_found(row: Mapping[Any, Any]) -> list[str]:
    """Return in words what of a campaign speaks against a target."""
    family = row["family"]
    outside = [n for n in PARAMETERS if row[f"{'holds' if row['constants'] else 'alone'}_{n}"] is False]
    off = [n for n in PARAMETERS if row[f"trusted_{n}"] and abs(row[f"off_{n}"]) > OFF]
    said = {
        "not seen": family in ("fault", "trend") and row["moves"] > MOVES and not row["seen"],
        f"claimed {row['wrong']}": bool(row["wrong"]),
        "not all named": not row["all_named"],
        f"outside: {', '.join(outside)}": bool(outside),
        f"trusted and off: {', '.join(off)}": bool(off),
        "accused": family == "control" and row["accused"],
        "unexplained": family == "control" and row["verdict"] == "unexplained",
        "held-out above the noise": family == "constant" and not is_at_noise(row),
        "withdrawn": row["withdrawn"],
        "worse than declared": row["worse"],
    }
    return [words for words, holds in said.items() if holds]
