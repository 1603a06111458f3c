"""What the page of an identification shows beside result.json: records, search, remarks, how it was made."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armid.display import thinned
from armid.identification.identify import Identification
from armid.identification.remarks import convergence_remarks, remarks
from armid.problem import Replay

Array = NDArray[np.float64]
# Curves of more records than this would make a page that nobody scrolls through.
MOST_RECORDS = 24


def details_of(found: Identification, made_by: Mapping[str, Any]) -> dict[str, Any]:
    """Return details as JSON can hold them, SI; made_by: the command and its options.

    Of long records each curve keeps the samples that `thinned` chooses.
    """
    replays = (*found.train_replays, *found.holdout_replays)
    return {
        "made_by": dict(made_by),
        "remarks": remarks(found),
        "warnings": convergence_remarks(found),
        "records": [record_entry(r, found.candidate) for r in replays[:MOST_RECORDS]],
        "n_records": len(replays),
        "search": curve_entry(found.trace[0].astype(float), found.trace[1]),
    }


def record_entry(replay: Replay, candidate: Array) -> dict[str, Any]:
    """Return one record: measured, simulated and the residual."""
    measured, simulated = replay.measured, replay.signal(candidate[np.newaxis])[0]
    curves = {"measured": measured, "simulated": simulated, "residual": measured - simulated}
    return {
        "file": replay.record.file,
        "role": replay.record.role,
        "noise_rms": replay.record.noise.rms,
        "n_samples": len(measured),
        "curves": {name: curve_entry(replay.times, values) for name, values in curves.items()},
    }


def curve_entry(x: Array, y: Array) -> dict[str, list[float | None]]:
    """Return a curve with no more points than can be seen, in five digits; null for what is not finite."""
    kept = thinned(np.nan_to_num(y))
    return {"x": rounded(x[kept]), "y": rounded(y[kept])}


def rounded(values: Sequence[float] | Array) -> list[float | None]:
    """Return numbers in five digits, null for what is not finite."""
    return [float(f"{v:.5g}") if np.isfinite(v) else None for v in values]
