"""The command line of the scorer, which alone reads a key."""

import argparse
import csv
import io
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from stand.blind.write import key_path
from stand.command import Parser
from stand.refusal import RefusalError
from stand.score.judge import judge, told
from stand.score.targets import Target, targets_of


def main(words: Sequence[str]) -> int:
    """Score a suite as the command line says; give the exit code, 2 with a sentence on stderr when refused."""
    try:
        options = _parser().parse_args(words)
        key = read_json(key_path(options.folder))
        if not options.results.is_dir():
            raise RefusalError(f"{options.results} is no folder, one with a folder for each campaign is expected")
        files = {name: options.results / name / "report.json" for name in key["campaigns"]}
        reports = {name: read_json(file) for name, file in files.items() if file.is_file()}
        rows, missing = judge_all(key["campaigns"], reports)
        targets = targets_of(rows, len(missing))
        _write(options.out or options.results / "score", rows, missing, targets)
    except RefusalError as refusal:
        print(f"test_stand: {refusal}", file=sys.stderr)
        return 2
    for each in targets:
        print(_line(each))
    return 0


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
            told_of = f"the report of {campaign} is no report of a closed loop"
            raise RefusalError(f"{told_of}: {error} is not as expected") from error
    return rows, missing


def read_json(file: Path) -> Any:
    """Read a JSON file."""
    try:
        return json.loads(file.read_text())
    except OSError as error:
        raise RefusalError(f"{file} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise RefusalError(f"{file} is no JSON: {error}") from error


def _write(folder: Path, rows: list[dict[str, Any]], missing: list[dict[str, Any]], targets: list[Target]) -> None:
    """Write judgements.csv and targets.csv, and both as score.json."""
    lines = [asdict(each) for each in targets]
    score = {"judgements": [*rows, *missing], "targets": lines}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "judgements.csv").write_text(_csv([*rows, *missing]))
        (folder / "targets.csv").write_text(_csv(lines))
        (folder / "score.json").write_text(json.dumps(score, indent=1) + "\n")
    except OSError as error:
        raise RefusalError(f"{folder} cannot be written: {error.strerror or error}") from error


def _csv(rows: list[dict[str, Any]]) -> str:
    """Write rows under the keys of all; None leaves a cell empty."""
    heading = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, heading, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _line(target: Target) -> str:
    word = "    " if target.met is None else "ok  " if target.met else "FAIL"
    found = "-" if target.found is None else f"{target.found:.4g}"
    return f"{word} {target.question}: {found} of {target.among} {target.limit}".rstrip()


def _parser() -> argparse.ArgumentParser:
    names = ", ".join(each.name for each in fields(Target))
    parser = Parser(
        prog="test_stand.py score",
        description="Hold the reports of a closed loop against the truth of a blind suite.",
        epilog=f"Writes judgements.csv (one row a campaign), targets.csv ({names}) and both as score.json.",
        allow_abbrev=False,
    )
    parser.add_argument("folder", type=Path, metavar="OUT_FOLDER", help="the suite; its key lies beside it")
    parser.add_argument("results", type=Path, metavar="RESULTS_FOLDER", help="holds CAMPAIGN/report.json for each")
    parser.add_argument("--out", type=Path, help="where the score goes (default: RESULTS_FOLDER/score)")
    return parser
