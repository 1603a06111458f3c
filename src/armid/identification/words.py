"""What an identification found, for people: table, warnings in words."""

import numpy as np
from rich.table import Table

from armid.display import SHOWN, shown
from armid.identification.errors import Errors
from armid.identification.identify import Identification

__all__ = ["SHOWN", "error_cells", "error_table", "interval_text", "parameter_table", "shown"]


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
