"""Every run of a study that closes the loop: one a campaign."""

import hashlib
from collections.abc import Iterator

from armid.study.loops.study import LABEL, LoopStudy
from armid.study.plan import ID_LENGTH, Planned
from armid.study.sheet import WHOLE
from armid.study.study import canonical


def planned_loops(study: LoopStudy) -> Iterator[Planned]:
    """Yield the runs, campaign by campaign; their settings hold all that decides a result, and not where the key is."""
    sheet = study.sheet
    shared = {
        "kind": sheet.kind, "campaigns": sheet.campaigns, "bounds": sheet.bounds, "fixed": sheet.fixed,
        "seed": sheet.seed,
    }  # fmt: skip
    for case in study.cases:
        wanted = study.candidates_for(case.name)
        looked_for = {"candidates": list(wanted), "own": study.known.own("effects", *wanted)}
        settings = canonical(shared | looked_for | {"case": case.name, "digest": case.digest})
        run = hashlib.sha256(settings.encode()).hexdigest()[:ID_LENGTH]
        yield Planned(run, settings, case.name, LABEL, "", None, WHOLE, sheet.seed, 0)
