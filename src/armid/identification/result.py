"""What an identification found, as numbers for other programs."""

from dataclasses import asdict
from typing import Any

import numpy as np

from armid.identification.errors import Errors, record_errors
from armid.identification.identify import Identification
from armid.identification.versions import versions_of
from armid.problem import Replay

PACKAGES = ("armid", "numpy", "scipy", "pandas", "numba", "pymoo", "nlopt")


def result_of(found: Identification) -> dict[str, Any]:
    """Return everything of an identification that JSON can hold, SI throughout; what is not known is null."""
    names = found.information.names
    correlation = found.information.correlation
    replays = (*found.train_replays, *found.holdout_replays)
    return {
        "campaign": found.campaign.name,
        "plant": found.model.plant.name,
        "effects": [e.name for e in found.model.effects],
        "parameters": {name: entry(found, i) for i, name in enumerate(found.space.names)},
        "error": {"train": errors(found.train), "holdout": errors(found.holdout)},
        "error_by_record": {r.record.file: by_record(found, r) for r in replays},
        "correlation": {
            a: {b: finite(correlation[i, j]) for j, b in enumerate(names)} for i, a in enumerate(names)
        },
        "unit": found.campaign.unit,
        "fitness": found.fitness.name,
        "fitness_value": finite(found.value),
        "identifier": found.identifier,
        "budget": found.budget,
        "used": found.used,
        "failed": found.n_failed,
        "stopped": found.stopped,
        "seed": found.seed,
        "noise": {
            r.record.file: {"rms": r.record.noise.rms, "mean": r.record.noise.mean, "source": r.record.noise.source}
            for r in replays
        },
        "engine_error": max(r.engine_error for r in found.train_replays),
        "model": str(found.model),
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Return package -> version, of Python too."""
    return versions_of(PACKAGES)


def entry(found: Identification, i: int) -> dict[str, Any]:
    """Return value, interval, bounds and flag of one parameter; a fixed one has neither interval nor bounds."""
    space, free = found.space, bool(found.space.free[i])
    half = found.information.half_width[found.information.names.index(space.names[i])] if free else 0.0
    value = float(found.candidate[i])
    return {
        "value": value,
        "unit": space.units[i],
        "low": finite(value - half) if free else None,
        "high": finite(value + half) if free else None,
        "bound_low": float(space.low[i]) if free else None,
        "bound_high": float(space.high[i]) if free else None,
        "bound_active": bool(found.at_bound[i]),
    }


def by_record(found: Identification, replay: Replay) -> dict[str, Any]:
    """Return role and errors of one record."""
    return {"role": replay.record.role, **(errors(record_errors(replay, found.candidate)) or {})}


def errors(found: Errors | None) -> dict[str, float | None] | None:
    """Return errors with null for what is not finite."""
    return None if found is None else {k: finite(v) for k, v in asdict(found).items()}


def finite(value: float | None) -> float | None:
    """Return a float that JSON can hold, None for NaN and infinity."""
    return None if value is None or not np.isfinite(value) else float(value)
