"""The document of an examination, and what is stored of it: identifiability.json."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from armid.estimation.design import Offer, identity
from armid.estimation.examine import Examination, Group, collinearity_index
from armid.estimation.identify import versions_of
from armid.estimation.identify_document import PAIRS, WIDENED, beyond_noise, pairs_of
from armid.estimation.information import PROFILE_RISE, Profile, normalised, sensitivities
from armid.estimation.noise_model import Level, level_weights
from armid.model import Array
from armid.report.document import (
    Column,
    Document,
    Section,
    Table,
    correlation_tables,
    listed,
    made_section,
    plain,
    stored_figures,
    table,
    titled,
)
from armid.report.result import Parts
from armid.report.style import GREY, OKABE_ITO, entitle, legend_below, look, panels
from armid.units import behind, labelled, scale_of, shown

PACKAGES_OF_IDENTIFIABILITY = ("armid", "numpy", "scipy", "numba")
UNDETERMINED = "not determined"
MOST_OFFERS, MOST_COLUMNS, MOST_GROUPS_SHOWN = 8, 5, 6
# The point that was given is away from the minimum when a step there is more standard deviations than this.
DEVIATIONS_AWAY = 1.0
# The noise of a measured start is reported when it widens an interval by more than this factor.
WIDENS = 1.2
FIGURES = {
    "profiles": ("Profile likelihood", "Rise of chi2 when one parameter is held and the others are fitted again. A "
                 "95 % interval ends where the curve meets the dotted threshold; where it leaves the parabola, the "
                 "interval by curvature is not to be believed."),
    "pairs": PAIRS,
    "sensitivities": ("What the records see", "d speed / d parameter against time, each scaled to its largest value: "
                      "curves that look alike are collinear; and the share of the information on each parameter that "
                      "comes from each record."),
}  # fmt: skip


def identifiability_document(
    result: Mapping[str, Any], details: Mapping[str, Any], svgs: Mapping[str, str], again: str
) -> Document:
    """Build the document of an examination from identifiability.json.

    details: `made_by`, where it is known; for the others see `identify_document`.
    """
    drawn = partial(stored_figures, FIGURES, svgs)
    answer, remarks = answer_and_remarks(result)
    parameters, offers = parameter_table(result), offer_table(result)
    noise = [text for text in result.get("for_the_record", ()) if text in remarks]
    correlated = correlation_tables(result["correlation"])
    first = [text for text in remarks if text not in noise]
    rest = titled({"What must be known": first, "For the record": noise})
    sections = (
        Section("Parameters", (parameters, *drawn("profiles"))),
        *(Section(part.title, (part,)) for part in rest),
        Section("What the records see", (*correlated, *drawn("pairs", "sensitivities"))),
        Section("The next record", (offers,)),
        made_section(details.get("made_by", {}), result["versions"], again),
    )
    model = " + ".join([result["plant"], *result["effects"]])
    return Document(
        result["campaign"], "Identifiability", f"How well do these records pin down the parameters of {model}?",
        answer, tuple(s for s in sections if s.parts), main=(parameters, offers, *rest),
    )  # fmt: skip


def answer_and_remarks(result: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what is more than noise, what is bounded, what moves together, the best offer; and the other remarks."""
    bounded, by_others, unbounded = list[str](), list[str](), list[str]()
    for name, p in result["parameters"].items():
        deviation = deviation_text(name, p, p["deviation"])
        if not (p["profile"]["bounded_low"] and p["profile"]["bounded_high"]):
            unbounded.append(name)
        elif deviation == UNDETERMINED:
            by_others.append(name)
        else:
            wider = p.get("deviation_with_tolerances", p["deviation"])
            counted = f", {deviation_text(name, p, wider)} with the tolerances" if wider > p["deviation"] else ""
            bounded.append(f"{name} ({deviation}{counted})")
    misfit = (result["misfit"],) if result.get("misfit") else ()
    texts = [f"Bounded on both sides, with the standard deviation: {', '.join(bounded)}."] if bounded else []
    texts += [f"Bounded by the limits of other parameters alone: {', '.join(by_others)}."] if by_others else []
    texts += [f"Not bounded on both sides: {', '.join(unbounded)}."] if unbounded else []
    n = len(result["groups"])
    *others, best = result["remarks"][n:]
    return (*misfit, " ".join(texts) or "No parameter is free.", *result["remarks"][:n], best), tuple(others)


