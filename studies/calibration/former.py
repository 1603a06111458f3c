"""Close the loop of an earlier version on the campaigns that `run.py` has closed; `score.py` then compares the two.

    PYTHONPATH=CHECKOUT/src python studies/calibration/former.py FOLDER [--most 50]

FOLDER/former/NAME.json holds the verdict, the parameters and the processor time. A run that was cut goes on where it
stopped.
"""

import argparse
import json
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from armid.loop import report_of
from calibration.campaigns import Task, file_of, former_file, kept_answer, tasks, truth_file
from calibration.run import close

KEPT = ("verdict", "parameters")


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="former.py", description="Close the loop of an earlier version.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--most", type=int, default=None, help="campaigns in all")
    options = parser.parse_args(words)
    head = options.folder / "plan.json"
    if not head.exists():
        print(f"former.py: {head} is not there: a folder that run.py has filled is expected", file=sys.stderr)
        return 2
    plan = json.loads(head.read_text())
    done = [task for task in tasks(plan["size"]) if file_of(options.folder, task).exists()][: options.most]
    (options.folder / "former").mkdir(exist_ok=True)
    for task in done:
        if not former_file(options.folder, task).exists():
            print(closed(options.folder, task), flush=True)
    return 0


def closed(folder: Path, task: Task) -> str:
    """Close one campaign, keep the answer, and return a line about it."""
    warnings.simplefilter("ignore")
    return kept_answer(former_file(folder, task), task, lambda: answer(folder, task))


def answer(folder: Path, task: Task) -> dict[str, Any]:
    entry = json.loads(truth_file(folder, task).read_text())
    # all names of armid that `close` and `run.py` use are there in both versions
    report = report_of(close(task, folder / "campaigns" / task.campaign, entry))
    return {key: report[key] for key in KEPT}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
