"""What two libraries that learn models from data reach on the measured machines, on the splits of their campaigns.

    python studies/measured/baselines.py CAMPAIGN ... --out TABLE.md      (CAMPAIGN: folders that run.py made)

pysindy: what the declared acceleration lacks, by sequentially thresholded least squares on `library`; slopes are those
of a Savitzky-Golay filter. sysidentpy: a polynomial NARX model of each output, its terms chosen by FROLS. Each setting
of the grids is fitted to the first 80 % of every train part and simulated freely over the rest; the best is fitted
again to all of train. Every part is then simulated freely, from the measured state (NARX: from its first samples).
Series are thinned to about 100 Hz. Needs the packages pysindy and sysidentpy, in any environment.
"""

import argparse
import itertools
import tomllib
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import savgol_filter

RATE_HZ, LOST, DEGREE = 100.0, 1e3, np.pi / 180.0
THRESHOLDS, WINDOWS = (1e-3, 1e-2, 5e-2, 0.2), (7, 11, 25)
LAGS, DEGREES, TERMS = (2, 4, 8), (1, 2, 3), (4, 8, 14)
Array = np.ndarray


@dataclass(frozen=True)
class Machine:
    """Hold columns of a machine: positions, speeds ("" where not measured), input, outputs with unit and factor.

    declared: (positions and speeds, input) -> declared accelerations, (n_samples, n_positions).
    """

    positions: tuple[str, ...]
    speeds: tuple[str, ...]
    driven: str
    outputs: dict[str, tuple[str, float]]
    declared: Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Part:
    """Hold a part of a record, simulated from its start alone: table (angles in rad), interval [s], file, role."""

    table: pd.DataFrame
    interval: float
    file: str
    role: str


def flexible(x: Array, u: Array) -> Array:
    """Return the accelerations of hub and deflection by the catalogue [rad/s2]."""
    hub = (8.925 * u - 4.0 * x[:, 2:3] + 39.957 * x[:, 1:2]) / 0.06353616
    return np.hstack([hub, -39.957 * x[:, 1:2] / 0.170434272 - hub])


# Declared: the loop's fit of the mass alone; CAD; the published grey box as fitted by the loop; the catalogue.
MACHINES = {
    "emps": Machine(("position_m",), ("velocity_m_s",), "drive_V", {"velocity_m_s": ("mm/s", 1e3)},
                    lambda x, u: 35.15065 * u / 1990.0),
    "dfki": Machine(("angle_rad",), ("angular_velocity_rad_s",), "drive_N_m",
                    {"angular_velocity_rad_s": ("rad/s", 1.0)}, lambda x, u: (u - 2.997 * np.sin(x[:, :1])) / 0.1495),
    "quarter_drone": Machine(("angle_deg",), ("",), "command_percent", {"angle_deg": ("deg", 1 / DEGREE)},
                             lambda x, u: 4.28e-3 * u**2 - 8.46 * np.sin(x[:, :1]) - 1.69 * x[:, 1:]),
    "quanser_flexible_link": Machine(
        ("hub_angle_deg", "deflection_deg"), ("", ""), "current_A",
        {"hub_angle_deg": ("deg", 1 / DEGREE), "deflection_deg": ("deg", 1 / DEGREE)}, flexible),
}  # fmt: skip


def parts_of(folder: Path) -> list[Part]:
    """Return the parts of a campaign's records, thinned; restart_s cuts a record."""
    found = []
    for entry in tomllib.loads((folder / "campaign.toml").read_text())["records"]:
        table = pd.read_csv(folder / entry["file"])
        step = float(np.median(np.diff(table["time_s"])))
        angles = [c for c in table.columns if c.endswith(("_deg", "_deg_s"))]
        table[angles] *= DEGREE
        n = round(entry["restart_s"] / step) if "restart_s" in entry else len(table)
        every = max(1, round(1.0 / (RATE_HZ * step)))
        starts = range(0, len(table) - n + 1, n)
        found += [Part(table[i : i + n : every].reset_index(drop=True), step * every, entry["file"], entry["role"])
                  for i in starts]  # fmt: skip
    return found


def motion(part: Part, machine: Machine, window: int) -> tuple[Array, Array, Array]:
    """Return positions and speeds (n, 2 c), accelerations (n, c) and the input (n, 1) of a part."""

    def slope(values: Array, order: int = 1) -> Array:
        longest = (len(values) - 1) // 2 * 2 + 1
        return savgol_filter(values, min(window, longest), 3, deriv=order, delta=part.interval)

    positions = [part.table[c].to_numpy() for c in machine.positions]
    speeds = [part.table[s].to_numpy() if s else slope(q) for q, s in zip(positions, machine.speeds, strict=True)]
    rises = [slope(v) if s else slope(q, 2) for q, v, s in zip(positions, speeds, machine.speeds, strict=True)]
    return np.column_stack(positions + speeds), np.column_stack(rises), part.table[[machine.driven]].to_numpy()


def library(x: Array, u: Array, scales: Array) -> Array:
    """Return the candidate terms, (n, n_terms): constant, speeds, signs, squares, positions, their sines, input."""
    n = x.shape[1] // 2
    q, v, w = x[:, :n] / scales[:n], x[:, n:] / scales[n:-1], u / scales[-1]
    return np.hstack([np.ones_like(w), v, np.tanh(x[:, n:] / 0.02), v * np.abs(v), q, np.sin(x[:, :n]), w, w * abs(w)])


