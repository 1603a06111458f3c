"""The missing signal: how much of the residual it removes at each port, and what it looks like against the motion."""

from pathlib import Path
from typing import Any

import numpy as np

from armid.discrepancy.dependence import Dependence, hats
from armid.discrepancy.figures.drawing import AFTER, save, tidy
from armid.discrepancy.missing import Missing
from armid.discrepancy.result import ClosedLoop
from armid.display import OKABE_ITO, shown, style

MOST_VARIABLES = 5


def missing_figure(found: ClosedLoop, path: Path) -> None:
    """Draw the shares at the ports, and the signal at the best of them against each variable of the motion."""
    plt, missing = style(), found.missing
    assert missing is not None
    best = found.term.dependence if found.term is not None else missing.dependences[0]
    variables = [best.variable, *(v for v in missing.moved[0].variables if v != best.variable)][:MOST_VARIABLES]
    columns = (len(variables) + 2) // 2
    figure, axes = plt.subplots(2, columns, figsize=(4.0 * columns, 6.4), squeeze=False, layout="constrained")
    share_panel(axes.flat[0], missing)
    for axis, variable in zip(axes.flat[1:], variables, strict=False):
        signal_panel(axis, missing, best, variable)
    for axis in axes.flat[1 + len(variables) :]:
        axis.set_axis_off()
    figure.suptitle(f"{found.campaign.name}: the missing signal, recovered without a form at port {best.port}\n"
                    "(less what the free parameters can take up)", fontsize="medium")  # fmt: skip
    save(plt, figure, path)


def share_panel(axis: Any, missing: Missing) -> None:
    """Draw what a free signal removes at each port, and what the best curve there predicts on left-out parts."""
    ports = [s.port for s in missing.signals]
    curves = [max((d.share for d in missing.dependences if d.port == p), default=0.0) for p in ports]
    rows = np.arange(len(ports))
    axis.barh(rows - 0.19, [max(100.0 * s.share, 0.0) for s in missing.signals], 0.36, color=OKABE_ITO["sky"],
              label="free signal: removes")  # fmt: skip
    axis.barh(rows + 0.19, [max(100.0 * c, 0.0) for c in curves], 0.36, color=AFTER, label="best curve: predicts")
    axis.set_yticks(rows, ports)
    axis.invert_yaxis()
    axis.set_xlim(0, 100)
    axis.set_xlabel("share of the squared residual [%]")
    axis.legend(fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    tidy(axis)


def signal_panel(axis: Any, missing: Missing, best: Dependence, variable: str) -> None:
    """Draw the signal of every record against one variable, with the curve where it is the one that was fitted."""
    model, signal = missing.lacking.records.replays[0].model, missing.signal_at(best.port)
    colours = list(OKABE_ITO.values())
    if signal is not None:
        for motion, values in zip(missing.moved, signal.signals, strict=True):
            place = shown_values(motion.variables[variable], unit_of(variable, model))
            axis.plot(place, values, ".", ms=3, color=colours[motion.stretch.group % len(colours)])
    if signal is not None and variable == best.variable and best.factor == "1":
        knots = np.linspace(best.first, best.last, len(best.heights))
        seen = np.concatenate([m.variables[variable] for m in missing.moved])
        heights = np.linalg.lstsq(hats(seen, best.first, best.last), np.concatenate(signal.signals), rcond=None)[0]
        axis.plot(shown_values(knots, unit_of(variable, model)), heights, "-", color="black", label="curve through it")
        axis.legend(fontsize="small")
    name = shown(0.0, unit_of(variable, model))[1]
    axis.set_xlabel(f"{variable} [{name}]")
    axis.set_ylabel(f"missing at {best.port} [{model.plant.ports[best.port]}]")
    tidy(axis)


def unit_of(variable: str, model: Any) -> str:
    """Return the unit of a variable of the motion."""
    units = {s.name: s.unit for s in model.plant.states} | {i.name: i.unit for i in model.plant.inputs}
    return str(units.get(variable, "s" if variable == "time" else model.plant.scales.effort_unit))


def shown_values(values: Any, unit: str) -> Any:
    """Return values in the unit that people read."""
    return values * shown(1.0, unit)[0]
