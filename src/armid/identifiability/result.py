"""What an examination found, as numbers for other programs."""

import platform
from importlib.metadata import version
from typing import Any

import numpy as np

from armid.identifiability.collinearity import collinearity_index, normalised
from armid.identifiability.examine import Examination
from armid.identifiability.profile import Profile
from armid.identifiability.purchase import Offer
from armid.identifiability.remarks import remarks

PACKAGES = ("armid", "numpy", "scipy", "numba")


def result_of(found: Examination) -> dict[str, Any]:
    """Return everything of an examination that JSON can hold, SI throughout; what is not known is null."""
    names, correlation = found.space.free_names, found.information.correlation
    return {
        "campaign": found.campaign.name,
        "plant": found.model.plant.name,
        "effects": [e.name for e in found.model.effects],
        "unit": found.campaign.unit,
        "at": "given" if found.given else "estimate",
        "parameters": {p.name: entry(found, i, p) for i, p in enumerate(found.profiles)},
        "fixed": {n: float(v) for n, v in zip(found.space.names, found.space.fixed, strict=True) if not np.isnan(v)},
        "correlation": {a: {b: finite(correlation[i, j]) for j, b in enumerate(names)} for i, a in enumerate(names)},
        "collinearity_index": collinearity_index(found.information.fisher),
        "groups": [
            {"names": list(g.names), "index": g.index,
             "direction": dict(zip(g.names, (float(d) for d in g.direction), strict=True))} for g in found.groups
        ],
        "directions": directions(found),
        "records": {
            r.record.file: {"level": level.rms, "effective_fraction": level.effective_fraction,
                            "from_residual": level.from_residual, "assumed": level.assumed}
            for r, level in zip(found.replays, found.information.levels, strict=True)
        },
        "ranked_by": found.ranked_by,
        "offers": [offer_entry(found, offer) for offer in found.offers],
        "remarks": remarks(found),
        "versions": {"python": platform.python_version(), **{p: version(p) for p in PACKAGES}},
    }  # fmt: skip


def entry(found: Examination, i: int, profile: Profile) -> dict[str, Any]:
    """Return what is known of one free parameter; `value` is where sensitivities were taken."""
    value, half = float(found.x[i]), float(found.information.half_width[i])
    return {
        "value": value,
        "unit": profile.unit,
        "deviation": finite(found.information.deviation[i]),
        "low": finite(value - half),
        "high": finite(value + half),
        "bound_low": profile.box[0],
        "bound_high": profile.box[1],
        "bound_active": bool(found.at_bound[i]),
        "profile": {
            "minimum": profile.estimate,
            "low": profile.low,
            "high": profile.high,
            "bounded_low": profile.bounded[0],
            "bounded_high": profile.bounded[1],
            "agrees_with_curvature": profile.agrees,
            "values": profile.values.tolist(),
            "rise": profile.rise.tolist(),
        },
    }


def directions(found: Examination) -> list[dict[str, Any]]:
    """Return the eigenvectors of the information matrix scaled to a diagonal of 1, the weakest first."""
    scaled, seen = normalised(found.information.fisher)
    names = [n for n, s in zip(found.space.free_names, seen, strict=True) if s]
    values, vectors = np.linalg.eigh(scaled) if names else (np.empty(0), np.empty((0, 0)))
    return [
        {"eigenvalue": float(value), "vector": dict(zip(names, vector.tolist(), strict=True))}
        for value, vector in zip(values, vectors.T, strict=True)
    ]


def offer_entry(found: Examination, offer: Offer) -> dict[str, Any]:
    """Return one offer: the manoeuvre as campaign.toml would say it, and the deviations before and after."""
    return {
        "manoeuvre": dict(offer.feasible.keys),
        "words": offer.feasible.name,
        "gain": offer.gain,
        "deviation": {
            name: {"before": finite(offer.before[i]), "after": finite(offer.after[i])}
            for i, name in enumerate(found.space.free_names)
        },
    }


def finite(value: float) -> float | None:
    """Return a float that JSON can hold, None for NaN and infinity."""
    return float(value) if np.isfinite(value) else None
