"""Close the loop on every campaign of the study, one file each; a run that was cut goes on where it stopped.

    python studies/calibration/run.py FOLDER --seed 1 --size 150 [--jobs 2] [--without-left-out]

FOLDER/closed/NAME.json holds what a report says, and the models of the mixture with their evidence and prior odds.
"""

import argparse
import json
import sys
import warnings
from collections.abc import Sequence
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from armid.loop import ClosedLoop, close_loop, report_of
from armid.model import EFFECTS
from armid.model.effects.sensor import sensor_effects
from armid.record import read_campaign
from armid.registry import load_registry
from calibration.campaigns import HIDDEN, MACHINE, PLANTS, Task, campaign_of, file_of, kept_answer, tasks, written

KEPT = ("version", "verdict", "also", "effects", "steps", "suspects", "withdrawn", "error", "parameters",
        "probabilities")  # fmt: skip
# After so many campaigns a process begins afresh, so that what it keeps of them is freed.
TASKS_OF_PROCESS = 20
# Models of a smaller weight are not kept.
LEAST = 1e-5


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="run.py", description="Close the loop on synthetic campaigns.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--size", type=int, required=True, help="campaigns of each family of the arm")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument(
        "--without-left-out", action="store_true", help="leave two kinds of machine out, as the fit does"
    )
    options = parser.parse_args(words)
    plan = {"seed": options.seed, "size": options.size, "without_left_out": options.without_left_out}
    head = options.folder / "plan.json"
    if head.exists() and json.loads(head.read_text()) != plan:
        print(f"run.py: {head} tells of another seed or size: a new folder is expected", file=sys.stderr)
        return 2
    (options.folder / "closed").mkdir(parents=True, exist_ok=True)
    written(head, plan)
    open_tasks = [t for t in tasks(options.size) if not file_of(options.folder, t).exists()]
    close = partial(closed, options.folder, options.seed, options.without_left_out)
    print(f"{len(open_tasks)} campaigns to close", flush=True)
    # not an executor of concurrent.futures: that of Python 3.11 may stop for ever where it replaces a process
    with get_context("spawn").Pool(options.jobs, maxtasksperchild=TASKS_OF_PROCESS) as pool:
        for line in pool.imap(close, open_tasks):
            print(line, flush=True)
    return 0


def closed(folder: Path, seed: int, without_left_out: bool, task: Task) -> str:
    """Close one campaign, keep the answer, and return a line about it."""
    warnings.simplefilter("ignore")
    there, entry = campaign_of(task, folder, seed, without_left_out)
    return kept_answer(file_of(folder, task), task, lambda: kept_of(close(task, there, entry)))


def close(task: Task, there: Path, entry: dict[str, Any]) -> ClosedLoop:
    if task.family == MACHINE:
        registry = load_registry([f"{PLANTS}:{entry['machine']}"])
        campaign = read_campaign(there, plants=registry.plants)
        return close_loop(campaign.model(registry.effects), campaign)
    campaign = read_campaign(there)
    model, candidates = campaign.model(), None
    if task.family == HIDDEN:
        taken = {effect["name"] for effect in entry["effects"]}
        every = {**sensor_effects(model.plant), **EFFECTS}
        candidates = {name: each for name, each in every.items() if name not in taken}
    return close_loop(model, campaign, candidates)


def kept_of(found: ClosedLoop) -> dict[str, Any]:
    """Return what is kept of a closed loop; each model as evidence, prior odds, hypotheses, means and deviations."""
    report, mixture = report_of(found), found.inference.posterior
    atoms = [
        {"log_evidence": a.log_evidence, "log_prior": a.log_prior, "names": sorted(a.names),
         "mean": a.mean, "deviation": deviation}
        for a, weight, deviation in zip(mixture.atoms, mixture.weights, mixture.deviations, strict=True)
        if weight >= LEAST
    ]  # fmt: skip
    kept = {key: report[key] for key in KEPT} | {"parameter_names": mixture.parameters, "mixture": atoms}
    return kept | {"leaves_more": found.after.diagnosis.significant}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