def parameter_table(result: Mapping[str, Any]) -> Table:
    rows = []
    for name, p in result["parameters"].items():
        unit, factor = scale_of(p["unit"], p["value"])
        curved = UNDETERMINED if p["low"] is None else interval_text(factor * p["low"], factor * p["high"])
        profile = p["profile"]
        bounded = {(True, True): "", (True, False): "not above", (False, True): "not below"}.get(
            (profile["bounded_low"], profile["bounded_high"]), "NOT BOUNDED")  # fmt: skip
        flag = "AT ITS BOUND" if p["bound_active"] else "" if profile["agrees_with_curvature"] else "CURVATURE DIFFERS"
        rows.append((name, factor * p["value"], unit, profile_text(profile, factor),
                     ", ".join(word for word in (flag, bounded) if word),
                     deviation_text(name, p, p["deviation"]), curved))  # fmt: skip
    columns = ["parameter", Column("value", "value", ".6g"), "unit", "95 % by profile", "remark", "deviation",
               "95 % by curvature"]  # fmt: skip
    note = "Remark: not above, not below: no bound on that side." if any(row[4] for row in rows) else ""
    return table("What the records say", columns, rows, note)


def interval_text(low: float, high: float) -> str:
    width = abs(high - low)
    digits = 6 if width == 0.0 else int(np.clip(2 - np.floor(np.log10(width)), 0, 9))
    return f"{low:.{digits}f} to {high:.{digits}f}"


def profile_text(profile: Mapping[str, Any], factor: float) -> str:
    low, high = interval_text(profile["low"] * factor, profile["high"] * factor).split(" to ")
    return f"{low if profile['bounded_low'] else f'box {low}'} to {high if profile['bounded_high'] else f'box {high}'}"


def deviation_text(name: str, p: Mapping[str, Any], deviation: float | None) -> str:
    """Return a standard deviation in percent of a value, of an addition in its unit; p: stored parameter."""
    if deviation is None or not np.isfinite(deviation):
        return UNDETERMINED
    if "." not in name and abs(p["value"]) > 1e-3 * (p["bound_high"] - p["bound_low"]):
        return f"{100 * deviation / abs(p['value']):.2g} %"
    return "{:.2g} {}".format(*shown(deviation, p["unit"])).removesuffix(" 1")


def offer_table(result: Mapping[str, Any]) -> Table:
    """Return the best offers: manoeuvre, deviation of each parameter after one such record; the best repeat is last."""
    every, offers = list(result["parameters"]), result["offers"]
    names = every if len(every) <= MOST_COLUMNS else most_helped(every, offers)
    some = "" if names == every else f", {len(names)} of {len(every)} parameters"
    repeats = [offer for offer in offers[MOST_OFFERS:] if " once more" in offer["words"]][:1]
    entries = {name: result["parameters"][name] for name in names}
    before = {name: offers[0]["deviation"][name]["before"] if offers else p["deviation"] for name, p in entries.items()}
    rows = [("none", *(deviation_text(name, p, before[name]) for name, p in entries.items()), 1.0)]
    for offer in (*offers[:MOST_OFFERS], *repeats):
        cells = [deviation_text(name, p, offer["deviation"][name]["after"]) for name, p in entries.items()]
        rows.append((offer["words"], *cells, offer["gain"]))
    columns = ["one more record of", *names, Column("gain", "gain", ".3g")]
    return table(f"What one more manoeuvre would buy (deviations{some})", columns, rows)


def most_helped(names: list[str], offers: list[Mapping[str, Any]]) -> list[str]:
    """Return the parameters that the best offer helps most, in order, as many as a table can hold."""
    if not offers:
        return names[:MOST_COLUMNS]
    ends = [[offers[0]["deviation"][name][end] for name in names] for end in ("before", "after")]
    before, after = (np.array([np.inf if d is None else d for d in end]) for end in ends)
    with np.errstate(invalid="ignore", divide="ignore"):
        helped = np.nan_to_num(before / after, nan=1.0, posinf=np.inf)
    return [names[i] for i in sorted(np.argsort(-helped, kind="stable")[:MOST_COLUMNS])]