def sindy(train: Sequence[Part], machine: Machine, threshold: float, window: int) -> Callable[[Part], Array]:
    """Return what simulates a part freely: the declared acceleration and what pysindy adds, by Runge-Kutta."""
    from pysindy import STLSQ, IdentityLibrary, SINDy  # noqa: PLC0415

    x, a, u = (np.concatenate(each) for each in zip(*(motion(p, machine, window) for p in train), strict=True))
    scales, size = np.abs(np.hstack([x, u])).max(axis=0), a.std(axis=0)
    terms, lacking = library(x, u, scales), (a - machine.declared(x, u)) / size
    model = SINDy(optimizer=STLSQ(threshold=threshold, alpha=1e-6), feature_library=IdentityLibrary())
    # pysindy wants as many derivatives as features: those of the others are 0
    model.fit(terms, t=1.0, x_dot=np.pad(lacking, ((0, 0), (0, terms.shape[1] - lacking.shape[1]))))
    weights = model.coefficients()[: a.shape[1]].T * size

    def rates(x: Array, u: Array) -> Array:
        more = library(x[None], u[None], scales) @ weights
        return np.concatenate([x[len(x) // 2 :], (machine.declared(x[None], u[None]) + more)[0]])

    def run(part: Part) -> Array:
        known, _, driven = motion(part, machine, window)
        found, h = [known[0]], part.interval
        for ua, ub in itertools.pairwise(driven):
            x, um = found[-1], 0.5 * (ua + ub)
            k1 = rates(x, ua)
            k2 = rates(x + 0.5 * h * k1, um)
            k3 = rates(x + 0.5 * h * k2, um)
            found.append(np.clip(x + h / 6 * (k1 + 2 * (k2 + k3) + rates(x + h * k3, ub)), -LOST, LOST))
        columns = (*machine.positions, *machine.speeds)
        return np.array(found)[:, [columns.index(name) for name in machine.outputs]]

    return run


def narx(train: Sequence[Part], machine: Machine, lag: int, degree: int, terms: int) -> Callable[[Part], Array]:
    """Return what simulates a part freely: a polynomial NARX model of each output; parts are joined for the fit."""
    from sysidentpy.basis_function import Polynomial  # noqa: PLC0415
    from sysidentpy.model_structure_selection import FROLS  # noqa: PLC0415
    from sysidentpy.parameter_estimation import LeastSquares  # noqa: PLC0415

    whole = pd.concat([p.table for p in train])
    scales, models = whole.abs().max(), {}
    for name in machine.outputs:
        models[name] = FROLS(ylag=lag, xlag=lag, n_terms=terms, order_selection=False, estimator=LeastSquares(),
                             basis_function=Polynomial(degree=degree))  # fmt: skip
        models[name].fit(X=(whole / scales)[[machine.driven]].to_numpy(), y=(whole / scales)[[name]].to_numpy())

    def run(part: Part) -> Array:
        t = part.table / scales
        return np.hstack([m.predict(X=t[[machine.driven]].to_numpy(), y=t[[name]].to_numpy()[:lag]) * scales[name]
                          for name, m in models.items()])  # fmt: skip

    return run


METHODS = {"pysindy": (sindy, (THRESHOLDS, WINDOWS)), "sysidentpy": (narx, (LAGS, DEGREES, TERMS))}


def errors(run: Callable[[Part], Array], parts: Sequence[Part], machine: Machine) -> dict[str, Array]:
    """Return file -> rmse of each output over the parts of a record; what diverges misses by LOST."""
    squares: dict[str, list[Array]] = {}
    for part in parts:
        miss = run(part) - part.table[list(machine.outputs)].to_numpy()
        squares.setdefault(part.file, []).append(np.nan_to_num(miss, nan=LOST, posinf=LOST, neginf=LOST) ** 2)
    return {file: np.sqrt(np.mean(np.concatenate(some), axis=0)) for file, some in squares.items()}


def rows(folder: Path) -> Iterator[str]:
    machine = MACHINES[tomllib.loads((folder / "campaign.toml").read_text())["name"]]
    parts = parts_of(folder)
    train = [p for p in parts if p.role == "train"]
    early = [replace(p, table=p.table[: int(0.8 * len(p.table))]) for p in train]
    late = [replace(p, table=p.table[int(0.8 * len(p.table)) :].reset_index(drop=True)) for p in train]
    sizes = pd.concat([p.table for p in late])[list(machine.outputs)].std().to_numpy()
    for name, (method, grid) in METHODS.items():
        tried = {}
        for setting in itertools.product(*grid):
            with np.errstate(all="ignore"):
                found = errors(method(early, machine, *setting), late, machine)
            tried[setting] = float(np.mean([e / sizes for e in found.values()]))
        best = min(tried, key=lambda s: tried[s])
        run = method(train, machine, *best)
        for file, found in errors(run, parts, machine).items():
            shown = ", ".join(f"{e * factor:.3g} {unit}" for e, (unit, factor)
                              in zip(found, machine.outputs.values(), strict=True))  # fmt: skip
            role = next(p.role for p in parts if p.file == file)
            yield f"| {folder.name} | {name} {version(name)} | {', '.join(map(str, best))} | {file}, {role} | {shown} |"


def main() -> None:
    """Write the table of the campaigns that the command line names."""
    parser = argparse.ArgumentParser(description="Fit pysindy and sysidentpy to campaigns.", allow_abbrev=False)
    parser.add_argument("campaigns", nargs="+", type=Path, metavar="CAMPAIGN")
    parser.add_argument("--out", type=Path, required=True, help="the table, Markdown")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    lines = ["| campaign | method | setting (threshold, window or lags, degree, terms) | record | rmse of a free run |",
             "|---|---|---|---|---|"]  # fmt: skip
    try:
        lines += [line for folder in options.campaigns for line in rows(folder)]
    except ImportError as error:
        parser.error(f"the package {error.name} is missing: pip install pysindy sysidentpy, in any environment")
    options.out.write_text("\n".join([*lines, ""]), encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
