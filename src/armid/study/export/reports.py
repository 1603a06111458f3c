"""The reports of closed loops as one file a campaign."""

import json
from collections.abc import Callable
from pathlib import Path

from armid.study.results import StudyResults

FILE_NAME = "report.json"


def export_reports(results: StudyResults, path_of: Callable[[str], Path]) -> int:
    """Write CAMPAIGN/report.json for each campaign that was closed, as `armid close-loop` does; return how many.

    path_of: file name -> where to write it.
    """
    loops = results.loops
    for case, report in zip(loops["case"], loops["report"], strict=True):
        text = json.dumps(report, indent=2, allow_nan=False) + "\n"
        path_of(f"{case}/{FILE_NAME}").write_text(text, encoding="utf-8")
    return len(loops)
