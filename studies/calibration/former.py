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
# Names that both versions have.
from armid.loop.close_loop import close_loop
from armid.loop.result import report_of
from armid.model import EFFECTS
from armid.record import read_campaign
from armid.registry import load_registry
from calibration.campaigns import (
    HIDDEN,
    MACHINE,
    PLANTS,
    Task,
    file_of,
    former_file,
    kept_answer,
    tasks,
    truth_file,
)

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
    registry = load_registry([f"{PLANTS}:{entry['machine']}"] if task.family == MACHINE else [])
    campaign = read_campaign(folder / "campaigns" / task.campaign, plants=registry.plants)
    taken = {effect["name"] for effect in entry["effects"]} if task.family == HIDDEN else set()
    candidates = {name: each for name, each in EFFECTS.items() if name not in taken} if taken else None
    report = report_of(close_loop(campaign.model(registry.effects), campaign, candidates))
    return {key: report[key] for key in KEPT}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
