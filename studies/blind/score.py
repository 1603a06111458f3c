"""Hold what closed loops said of blind campaigns against the truth: targets, tables, figures, and a page of all.

    python studies/blind/score.py RESULTS --key KEY --out DIR

RESULTS is what `armid study` wrote (it holds study.sqlite, read here with sqlite3), or a folder with a report.json in a
folder for each campaign, as `armid export reports` writes it; times are known of the first alone. KEY is the file that
the test stand wrote beside the campaigns; no loop opens it. DIR gets report.md, each table as CSV, each
figure as PNG. The judgements and targets are the test stand's, which shares no code with armid.
"""

import argparse
import json
import sqlite3
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from matplotlib.figure import Figure
from pandas import DataFrame

from blind import advice, families, tables
from blind.figures import advice_figure, held_out_figure
from stand import RefusalError
from stand.command import Parser, carry_out
from stand.score.judge import judge_all, read_json
from stand.score.targets import Target, aim, targets_of

WORDS = (
    "Shares with their 95 % Wilson interval; `n` counts campaigns (of a bias: values). A group holds the truth when it "
    "has at most 4 effects, one of them true. An aim that no campaign tells of is neither met nor missed; lines "
    "without a target inform."
)
TWO = (
    "Both right: each truth has its own name, or a group of at most 4 of its own that holds it, and nothing else is "
    "named."
)
UNLISTED = "The arm has an effect that no library holds: a name may explain a part, but not be said to explain all."
ONE_STROKE = "One lowering stroke, with one effect at its middle size or none: what can be known there is little."
HELD_OUT = (
    "RMSE on the records held out over the noise that is really in them, before and after the loop, one pair of marks "
    "a campaign; the dashed line is what is aimed at."
)
ADVICE = (
    "Share of the campaigns in which the true effect of the pair stands alone after one record more, with its 95 % "
    "Wilson interval; the number of campaigns stands behind the pair."
)
# Workers that the suite is meant for, each with one thread.
WORKERS = 2
Times = Mapping[str, tuple[float, float]]


def main(words: Sequence[str]) -> int:
    """Score as the command line says; give the exit code, 2 with a sentence on stderr when refused."""
    parser = Parser(prog="score.py", description="Score closed loops on blind campaigns.")
    parser.add_argument("results", type=Path, metavar="RESULTS", help="what `armid study` wrote, or folder of reports")
    parser.add_argument("--key", type=Path, required=True, help="the truth, as the test stand wrote it")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where page, tables and figures go")
    return carry_out(_score, words, parser)


def _score(options: argparse.Namespace) -> str:
    try:
        key = read_json(options.key)["campaigns"]
        reports, times = read_results(options.results)
        options.out.mkdir(parents=True, exist_ok=True)
        return score(key, reports, times, options.out, options.results.name)
    except (KeyError, TypeError) as error:
        raise RefusalError(f"{error} of {options.key} or of a report is not as expected") from error
    except OSError as error:
        raise RefusalError(f"{options.out} cannot be written: {error.strerror or error}") from error


