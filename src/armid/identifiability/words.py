"""What an examination found, for people: tables."""

import numpy as np
from rich.table import Table

from armid.display import SHOWN, shown
from armid.identifiability.examine import Examination
from armid.identifiability.profile import Profile
from armid.identifiability.purchase import Offer
from armid.problem.space import Space

MOST_OFFERS, MOST_COLUMNS = 8, 5


def parameter_table(found: Examination) -> Table:
    """Return the table of parameters: value, deviation, intervals by curvature and by profile, where it is bounded."""
    table = Table("parameter", "value", "unit", "deviation", "95 % by curvature", "95 % by profile", "bounded", "",
                  title="What the records say")  # fmt: skip
    for i, profile in enumerate(found.profiles):
        value, unit = shown(float(found.x[i]), profile.unit)
        factor = SHOWN.get(profile.unit, ("", 1.0))[1]
        half = float(found.information.half_width[i]) * factor
        told = interval_text(value - half, value + half) if np.isfinite(half) else "not determined"
        deviation = deviation_text(found.space, i, float(found.information.deviation[i]), float(found.x[i]))
        flag = "AT ITS BOUND" if found.at_bound[i] else "" if profile.agrees else "THEY DIFFER"
        table.add_row(profile.name, f"{value:.6g}", unit, deviation, told, profile_text(profile, factor),
                      bounded_text(profile), flag)  # fmt: skip
    return table


def interval_text(low: float, high: float) -> str:
    """Return an interval with as many digits as its width deserves."""
    width = abs(high - low)
    digits = 6 if width == 0.0 else int(np.clip(2 - np.floor(np.log10(width)), 0, 9))
    return f"{low:.{digits}f} to {high:.{digits}f}"


def profile_text(profile: Profile, factor: float) -> str:
    """Return the interval of a profile; where it is not bounded inside the box its end is the box."""
    text = interval_text(profile.low * factor, profile.high * factor)
    low, high = text.split(" to ")
    return f"{low if profile.bounded[0] else f'box {low}'} to {high if profile.bounded[1] else f'box {high}'}"


def bounded_text(profile: Profile) -> str:
    """Return on which sides a profile is bounded inside the box."""
    return {(True, True): "yes", (True, False): "below only", (False, True): "above only"}.get(profile.bounded, "NO")


def deviation_text(space: Space, i: int, deviation: float, value: float) -> str:
    """Return a standard deviation of a free parameter: in percent of a value that is no addition, else in its unit."""
    unit = space.units[int(np.flatnonzero(space.free)[i])]
    span = float((space.high - space.low)[space.free][i])
    if not np.isfinite(deviation):
        return "not determined"
    if "." not in space.free_names[i] and abs(value) > 1e-3 * span:
        return f"{100 * deviation / abs(value):.2g} %"
    told, name = shown(deviation, unit)
    return f"{told:.2g} {name}".removesuffix(" 1")


def offer_table(found: Examination, most: int = MOST_OFFERS) -> Table:
    """Return the table of the best offers: manoeuvre, deviation of each parameter after one such record."""
    columns = told_columns(found)
    some = "" if len(columns) == len(found.x) else f", {len(columns)} of {len(found.x)} parameters"
    table = Table("one more record of", *(found.space.free_names[i] for i in columns), "gain",
                  title=f"What one more manoeuvre would buy (deviations{some})")  # fmt: skip
    table.add_row("none", *(cell(found, i, float(found.information.deviation[i])) for i in columns), "1")
    best = found.offers[:most]
    repeats = [o for o in found.offers[most:] if o.feasible.repeats][:1]
    for offer in (*best, *repeats):
        cells = [cell(found, i, float(offer.after[i])) for i in columns]
        table.add_row(offer.feasible.name, *cells, f"{offer.gain:.3g}")
    return table


def told_columns(found: Examination) -> list[int]:
    """Return the places of the parameters that the best offer helps most, in order, as many as a table can hold."""
    n = len(found.x)
    if n <= MOST_COLUMNS or not found.offers:
        return list(range(min(n, MOST_COLUMNS)))
    with np.errstate(invalid="ignore"):
        helped = np.nan_to_num(found.offers[0].before / found.offers[0].after, nan=1.0, posinf=np.inf)
    return sorted(int(i) for i in np.argsort(-helped, kind="stable")[:MOST_COLUMNS])


def cell(found: Examination, i: int, deviation: float) -> str:
    """Return one deviation of the offers."""
    return deviation_text(found.space, i, deviation, float(found.x[i]))


def offer_text(found: Examination, offer: Offer) -> str:
    """Return an offer in one line: "raise, empty, 24 V from 20 to -40 deg: n from 0.84 % to 0.11 %"."""
    i = offer.best
    before, after = cell(found, i, float(offer.before[i])), cell(found, i, float(offer.after[i]))
    return f"{offer.feasible.name}: {found.space.free_names[i]} from {before} to {after}"