def parts_of(examination: Examination) -> Parts:
    return Parts(result_of(examination), {}, figures_of(examination))


def result_of(examination: Examination) -> dict[str, Any]:
    """Return everything of an examination that JSON can hold, SI throughout; what is not known is null."""
    space, information = examination.space, examination.information
    names, correlation, fisher = space.free_names, information.correlation, information.fisher
    levels = {r.name: level for r, level in zip(examination.replays, information.levels, strict=True)}
    return plain({
        "campaign": examination.campaign.name,
        "plant": examination.model.plant.name,
        "effects": [e.name for e in examination.model.effects],
        "unit": examination.campaign.unit,
        "at": "given" if examination.given else "estimate",
        "parameters": entries_of(examination),
        "fixed": {n: float(v) for n, v in zip(space.names, space.fixed, strict=True) if not np.isnan(v)},
        "correlation": {name: dict(zip(names, row, strict=True)) for name, row in zip(names, correlation, strict=True)},
        "collinearity_index": collinearity_index(fisher),
        "groups": [plain(g) | {"direction": dict(zip(g.names, g.direction, strict=True))} for g in examination.groups],
        "directions": directions(fisher, names),
        "records": {file: {"level": level.rms, **plain(level)} for file, level in levels.items()},
        "ranked_by": examination.ranked_by,
        "offers": [
            {"manoeuvre": dict(o.feasible.keys), "words": o.feasible.name, "gain": o.gain, "deviation": {
                name: {"before": o.before[i], "after": o.after[i]} for i, name in enumerate(names)
            }} for o in examination.offers
        ],
        "remarks": remarks(examination),
        "for_the_record": level_remarks(examination),
        "misfit": misfit_remark(examination),
        "versions": versions_of(PACKAGES_OF_IDENTIFIABILITY),
    })  # fmt: skip


def entries_of(examination: Examination) -> dict[str, dict[str, Any]]:
    information, x = examination.information, examination.x
    ends = [examination.space.of_one_sign(p.name, value - half, value + half)
            for p, value, half in zip(examination.profiles, x, information.half_width, strict=True)]  # fmt: skip
    columns = zip(examination.profiles, x, information.deviation, examination.wider, ends, examination.at_bound,
                  strict=True)  # fmt: skip
    return {p.name: {
        "value": value, "unit": p.unit, "deviation": deviation, "deviation_with_tolerances": wider,
        "low": low, "high": high, "bound_low": p.box[0], "bound_high": p.box[1],
        "bound_active": held,
        "profile": {
            "minimum": p.estimate, "low": p.low, "high": p.high, "bounded_low": p.bounded[0],
            "bounded_high": p.bounded[1], "agrees_with_curvature": p.agrees, "values": p.values, "rise": p.rise,
        },
    } for p, value, deviation, wider, (low, high), held in columns}  # fmt: skip


def directions(fisher: Array, names: Sequence[str]) -> list[dict[str, Any]]:
    scaled, seen = normalised(fisher)
    kept = [n for n, s in zip(names, seen, strict=True) if s]
    values, vectors = np.linalg.eigh(scaled)
    return [{"eigenvalue": value, "vector": dict(zip(kept, vector, strict=True))}
            for value, vector in zip(values, vectors.T, strict=True)]  # fmt: skip


def remarks(examination: Examination) -> list[str]:
    """Return what a reader must know, one sentence each: groups first, the best offer last."""
    names, fisher, entries = examination.space.free_names, examination.information.fisher, entries_of(examination)
    said = [group_remark(examination, group) for group in examination.groups]
    said += [f"{p.name} is not seen at all in these records: any value in the box leaves them as they are."
             for p in examination.profiles if not fisher[names.index(p.name), names.index(p.name)] > 0.0]  # fmt: skip
    said += [text for p in examination.profiles if (text := profile_remark(examination, p))]
    said += [f"With the constants within their tolerances, {text}." for text in examination.combinations]
    if (examination.wider > examination.information.deviation).any():
        deviations = (f"{n} {deviation_text(n, entries[n], wide)}"
                      for n, wide in zip(names, examination.wider, strict=True))  # fmt: skip
        said.append(f"The tolerances of the constants counted, the deviations are: {', '.join(deviations)}.")
    said += point_remarks(examination) + level_remarks(examination)
    if examination.offers:
        return [*said, offer_text(examination, examination.offers[0])]
    return [*said, "No further manoeuvre was found that the machine could make."]


