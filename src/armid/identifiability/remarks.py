"""What a reader must know of an examination, one sentence each."""

import numpy as np

from armid.display import SHOWN, shown
from armid.identifiability.collinearity import Group
from armid.identifiability.examine import Examination
from armid.identifiability.information import Level
from armid.identifiability.profile import Profile
from armid.identifiability.words import deviation_text, interval_text, offer_text

# The point that was given is away from the minimum when a step there is more standard deviations than this.
AWAY = 1.0
# The noise of a measured start is told of when it widens an interval by more than this factor.
WIDENS = 1.2
MOST_NAMED = 6


def remarks(found: Examination) -> list[str]:
    """Return what a reader must know, one sentence each."""
    said = [group_remark(found, group) for group in found.groups]
    said += [f"{p.name} is not seen at all in these records: any value in the box leaves them as they are."
             for p in found.profiles if not found.information.fisher.diagonal()[index(found, p)] > 0.0]  # fmt: skip
    said += [text for p in found.profiles if (text := profile_remark(found, p))]
    return said + point_remarks(found) + start_remarks(found) + level_remarks(found) + offer_remarks(found)


def index(found: Examination, profile: Profile) -> int:
    """Return the place of a profile's parameter among the free ones."""
    return found.space.free_names.index(profile.name)


def listed(names: tuple[str, ...]) -> str:
    """Return names as people list them."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def group_remark(found: Examination, group: Group) -> str:
    """Return the sentence for parameters that move together."""
    places = [found.space.free_names.index(n) for n in group.names]
    leader = places[int(np.argmax(np.abs(group.direction)))]
    followers = [
        f"{move_text(found, i, float(d))} of {found.space.free_names[i]}"
        for i, d in zip(places, group.direction, strict=True) if i != leader
    ]  # fmt: skip
    name = found.space.free_names[leader]
    return (f"{listed(group.names)} move together (collinearity index {group.index:.3g}): a change of one is made up "
            f"for by the others to within {100 / group.index:.2g} %; {move_text(found, leader, 1.0)} of {name} goes "
            f"next to unseen with {listed(tuple(followers))}.")  # fmt: skip


def move_text(found: Examination, i: int, share: float) -> str:
    """Return a change of a free parameter that belongs to a direction, its leader moved by 1 % of its range."""
    span = float((found.space.high - found.space.low)[found.space.free][i])
    change = 0.01 * share * span
    return ("+" if change >= 0.0 else "-") + deviation_text(found.space, i, abs(change), float(found.x[i]))


def profile_remark(found: Examination, profile: Profile) -> str:
    """Return the sentence for a profile that is not bounded, or that tells another interval than the curvature."""
    value, factor = profile.name, SHOWN.get(profile.unit, ("", 1.0))[1]
    null = found.model.parameters[profile.name].null
    low, high = profile.bounded
    if not (low or high):
        return f"{value} is bounded on neither side: the records leave open the whole box."
    if low and high and profile.agrees:
        return ""
    if null is not None and not low and profile.low == null == profile.box[0]:
        upper = shown(profile.high, profile.unit)
        return f"{value} may be null: it is below {upper[0]:.3g} {upper[1]} at 95 %, and 0 is as good."
    if low != high:
        side = "above" if low else "below"
        return f"{value} is not bounded {side}: the 95 % interval runs into the box."
    told, by = (interval_text(a * factor, b * factor) for a, b in ((profile.low, profile.high), profile.curvature))
    unit = "" if profile.unit == "1" else f" {shown(0.0, profile.unit)[1]}"
    return (f"{value}: the profile says {told}{unit}, the curvature {by}: the records are not symmetric about the "
            "minimum, or a bound holds what would make up for it; believe the profile.")  # fmt: skip


def point_remarks(found: Examination) -> list[str]:
    """Return what is to be said of a point that was given."""
    if not found.given:
        return []
    with np.errstate(invalid="ignore", divide="ignore"):
        away = np.abs(found.x - found.minimum) / found.information.deviation
    away = np.nan_to_num(away, nan=0.0, posinf=0.0)
    if away.max() <= AWAY:
        return []
    name = found.space.free_names[int(away.argmax())]
    return [f"The point that was given is not the least-squares minimum: {name} is {away.max():.3g} standard "
            "deviations from it; the profiles are drawn about the minimum, all else is at the point."]  # fmt: skip


def start_remarks(found: Examination) -> list[str]:
    """Return a sentence where the noise of measured starts widens the intervals."""
    told = np.array([p.deviation for p in found.profiles])
    with np.errstate(invalid="ignore", divide="ignore"):
        wider = np.nan_to_num(found.information.deviation / told, nan=1.0, posinf=1.0)
    if found.given or wider.max() < WIDENS:
        return []
    name = found.space.free_names[int(wider.argmax())]
    return [f"Records start from measured states, whose noise widens the deviation of {name} {wider.max():.3g} times; "
            "the profiles do not show it."]  # fmt: skip


def level_remarks(found: Examination) -> list[str]:
    """Return what the intervals rest on: noise, residual, or an assumption; records that say the same together."""
    texts: dict[str, list[str]] = {}
    for replay, level in zip(found.replays, found.information.levels, strict=True):
        texts.setdefault(level_text(level, found.campaign.unit, replay.record.noise.rms), []).append(replay.record.file)
    said = [f"{listed(tuple(files[:MOST_NAMED]))}: {text}" for text, files in texts.items()]
    return said[:MOST_NAMED] + ([f"So it is with {len(said) - MOST_NAMED} more."] if len(said) > MOST_NAMED else [])


def level_text(level: Level, unit: str, noise: float) -> str:
    """Return what one record is weighed by."""
    value, name = shown(level.rms, unit)
    if level.assumed:
        return (f"no noise is known, so white noise of {value:.3g} {name} rms is ASSUMED: intervals scale with it, "
                "groups do not depend on it.")  # fmt: skip
    if level.from_residual:
        times = level.rms / noise if noise else np.inf
        return (f"the residual of {value:.2g} {name} is {times:.2g} times the noise: the model lacks something, and "
                "the intervals, widened to the residual and its correlation in time, hold only as far as what is "
                "lacking averages out.")  # fmt: skip
    share = level.effective_fraction
    coloured = "" if share > 0.9 else f", coloured: one sample in {1 / share:.2g} is new"
    return f"noise {value:.2g} {name} rms{coloured}."


def offer_remarks(found: Examination) -> list[str]:
    """Return the best offer in one line."""
    if not found.offers:
        return ["No further manoeuvre was found that the machine could make."]
    return [f"One more record, {offer_text(found, found.offers[0])}."]
