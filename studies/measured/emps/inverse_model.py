"""Fit the forces of the EMPS axis directly, with scipy alone: a second view on what the closed loop found.

The inverse model F = M a + Fv v + Fc sign(v) + offset is linear in its parameters, so that no simulation is needed
(IDIM-LS: Gautier, Janot, Vandanjon 2013, doi:10.1109/TCST.2012.2185697). Speed and acceleration are central differences
of the position after a Butterworth low-pass that shifts no phase; both sides are filtered again and thinned. The
asymmetric model has a slope and a step of its own for each direction.

Usage: python studies/measured/emps/inverse_model.py CAMPAIGN OUT.md      (CAMPAIGN: as `armid import emps` writes it)
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import butter, decimate, filtfilt

# Volt to newton, of the set. Cut-off of the position, order, and thinning, as the set's own script chooses them.
GAIN_N_PER_V, CUTOFF_HZ, ORDER, THINNED = 35.15065188248547, 100.0, 4, 25
# Below this speed the sign of friction is not known.
SLOW_M_S = 1e-3
PUBLISHED = {"symmetric": {"DATA_EMPS": 4.0834, "DATA_EMPS_PULSES": 5.9824}, "asymmetric": {"DATA_EMPS": 3.1117}}
MASSES = {"symmetric": 95.1089, "asymmetric": 95.154}


def motion(table: pd.DataFrame) -> tuple[np.ndarray, ...]:
    """Return speed [m/s], acceleration [m/s2] and force [N]."""
    interval = float(np.median(np.diff(table["time_s"])))
    b, a = butter(ORDER, CUTOFF_HZ * 2.0 * interval)
    position = filtfilt(b, a, table["position_m"])
    speed = np.gradient(position, interval)
    return speed, np.gradient(speed, interval), GAIN_N_PER_V * table["drive_V"].to_numpy()


def columns(speed: np.ndarray, acceleration: np.ndarray, form: str) -> np.ndarray:
    """Return what each parameter multiplies, (n_samples, n_parameters): the mass first."""
    sign = np.sign(speed) * (np.abs(speed) > SLOW_M_S)
    if form == "symmetric":
        return np.column_stack([acceleration, speed, sign, np.ones_like(speed)])
    forward, back = sign > 0, sign < 0
    return np.column_stack([acceleration, speed * forward, 1.0 * forward, speed * back, -1.0 * back])


def problem(folder: Path, name: str, form: str) -> tuple[np.ndarray, ...]:
    """Return columns and force of one record, filtered and thinned to the band of the motion."""
    speed, acceleration, force = motion(pd.read_csv(folder / f"{name}.csv"))
    both = (columns(speed, acceleration, form), force)
    return tuple(decimate(values, THINNED, axis=0, zero_phase=True) for values in both)


def error(W: np.ndarray, force: np.ndarray, beta: np.ndarray) -> float:
    """Return |force - W beta| / |force| [%]."""
    return 100.0 * float(np.linalg.norm(force - W @ beta) / np.linalg.norm(force))


def report(folder: Path) -> str:
    """Return the table: fitted to DATA_EMPS, applied unchanged to DATA_EMPS_PULSES."""
    lines = [
        "# EMPS: the inverse model, a second view", "",
        "Force fitted by linear least squares to DATA_EMPS and applied unchanged to DATA_EMPS_PULSES; made by "
        "`python studies/measured/emps/inverse_model.py out/campaigns/emps out/emps/inverse_model.md`.", "",
        "| friction | record | force error | published | mass | published |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for form in ("symmetric", "asymmetric"):
        beta = np.linalg.lstsq(*problem(folder, "DATA_EMPS", form), rcond=None)[0]
        for name in ("DATA_EMPS", "DATA_EMPS_PULSES"):
            told = PUBLISHED[form].get(name)
            shown = "" if told is None else f"{told} %"
            lines.append(f"| {form} | {name} | {error(*problem(folder, name, form), beta):.3f} % | {shown} | "
                         f"{beta[0]:.3f} kg | {MASSES[form]} kg |")  # fmt: skip
        names = ("M", "Fv", "Fc", "offset") if form == "symmetric" else ("M", "Fv+", "Fc+", "Fv-", "Fc-")
        lines += [f"| | {', '.join(f'{n} = {b:.4g}' for n, b in zip(names, beta, strict=True))} | | | | |"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    text = report(Path(sys.argv[1]))
    Path(sys.argv[2]).write_text(text, encoding="utf-8")
    print(text)