def group_remark(examination: Examination, group: Group) -> str:
    span = (examination.space.high - examination.space.low)[examination.space.free]
    leader = int(np.argmax(np.abs(group.direction)))
    moves, entries = [], entries_of(examination)
    for name, share in zip(group.names, group.direction, strict=True):
        change = 0.01 * float(share) * float(span[examination.space.free_names.index(name)])
        moves.append(f"{'+' if change >= 0.0 else '-'}{deviation_text(name, entries[name], abs(change))} of {name}")
    followers = listed(moves[:leader] + moves[leader + 1 :])
    return (f"{listed(group.names)} move together (collinearity index {group.index:.3g}): a change of one is made up "
            f"for by the others to within {100 / group.index:.2g} %; {moves[leader]} together with {followers} is "
            "hardly seen.")  # fmt: skip


def profile_remark(examination: Examination, profile: Profile) -> str:
    """Return the sentence for a profile that is not bounded, or that tells another interval than the curvature."""
    value, factor = profile.name, scale_of(profile.unit)[1]
    null = examination.model.parameters[profile.name].null
    low, high = profile.bounded
    if not (low or high):
        return f"{value} is bounded on neither side: the records leave open the whole box."
    if low and high and profile.agrees:
        return ""
    if null is not None and not low and profile.low == null == profile.box[0]:
        upper = shown(profile.high, profile.unit)
        return f"{value} may be null: it is below {upper[0]:.3g}{behind(upper[1])} at 95 %, and 0 is as good."
    if low != high:
        side = "above" if low else "below"
        return f"{value} is not bounded {side}: the 95 % interval runs into the box."
    interval, by = (interval_text(a * factor, b * factor) for a, b in ((profile.low, profile.high), profile.curvature))
    unit = behind(shown(0.0, profile.unit)[1])
    return (f"{value}: the profile says {interval}{unit}, the curvature {by}: the records are not symmetric about the "
            "minimum, or a bound holds what would make up for it; believe the profile.")  # fmt: skip


def point_remarks(examination: Examination) -> list[str]:
    names, deviation = examination.space.free_names, examination.information.deviation
    with np.errstate(invalid="ignore", divide="ignore"):
        away = np.nan_to_num(np.abs(examination.x - examination.minimum) / deviation, nan=0.0, posinf=0.0)
        wider = deviation / np.array([p.deviation for p in examination.profiles])
    wider = np.nan_to_num(wider, nan=1.0, posinf=1.0)
    if examination.given and away.max() > DEVIATIONS_AWAY:
        return [f"The point that was given is not the least-squares minimum: {names[int(away.argmax())]} is "
                f"{away.max():.3g} standard deviations from it. The profiles are drawn around the minimum. All other "
                "results belong to the point."]  # fmt: skip
    if not examination.given and wider.max() >= WIDENS:
        return [f"Noise of measured starts or inputs widens the deviation of {names[int(wider.argmax())]} "
                f"{wider.max():.3g} times; the profiles do not show it."]  # fmt: skip
    return []


def level_remarks(examination: Examination) -> list[str]:
    texts: dict[str, list[str]] = {}
    for replay, level in zip(examination.replays, examination.information.levels, strict=True):
        texts.setdefault(level_text(level, replay.record.unit, replay.record.noise.rms), []).append(replay.name)
    said = [f"{listed(files[:MOST_GROUPS_SHOWN])}: {text}" for text, files in texts.items()]
    left = len(said) - MOST_GROUPS_SHOWN
    return said[:MOST_GROUPS_SHOWN] + ([f"So it is with {left} more."] if left > 0 else [])


def misfit_remark(examination: Examination) -> str:
    """Return which records hold more than noise, and what that does to the intervals, "" for none."""
    times = beyond_noise(examination.replays, examination.information)
    if not times:
        return ""
    low, high = (f"{end(times.values()):.2g}" for end in (min, max))
    span = low if low == high else f"{low} to {high}"
    return (f"The model lacks something or a constant is off: the residual is {span} times the noise in "
            f"{listed(list(times), MOST_GROUPS_SHOWN)}. {WIDENED}")  # fmt: skip


