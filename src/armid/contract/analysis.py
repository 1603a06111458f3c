"""The contract of an analysis: a function `name(runs)` of the runs of a study that returns tables and figures."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from armid.contract.trials import Finding
from armid.errors import ArmidError
from armid.report.style import pyplot

if TYPE_CHECKING:
    from pandas import DataFrame

SEEDS = range(1, 6)
# Parameter -> truth in each case, SI.
TRUTHS = {"p0": {"row 1": 3.2e6, "row 2": 3.1e6}, "k": {"row 1": 1.0, "row 2": 0.95}}


def check_analysis(name: str, function: Callable[..., Any]) -> list[Finding]:
    """Try an analysis on made-up runs of two identifiers, one of which has failed.

    Raises ArmidError for what is no function.
    """
    if not callable(function):
        raise ArmidError(f"analysis '{name}' is of type {type(function).__name__}: a function of runs is expected")
    runs = synthetic_runs()
    try:
        parts = parts_of(name, function(runs))
        again = parts_of(name, function(synthetic_runs()))
    except Exception as error:
        text = str(error) if isinstance(error, ArmidError) else f"{type(error).__name__}: {error}"
        return [Finding("tables and figures", False, text)]
    unchanged, same = runs.equals(synthetic_runs()), content(parts) == content(again)
    return [
        Finding("tables and figures", True, f"{len(parts)}: {', '.join(parts)}"),
        Finding("leaves its argument alone", unchanged,
                "the runs are as they were" if unchanged else "the runs that it was given have changed"),
        Finding("deterministic", same, "a second call is compared with the first"),
    ]  # fmt: skip


def parts_of(name: str, found: Any) -> dict[str, Any]:
    """Return title -> DataFrame or matplotlib figure of what an analysis returned.

    found: a DataFrame, a figure (or what carries one, such as axes), or a dict, tuple or list of these; None: nothing.

    Raises ArmidError for anything else.
    """
    from matplotlib.figure import Figure
    from pandas import DataFrame

    if found is None:
        return {}
    if isinstance(found, Mapping):
        titled = {str(title): part for title, part in found.items()}
    elif isinstance(found, tuple | list):
        titled = {f"{name} {i}": part for i, part in enumerate(found, 1)}
    else:
        titled = {name: found}
    parts = {title: part if isinstance(part, DataFrame) else getattr(part, "figure", part)
             for title, part in titled.items()}  # fmt: skip
    for title, part in parts.items():
        if not isinstance(part, DataFrame | Figure):
            raise ArmidError(f"analysis '{name}' returns a {type(part).__name__} as '{title}': a pandas DataFrame, a "
                             "matplotlib figure, or a dict or tuple of these is expected")  # fmt: skip
    return parts


def content(parts: Mapping[str, Any]) -> dict[str, object]:
    """Return what tables and figures show, comparable; figures are closed."""
    found: dict[str, object] = {}
    for title, part in parts.items():
        if hasattr(part, "canvas"):
            part.canvas.draw()
            found[title] = bytes(part.canvas.buffer_rgba())
            pyplot().close(part)
        else:
            found[title] = part.to_csv()
    return found


def synthetic_runs() -> "DataFrame":
    """Return made-up runs, one row a run, with every column that an analysis is given.

    Two identifiers ran on two cases under two noise levels with five seeds; the last run failed.

    ==================================  ==========================================================================
    study, run                          names of the study and of the run
    case, identifier, fitness           what was identified, who searched, what was minimised
    noise_deg_s, window, seed           noise that the study added (NaN: records' own), part of the motion
    variant, setting                    identifier (with its fitness where it ran on several); noise in words
    status, error, stopped              "done" or "failed" and why; why the search stopped
    budget, used, n_failed              simulations: allowed, used, diverged
    value                               best fitness
    train_rmse, holdout_rmse            errors of the result, SI
    train_s, train_s1, train_s2         similarity degrees of the result
    seconds                             duration
    largest_error                       largest relative error of a parameter; inf: failed, NaN: truth not known
    NAME                                value of each free parameter, SI
    NAME_truth, NAME_error              its truth, and abs(value - truth)/abs(truth), NaN where it is not known
    NAME_deviation, NAME_at_bound       its Cramer-Rao standard deviation; whether it ended on its bound
    ==================================  ==========================================================================
    """
    from pandas import DataFrame

    pyplot()
    rng = np.random.default_rng(1)
    rows: list[dict[str, Any]] = []
    for case in TRUTHS["k"]:
        for identifier, scale in (("pso", 1e-3), ("de", 1e-5)):
            for noise, setting in ((0.0, "noise-free"), (0.3, "0.3 deg/s")):
                for seed in SEEDS:
                    errors = {name: scale * float(rng.lognormal()) for name in TRUTHS}
                    row = {
                        "study": "made_up", "run": f"r{len(rows)}", "case": case, "identifier": identifier,
                        "fitness": "rmse", "noise_deg_s": noise, "window": "whole", "seed": seed, "variant": identifier,
                        "setting": setting, "status": "done", "error": "", "stopped": "budget used", "budget": 3000,
                        "used": 3000 - seed, "n_failed": seed, "value": scale, "train_rmse": 0.01,
                        "holdout_rmse": 0.02, "train_s": 0.99, "train_s1": 0.99, "train_s2": 1.0, "seconds": 1.0,
                        "largest_error": max(errors.values()),
                    }  # fmt: skip
                    for name, truth in TRUTHS.items():
                        row |= {
                            name: truth[case] * (1.0 + errors[name]), f"{name}_truth": truth[case],
                            f"{name}_error": errors[name], f"{name}_deviation": 1e-3 * truth[case],
                            f"{name}_at_bound": False,
                        }  # fmt: skip
                    rows.append(row)
    found = [f"{name}{end}" for name in TRUTHS for end in ("", "_error", "_deviation")]
    results = ["value", "train_rmse", "holdout_rmse", "train_s", "train_s1", "train_s2", *found]
    rows[-1] |= dict.fromkeys(results, np.nan) | {
        "status": "failed", "error": "it broke", "stopped": "", "used": 0, "n_failed": 0, "largest_error": np.inf,
    }  # fmt: skip
    return DataFrame(rows)