def read_results(folder: Path) -> tuple[dict[str, Any], Times]:
    """Return campaign -> report, and campaign -> seconds on the wall and of the processor where they are known."""
    store = folder / "study.sqlite"
    if not store.is_file():
        if not folder.is_dir():
            raise RefusalError(f"{folder} is not a folder, one with a folder for each campaign is expected")
        return {file.parent.name: read_json(file) for file in sorted(folder.glob("*/report.json"))}, {}
    kept = "FROM plan p JOIN runs r USING (run) JOIN loops l USING (run)"
    query = f'SELECT p."case", l.report, r.seconds, l.cpu_seconds {kept}'
    try:
        with closing(sqlite3.connect(f"{store.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            rows = connection.execute(query).fetchall()
    except sqlite3.Error as error:
        raise RefusalError(f"{store} is not a store of closed loops: {error}") from error
    return {row[0]: json.loads(row[1]) for row in rows}, {row[0]: (row[2], row[3]) for row in rows}


def score(key: Mapping[str, Any], reports: Mapping[str, Any], times: Times, out: Path, name: str) -> str:
    """Write page, tables and figures of a suite, and return what is printed."""
    kinds = {"choice": advice_parts, "fault": families.parts}
    classes = ", ".join(f"{n} {c.replace('_', ' ')}" for c, n in Counter(e["class"] for e in key.values()).items())
    make = next((make for word, make in kinds.items() if any(word in e for e in key.values())), suite_parts)
    targets, sections = make(key, reports, times, out)
    aims = [t for t in targets if t.met is not None]
    missed = [t.question for t in aims if not t.met]
    lacks = f"; missed: {'; '.join(missed)}" if missed else ""
    answer = f"{len(aims) - len(missed)} of {len(aims)} targets are met{lacks}."
    marks = {None: "    ", True: "ok  ", False: "FAIL"}
    said = [f"{marks[t.met]} {t.question}: {tables.measured(t)} of {t.among} {t.limit}".rstrip() for t in targets]
    n_there = sum(campaign in reports for campaign in key)
    state = f"{'Complete' if n_there == len(key) else 'NOT COMPLETE'}: {n_there} of {len(key)} campaigns ({classes})."
    head = (
        f"# {name}\n\n**{answer}** {state}\n\n- Synthetic: records of a simulated arm; no machine was measured.\n"
        "- Each loop saw its campaign alone; the key that holds the truth was opened for this page, by nothing before."
    )
    page = [head]
    for title, parts in sections.items():
        page.append(f"## {title}")
        for part in parts:
            page.append(part if isinstance(part, str) else part.markdown())
            if isinstance(part, tables.Table):
                (out / f"{part.name}.csv").write_text(part.frame.to_csv(index=False, lineterminator="\n"))
    (out / "report.md").write_text("\n\n".join(page) + "\n", encoding="utf-8")
    return "\n".join([*said, answer, state, f"wrote report.md, tables and figures to {out}"])


Sections = dict[str, list["tables.Table | str"]]


def drawn(out: Path, name: str, title: str, words: str, figure: Figure) -> str:
    """Write a figure, its bytes depend on what is drawn alone; return its part of the page."""
    figure.savefig(out / f"{name}.png", dpi=120, metadata={"Software": None})
    return f"### {title}\n\n![{title}]({name}.png)\n\n{words}"


def suite_parts(
    key: Mapping[str, Any], reports: Mapping[str, Any], times: Times, out: Path
) -> tuple[list[Target], Sections]:  # fmt: skip
    """Return targets and sections of a blind suite; figures are drawn meanwhile."""
    judgements, missing = judge_all(key, reports)
    targets = targets_of(judgements, len(missing)) + time_targets([times[row["campaign"]][0] for row in judgements
                                                                   if row["campaign"] in times])  # fmt: skip
    sections: Sections = {"Targets": [tables.targets_table(targets, WORDS)]}
    if not judgements:
        return targets, sections
    every = tables.rows_of([*judgements, *missing])
    for i, name in enumerate(("seconds", "cpu_seconds") if times else ()):
        every[name] = [times[c][i] if c in times else None for c in every["campaign"]]
    rows = every[every["judgement"] != tables.MISSING]
    sections["Answers"] = [tables.answers_by_class(every)]
    if len(tables.of_class(rows, "single")):
        sections["Answers"] += [tables.answers_by_effect(rows), tables.answers_given(rows)]
    sections["False alarms"] = [tables.false_alarms(rows)]
    for label, title, words in (("two", "Two effects at once", TWO), ("unlisted", "Unlisted effects", UNLISTED),
                                ("one_stroke", "One stroke only", ONE_STROKE)):  # fmt: skip
        if len(tables.of_class(rows, label)):
            sections[title] = [tables.campaign_lines(rows, label, title, words)]
    sections["Errors and parameters"] = [tables.held_out(rows), tables.parameter_bias(rows), tables.trust(rows)]
    known = tables.parts(rows.dropna(subset=["after_over_floor"]))
    if known:
        figure = held_out_figure(known, 1.10)
        sections["Errors and parameters"].append(
            drawn(out, "held_out", "Held-out error over its noise", HELD_OUT, figure)
        )
    sections["Groups and times"] = [tables.group_sizes(rows)]
    if times:
        sections["Groups and times"].append(tables.times(rows))
    (out / "campaigns.csv").write_text(every.to_csv(index=False, lineterminator="\n"))
    return targets, sections


def time_targets(seconds: Sequence[float]) -> list[Target]:
    """Return what is asked of the time, as the clock on the wall showed it, where it is known."""
    if not seconds:
        return []
    suite = sum(seconds) / 60.0 / WORKERS
    return [
        aim("one thread each: closing one campaign, median [s]", median(seconds), len(seconds), "<= 30"),
        aim(f"one thread each: the whole suite with {WORKERS} workers [min]", suite, len(seconds), "<= 60"),
    ]


def advice_parts(
    key: Mapping[str, Any], reports: Mapping[str, Any], _: Times, out: Path
) -> tuple[list[Target], Sections]:  # fmt: skip
    """Return targets and sections of the proof of advice."""
    rows = advice.separations(key, reports)
    found: DataFrame = advice.rates(rows)
    targets = advice.targets_of(rows, found)
    sections: Sections = {"Targets": [tables.targets_table(targets, advice.WORDS)], "Pairs": []}
    if len(found):
        figure = advice_figure(found, advice.LIMIT)
        sections["Pairs"].append(drawn(out, "advice", "Advised and random records", ADVICE, figure))
    sections["Pairs"] += advice.tables_of(rows, found)
    return targets, sections


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