def level_text(level: Level, unit: str, noise: float) -> str:
    value, name = shown(level.rms, unit)
    if level.assumed:
        return (f"no noise is known, so white noise of {value:.3g} {name} rms is ASSUMED: intervals scale with it, "
                "groups do not depend on it.")  # fmt: skip
    if level.from_residual:
        times = level.rms / noise if noise else np.inf
        return f"the residual of {value:.2g} {name} is {times:.2g} times the noise."
    share = level.effective_fraction
    coloured = "" if share > 0.9 else f", coloured: one sample in {1 / share:.2g} is new"
    return f"noise {value:.2g} {name} rms{coloured}."


def offer_text(examination: Examination, offer: Offer) -> str:
    name, p = list(entries_of(examination).items())[offer.best]
    before, after = (deviation_text(name, p, float(d[offer.best])) for d in (offer.before, offer.after))
    if after == UNDETERMINED:
        return (f"No further record that this machine can make determines {name}: fix it, or one of those that move "
                "with it.")  # fmt: skip
    widened = examination.information.deviation[offer.best] > WIDENS * offer.before[offer.best]
    alone = " (by noise of the sensors alone)" if widened else ""
    return f"One more record, {offer.feasible.name}: {name} from {before} to {after}{alone}."


CURVE, QUADRATIC, LIMIT = OKABE_ITO["blue"], OKABE_ITO["vermilion"], OKABE_ITO["black"]
# The top of a profile's panel, and by how much its sides go beyond what was tried, as a share.
TOP, SIDE = 6.5, 0.04
MOST_RECORDS_SHOWN, MOST_PANELS = 4, 12


def figures_of(examination: Examination) -> dict[str, Callable[[], Any]]:
    campaign = examination.campaign
    own = {"profiles": lambda: profile_figure(examination), "sensitivities": lambda: sensitivity_figure(examination)}
    return own | pairs_of(campaign.name, examination.space, examination.information, examination.x, campaign.truth)


def profile_figure(examination: Examination) -> Any:
    shown = examination.profiles[:MOST_PANELS]
    figure, axes = panels(len(shown), 2 if len(shown) <= 4 else 3, 4.6, 3.6)
    for axis, profile in zip(axes, shown, strict=True):
        draw_profile(axis, profile)
    handles = {handle.get_label(): handle for axis in axes for handle in axis.get_legend_handles_labels()[0]}
    legend_below(figure, 3, list(handles.values()))
    entitle(figure, f"{title(examination)}: profile likelihood", "large")
    return figure


def draw_profile(axis: Any, profile: Profile) -> None:
    unit, factor = scale_of(profile.unit)
    left, right = view(profile)
    grid = np.linspace(left, right, 200)
    if np.isfinite(profile.deviation):
        parabola = ((grid - profile.estimate) / profile.deviation) ** 2
        axis.plot(grid * factor, parabola, color=QUADRATIC, ls="--", lw=1.5, zorder=3, label="by curvature")
    axis.plot(*smooth(profile, factor), color=CURVE, lw=2.0, label="profile")
    axis.plot(profile.values * factor, profile.rise, color=CURVE, marker="o", ms=4.0, ls="none", label="fitted again")
    axis.axhline(PROFILE_RISE, color=LIMIT, lw=1.0, ls=":", label="95 % threshold")
    axis.axvspan(profile.low * factor, profile.high * factor, color=CURVE, alpha=0.10, lw=0, label="95 % interval")
    for bound in profile.box:
        if left <= bound <= right:
            axis.axvline(bound * factor, color=GREY, lw=3.0, label="bound of the box")
    axis.plot(profile.estimate * factor, 0.0, color=LIMIT, marker="D", ms=6, ls="none", clip_on=False, zorder=5,
              label="estimate")  # fmt: skip
    axis.set(xlim=(left * factor, right * factor), ylim=(0.0, TOP))
    axis.set(xlabel=labelled(profile.name, unit), ylabel="rise of chi2")
    axis.ticklabel_format(axis="x", useOffset=False, style="plain")
    axis.locator_params(axis="x", nbins=4)


