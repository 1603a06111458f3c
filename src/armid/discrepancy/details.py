"""What the page of a closed loop shows beside report.json: equations, residuals, candidates, how it was made."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from armid.discrepancy.conclusion import conclusion
from armid.discrepancy.projected import projected, rest_of
from armid.discrepancy.result import ClosedLoop, Judgement, error_entry, finite
from armid.discrepancy.view import View
from armid.discrepancy.words import diagnosis_sentences, doubt_sentences, missing_sentences, shift_sentences
from armid.identification import record_errors
from armid.identification.details import MOST_RECORDS, curve_entry
from armid.identification.result import versions

# Candidates whose predicted change of the residual is drawn.
MOST_DRAWN = 4


def details_of(found: ClosedLoop, made_by: Mapping[str, Any]) -> dict[str, Any]:
    """Return details as JSON can hold them, SI; made_by: the command and its options.

    Of long records each curve keeps the samples that `thinned` chooses.
    """
    records = [r for name in ("train", "holdout") for r in records_of(getattr(found.before, name),
                                                                      getattr(found.after, name))]  # fmt: skip
    return {
        "made_by": dict(made_by),
        "versions": versions(),
        "conclusion": conclusion(found),
        "shifts": shift_sentences(found.before, found.after) if found.steps else [],
        "doubts": doubt_sentences(found.after),
        "diagnosis": {"before": told(found.before), "after": told(found.after) if found.steps else None},
        "missing": missing_sentences(found.missing) if found.missing is not None else [],
        "equations": {"before": str(found.before.model), "after": str(found.after.model)},
        "records": records[:MOST_RECORDS],
        "n_records": len(records),
        "candidates": candidates_of(found),
        "advice": [a.words for a in found.advice],
    }


def told(judged: Judgement) -> dict[str, list[str] | None]:
    """Return what was found in the residuals of a model, on train and holdout."""
    unseen = judged.holdout_diagnosis
    return {"train": diagnosis_sentences(judged.diagnosis),
            "holdout": None if unseen is None else diagnosis_sentences(unseen)}  # fmt: skip


def records_of(before: View | None, after: View | None) -> list[dict[str, Any]]:
    """Return each record with its errors and residuals before and after."""
    if before is None or after is None:
        return []
    pairs = zip(before.replays, before.raw, after.replays, after.raw, strict=True)
    return [
        {
            "file": old.record.file, "role": old.record.role, "n_samples": len(was),
            "noise_rms": finite(old.record.noise.rms),
            "error": {"before": error_entry(record_errors(old, before.candidate)),
                      "after": error_entry(record_errors(new, after.candidate))},
            "curves": {"before": curve_entry(old.times, was), "after": curve_entry(new.times, now)},
        }
        for old, was, new, now in pairs
    ]  # fmt: skip


def candidates_of(found: ClosedLoop) -> dict[str, Any]:
    """Return the candidates at the declared model, best first, with the projected sensitivities of the scores.

    drop: predicted fall of chi2 as a share of it; reached: that of the full fit with the effect alone, null where there
    was none. Curves are whitened, in standard deviations of the noise, against the number of the sample.
    """
    start = found.before.fit
    reached: dict[str, float] = {}
    for fit in found.search.of_size(1):
        name = found.library.public(fit.active[0])
        reached[name] = max(reached.get(name, 0.0), 1.0 - fit.chi2 / start.chi2)
    listed: list[dict[str, Any]] = []
    for score in found.search.trace(start):
        name = found.library.public(score.name)
        if any(entry["effect"] == name for entry in listed):
            continue
        behind = projected(start, score.name, found.library)
        drawn = len(listed) < MOST_DRAWN
        listed.append({
            "effect": name, "drop": finite(score.drop / start.chi2), "p": finite(score.p),
            "reached": finite(reached.get(name)), "share": finite(behind.share), "alignment": finite(behind.alignment),
            "curve": curve_entry(np.arange(len(behind.change), dtype=float), behind.change) if drawn else None,
        })  # fmt: skip
    rest = rest_of(start)
    edges = found.before.train.evidence.edges
    return {
        "listed": listed,
        "residual": curve_entry(np.arange(len(rest), dtype=float), rest),
        "edges": [int(e) for e in edges],
        "files": [r.record.file for r in found.before.train.replays],
    }
