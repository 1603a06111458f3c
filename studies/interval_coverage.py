"""Count how often the 95 % intervals of `armid identify` hold the truth, for six fitnesses on two machines.

    python studies/interval_coverage.py --out out/coverage
    python studies/interval_coverage.py --out out/coverage_short --noises 5

Machines: the paper's arm (one stroke of 0.7 s), and a linear axis with viscous and dry friction, whose start is fitted.
Each noise makes one record; each fitness is identified on it from the whole box, with the defaults and 1,500
simulations. coverage.csv has a line for each machine, fitness and parameter:

coverage     share of the intervals that hold the truth, in %, of those that armid calls an interval
width        median half width over 1.96 standard deviations of the estimates of all noises
bias         mean error of the estimates over their standard deviation
intervals    number of noises for which armid gives an interval

Every single interval stands in intervals.csv.gz; what is cut off goes on from there with the same command.
"""

import argparse
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

import armid
from armid.estimation.information import NORMAL_95

BUDGET = 1_500
HEADERS = {"coverage": "coverage, %", "width": "width over true scatter", "bias": "bias over true scatter"}


def largest_miss(measured: Any, simulated: Any) -> Any:
    """Return the largest deviation of each candidate, (n_candidates,): a minimax fitness."""
    return np.abs(simulated - measured).max(axis=1)


FITNESSES = {name: name for name in ("rmse", "likelihood", "similarity", "numerical_similarity", "huber")}
FITNESSES |= {"minimax": largest_miss}


class Machine(NamedTuple):
    """A machine with known parameters. record: what a generator of the noise makes; given: to `armid.identify`."""

    name: str
    truth: dict[str, float]
    record: Callable[[np.random.Generator], pd.DataFrame]
    given: dict[str, Any]


def arm() -> Machine:
    """Return the paper's arm: a stroke that lowers a shell, 100 samples at rest before it, noise of 0.25 deg/s."""
    truth = {"p0": 3.05e6, "k": 0.9, "eta3": 0.57, "n": 1.2}
    keys = {"start_angle_deg": -48.0, "target_angle_deg": 22.0, "shell": True, "supply_V": 28.0}
    constants = {"theta_C": np.radians(-48.0), "theta_D": np.radians(22.0), "shell": True, "U": 28.0}
    model = armid.Model(armid.PLANTS["shell_transfer_arm"])
    clean = simulated(model, armid.Manoeuvre(1e-3, 701, constants), truth)
    times = 1e-3 * np.arange(-100, 701)
    speed = np.degrees(np.concatenate([np.zeros(100), clean]))

    def record(rng: np.random.Generator) -> pd.DataFrame:
        noisy = speed + 0.25 * rng.standard_normal(len(speed))
        table = pd.DataFrame({"time_s": times, "angular_velocity_deg_s": noisy})
        table.attrs.update(keys)
        return table

    return Machine("arm", truth, record, {"plant": "shell_transfer_arm"})


def axis() -> Machine:
    """Return a linear axis: 2 s of a force that alternates, noise of 5 mm/s."""
    truth, fixed = {"mass": 2.0, "viscous.slope": 3.0, "coulomb.level": 1.0}, {"coulomb.width": 0.05}
    times = 5e-3 * np.arange(401)
    force = np.where(np.sin(2.0 * np.pi * times) > 0.0, 8.0, -6.0)
    model = armid.Model(armid.PLANTS["driven_axis"]) + armid.EFFECTS["viscous"] + armid.EFFECTS["coulomb"]
    constants = {"start_position": 0.0, "start_speed": 0.0}
    clean = simulated(model, armid.Manoeuvre(5e-3, 401, constants, {"u": force}), truth | fixed)

    def record(rng: np.random.Generator) -> pd.DataFrame:
        noisy = clean + 5e-3 * rng.standard_normal(len(clean))
        return pd.DataFrame({"time_s": times, "velocity_m_s": noisy, "drive_N": force})

    bounds = {"mass": (0.5, 6.0), "viscous.slope": (0.0, 10.0), "coulomb.level": (0.0, 4.0)}
    given = {"plant": "driven_axis", "effects": "viscous,coulomb", "bounds": bounds, "fix": fixed}
    return Machine("axis", truth, record, given)


def simulated(model: armid.Model, manoeuvre: armid.Manoeuvre, parameters: dict[str, float]) -> Any:
    candidate = np.array([[parameters[name] for name in model.parameters]])
    return armid.simulate(model, manoeuvre, candidate, armid.Schedule(16)).output[0]


def identified(machine: Machine, number: int, seed: int) -> Iterator[dict[str, Any]]:
    """Give a row for each fitness and parameter of one noise: estimate, ends of the interval, what is against it."""
    record = machine.record(np.random.default_rng([seed, number]))
    for name, fitness in FITNESSES.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = armid.identify(record, fitness=fitness, budget=BUDGET, seed=number + 1, **machine.given)
        parameters = found.parameters
        for parameter in machine.truth:
            p = parameters[parameter]
            yield {"machine": machine.name, "fitness": name, "parameter": parameter, "noise": number,
                   "value": p.value, "low": p.low, "high": p.high, "doubt": p.doubt}  # fmt: skip


def coverage(rows: pd.DataFrame, machine: Machine) -> pd.DataFrame:
    """Return coverage, width, bias and number of intervals of each fitness and parameter of a machine."""
    found = []
    for (fitness, parameter), group in rows.groupby(["fitness", "parameter"], sort=False):
        truth, given = machine.truth[str(parameter)], group[group["doubt"].isna()]
        scatter = given["value"].std()
        inside = (given["low"] <= truth) & (truth <= given["high"])
        found.append({
            "machine": machine.name, "fitness": fitness, "parameter": parameter,
            "coverage": 100.0 * inside.mean(),
            "width": (given["high"] - given["low"]).median() / (2.0 * NORMAL_95 * scatter),
            "bias": (given["value"].mean() - truth) / scatter, "intervals": len(given), "noises": len(group),
        })  # fmt: skip
    return pd.DataFrame(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, help="folder for coverage.csv and report.md")
    parser.add_argument("--noises", type=int, default=200, help="noises of each machine [default: 200]")
    parser.add_argument("--seed", type=int, default=1, help="seed of the noises [default: 1]")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    machines, store = (arm(), axis()), given.out / "intervals.csv.gz"
    done = [pd.read_csv(store)] if store.is_file() else []
    known = {(m, n) for part in done for m, n in zip(part["machine"], part["noise"], strict=True)}
    for number in range(given.noises):
        for machine in machines:
            if (machine.name, number) not in known:
                rows = pd.DataFrame(identified(machine, number, given.seed))
                rows.to_csv(store, index=False, mode="a", header=not store.is_file())
    rows = pd.read_csv(store)
    rows = rows[rows["noise"] < given.noises]
    table = pd.concat([coverage(rows[rows["machine"] == m.name], m) for m in machines])
    table.round(3).to_csv(given.out / "coverage.csv", index=False)
    note = f"{given.noises} noises a machine, seed {given.seed}; `studies/interval_coverage.py` explains the columns."
    lines = [[HEADERS.get(name, name) for name in table.columns], ["---"] * len(table.columns)]
    lines += [[f"{v:.3g}" if isinstance(v, float) else str(v) for v in row] for row in table.itertuples(index=False)]
    page = ["# Coverage of 95 % intervals", "", note, "", *(f"| {' | '.join(cells)} |" for cells in lines), ""]
    (given.out / "report.md").write_text("\n".join(page), encoding="utf-8")
    print(table.round(3).to_string(index=False))


if __name__ == "__main__":
    main()
