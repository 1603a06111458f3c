"""What an identification found, for people: table, warnings in words."""

import numpy as np
from rich.table import Table

from armid.identifiability import MISFIT, collinear
from armid.identification.errors import Errors, record_errors
from armid.identification.identify import Identification

# S2 below the first with S1 above the second: landmarks that do not match, not signals that differ.
SHAPE_FALLS, NUMBERS_AGREE = 0.9, 0.95
# Units as people read them: SI unit -> (unit on screen, factor).
SHOWN = {"Pa": ("MPa", 1e-6), "rad/s": ("deg/s", 180.0 / np.pi), "m/s": ("mm/s", 1e3)}


def shown(value: float, unit: str) -> tuple[float, str]:
    """Return a value in the unit that people read."""
    name, factor = SHOWN.get(unit, (unit, 1.0))
    return value * factor, name


def parameter_table(found: Identification) -> Table:
    """Return the table of parameters: value, unit, 95 % interval, bounds, flag."""
    table = Table("parameter", "value", "unit", "95 % interval", "bounds", "", title="Parameters")
    half_widths = dict(zip(found.information.names, found.information.half_width, strict=True))
    for i, name in enumerate(found.space.names):
        value, unit = shown(float(found.candidate[i]), found.space.units[i])
        factor = SHOWN.get(found.space.units[i], ("", 1.0))[1]
        if name not in half_widths:
            table.add_row(name, f"{value:.6g}", unit, "", "", "fixed")
            continue
        half = float(half_widths[name]) * factor
        bounds = f"{found.space.low[i] * factor:.4g} to {found.space.high[i] * factor:.4g}"
        flag = "AT ITS BOUND" if found.at_bound[i] else ""
        table.add_row(name, f"{value:.6g}", unit, interval_text(value, half), bounds, flag)
    return table


def interval_text(value: float, half: float) -> str:
    """Return an interval with as many digits as its width deserves."""
    if not np.isfinite(half):
        return "not determined"
    return f"{value - half:.6g} to {value + half:.6g}"


def error_table(found: Identification) -> Table:
    """Return the table of errors on train and holdout."""
    unit = found.campaign.unit
    table = Table("records", "S", "S1", "S2", f"RMSE, {SHOWN[unit][0]}", "NRMSE", "chi2/sample", title="Errors")
    rows = (("train", found.train_replays, found.train), ("holdout", found.holdout_replays, found.holdout))
    for name, replays, e in rows:
        if e is None:
            table.add_row(f"{name}: none", *[""] * 6)
        else:
            table.add_row(f"{name} ({len(replays)})", *error_cells(e, unit))
    return table


def error_cells(e: Errors, unit: str) -> list[str]:
    """Return the cells of one row of errors."""
    chi2 = "no noise" if e.chi2_per_sample is None else f"{e.chi2_per_sample:.4g}"
    return [f"{e.s:.4f}", f"{e.s1:.4f}", f"{e.s2:.4f}", f"{shown(e.rmse, unit)[0]:.4g}", f"{e.nrmse:.3%}", chi2]


def remarks(found: Identification) -> list[str]:
    """Return what a reader must know, one sentence each."""
    said = [bound_remark(name) for name, at in zip(found.space.names, found.at_bound, strict=True) if at]
    for a, b, r in collinear(found.information):
        said.append(f"{a} and {b} can hardly be told apart on these records (correlation {r:+.3f}): "
                    "a change of one is made up for by the other.")  # fmt: skip
    lost = [n for n, d in zip(found.information.names, found.information.deviation, strict=True) if not np.isfinite(d)]
    said += [f"{name} is not determined by these records." for name in lost]
    if found.n_failed:
        said.append(f"{found.n_failed} of {found.used} candidates diverged and were given a penalty.")
    return said + shape_remarks(found) + engine_remarks(found) + noise_remarks(found)


def shape_remarks(found: Identification) -> list[str]:
    """Return a sentence for each record on which S2 falls though the residual is no more than noise.

    S2 pairs few intervals between landmarks; one landmark that is only noise, near an end, can unpair them all.
    """
    said = []
    for replay in (*found.train_replays, *found.holdout_replays):
        e = record_errors(replay, found.candidate)
        only_noise = e.chi2_per_sample is not None and e.chi2_per_sample < MISFIT
        if e.s2 < SHAPE_FALLS and e.s1 > NUMBERS_AGREE and only_noise:
            said.append(f"{replay.record.file}: S2 is {e.s2:.3f} though S1 is {e.s1:.3f}: the shape similarity pairs "
                        "a few intervals by order, and a landmark of noise unpairs them; look at S1 and RMSE.")
    return said


def engine_remarks(found: Identification) -> list[str]:
    """Return a sentence for each record on which the engine is less accurate than it promises."""
    name, factor = SHOWN[found.campaign.unit]
    return [
        f"{r.record.file}: the engine is off by up to {factor * r.engine_error:.2g} {name} even at its "
        "finest steps: the equations are stiff there, or switch somewhere without a guard."
        for r in (*found.train_replays, *found.holdout_replays) if not all(c.reached for c in r.calibrations)
    ]  # fmt: skip


def bound_remark(name: str) -> str:
    """Return the sentence for a parameter at its bound."""
    return f"{name} sits on its bound: the records would take it further; neither it nor its interval can be trusted."


def noise_remarks(found: Identification) -> list[str]:
    """Return what is to be said of the noise, its mean at rest, and a residual far above it."""
    said = []
    unit = found.campaign.unit
    for replay in found.train_replays:
        noise = replay.record.noise
        value, name = shown(noise.rms, unit)
        text = f"{replay.record.file}: noise {value:.3g} {name} rms"
        if noise.source == "rest":
            mean = shown(noise.mean or 0.0, unit)[0]
            text += f" and mean {mean:+.3g} {name} (shown, not subtracted) from {noise.n_samples} samples at rest"
        else:
            text += " from high-frequency differences of the motion, as fewer than 50 samples were recorded at rest"
        said.append(text + ".")
    for replay, level in zip(found.train_replays, found.information.levels, strict=True):
        if level.from_residual:
            times = level.rms / replay.record.noise.rms if replay.record.noise.rms else np.inf
            said.append(f"{replay.record.file}: the residual is {times:.3g} times the noise, so the model lacks "
                        "something; the intervals are widened to the residual and its correlation in time, and hold "
                        "only as far as what is lacking averages out.")  # fmt: skip
    return said