def smooth(profile: Profile, factor: float) -> tuple[Array, Array]:
    """Return a smooth curve through a profile: its signed root, which is next to straight, between the points."""
    from scipy.interpolate import PchipInterpolator

    side = np.sign(profile.values - profile.estimate)
    values, first = np.unique(profile.values, return_index=True)
    root = (side * np.sqrt(np.maximum(profile.rise, 0.0)))[first]
    if len(values) < 3:
        return values * factor, root**2
    grid = np.linspace(values[0], values[-1], 400)
    return grid * factor, PchipInterpolator(values, root)(grid) ** 2


def view(profile: Profile) -> tuple[float, float]:
    inside = profile.values[profile.rise <= 1.2 * TOP]
    left, right = min(float(inside.min()), profile.low), max(float(inside.max()), profile.high)
    room = SIDE * (right - left) or 1e-3 * (profile.box[1] - profile.box[0])
    return left - room, right + room


def sensitivity_figure(examination: Examination) -> Any:
    """Draw the sensitivities of the most informative records, and of several the information that each holds."""
    space, replays, weights = examination.space, examination.replays, level_weights(examination.information.levels)
    # d signal / d parameter of each record in units of its level, (n_samples, n_free) each
    jacobians = [w * sensitivities(r, space, examination.x) for w, r in zip(weights, replays, strict=True)]
    order, several = telling(examination, jacobians), len(jacobians) > 1
    figure, axes = panels(len(order) + several, 2, 5.6 if several else 7.2, 3.6)
    for axis, i in zip(axes, order, strict=False):
        draw_sensitivities(axis, examination, i, jacobians[i])
    if several:
        draw_shares(axes[-1], examination, jacobians)
    legend_below(figure, min(len(space.free_names), 6 if several else 4))
    entitle(figure, f"{title(examination)}: what the records see", "large")
    return figure


def telling(examination: Examination, jacobians: list[Array]) -> list[int]:
    """Return the records that tell most, the most telling first, repeats of one manoeuvre once."""
    order = np.argsort([-np.sum(j**2) for j in jacobians], kind="stable")
    seen: dict[object, int] = {}
    for i in order:
        seen.setdefault((examination.replays[i].place, identity(examination.replays[i].record.manoeuvre)), int(i))
    return list(seen.values())[:MOST_RECORDS_SHOWN]


def draw_shares(axis: Any, examination: Examination, jacobians: list[Array]) -> None:
    """Draw how much of the information on each parameter comes from each record, as a map with numbers."""
    import seaborn as sns

    names, files = examination.space.free_names, [r.name.replace(".csv", "") for r in examination.replays]
    squares = np.array([np.sum(j**2, axis=0) for j in jacobians])
    shares = 100 * squares / np.where(squares.sum(axis=0) > 0.0, squares.sum(axis=0), 1.0)
    sns.heatmap(shares, xticklabels=names, yticklabels=files, cbar_kws={"label": "share of the information [%]"},
                ax=axis, vmin=0, vmax=100, cmap="Blues", fmt=".0f", annot=len(files) <= 14,
                annot_kws={"size": 11 if len(files) <= 8 else 8})  # fmt: skip
    # turned so that the longest name stays off its neighbours
    axis.tick_params(axis="both", labelrotation=0, length=0)
    if max(len(n) for n in names) > 8 or len(names) > 8:
        axis.set_xticklabels(names, rotation=30, ha="right", rotation_mode="anchor")


def draw_sensitivities(axis: Any, examination: Examination, i: int, jacobian: Array) -> None:
    """Draw the sensitivities of one record, each scaled to its own largest: curves that look alike are collinear."""
    replay = examination.replays[i]
    for j, name in enumerate(examination.space.free_names):
        largest = float(np.abs(jacobian[:, j]).max())
        curve = jacobian[:, j] / largest if largest > 0.0 else jacobian[:, j]
        axis.plot(replay.times, curve, lw=1.7, label=name, **look(j))
    axis.axhline(0.0, color=GREY, lw=0.8, zorder=0)
    axis.set_title(f"{replay.name}: sensitivities, each scaled to 1", fontsize="medium")
    axis.set(xlabel="time [s]", ylabel="scaled", ylim=(-1.08, 1.08))
    axis.margins(x=0.01)


def title(examination: Examination) -> str:
    model = examination.model
    return f"{examination.campaign.name}: {' + '.join([model.plant.name, *(e.name for e in model.effects)])}"
