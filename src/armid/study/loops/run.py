"""One run of a study that closes the loop: one campaign, its whole report kept."""

import json
import time
from datetime import UTC, datetime

from numpy.random import default_rng

from armid.discrepancy import close_loop, report_of
from armid.model import ArmidError, Model
from armid.record import read_campaign
from armid.study.known import chosen
from armid.study.loops.campaigns import digest_of
from armid.study.outcome import DONE, Outcome, Task
from armid.study.versions import versions
from armid.study.workshop import Workshop


def close_loop_run(task: Task, workshop: Workshop) -> Outcome:
    """Close the loop on one campaign, on one thread.

    Raises ArmidError for a campaign that cannot be read or has changed, and whatever the loop raises.
    """
    began, began_cpu = time.perf_counter(), time.process_time()
    started_at = datetime.now(UTC).isoformat(timespec="seconds")
    settings = json.loads(task.settings)
    known, folder = workshop.known, workshop.folder / settings["campaigns"] / settings["case"]
    if digest_of(folder) != settings["digest"]:
        raise ArmidError(f"campaign {settings['case']} has changed since the study was started: start it again")
    campaign = read_campaign(folder, known.plants, known.effects)
    model = Model(campaign.plant)
    for name in campaign.effects:
        model = model + chosen(known.effects, name, "effect", "campaign")
    candidates = {name: chosen(known.effects, name, "effect", "settings") for name in settings["candidates"]}
    bounds = {name: (low, high) for name, (low, high) in settings["bounds"].items()}
    found = close_loop(model, campaign, candidates, default_rng(settings["seed"]), bounds, settings["fixed"], threads=1)
    report = json.dumps(report_of(found), allow_nan=False)
    rows = {"loops": [(found.verdict, time.process_time() - began_cpu, report)]}
    seconds = time.perf_counter() - began
    return Outcome(task.run, DONE, "", 0, seconds, started_at, str(model), versions(), rows)
