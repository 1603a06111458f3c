"""CPU seconds that a user waits for each command, beside a fixed computation, so that machines compare.

    cd studies; python -m bench.commands --out FILE.csv [--only WORD] [--before TREE]

Each line is the whole process with its children. "cold" begins with an empty compile cache, "warm" with a full one.
What takes the time of the lines that miss their target: identify, imports (numba and scipy are half of it); close-loop
on the rocking shell, 5 of 14 s in the loop, 5 in nine figures and the page, 3 in imports; "cold", the compiler on one
model with 45 candidates, for `check` on three plants; six effects, fits and scores in the engine.
--before measures each command with the armid of another checkout beside it. The lines of the engine are ratios of one
run. Nothing else should run on the machine: a shared core makes CPU seconds longer too.
"""

import argparse
import csv
import os
import resource
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from bench.engine import engine_rows, threads_row
from bench.measure import number, system_text
from bench.processes import ARMID, run_apart
from bench.samples import child_environment

Array = NDArray[np.float64]
STUDIES = Path(__file__).parents[1]
MACHINE = STUDIES / "your_own_machine"
REFERENCE = (sys.executable, "-c", "import numpy as np; a = np.random.default_rng(1).random((400, 400));"
             "[np.linalg.svd(a) for _ in range(8)]; sum(i * i for i in range(3_000_000))")  # fmt: skip


@dataclass(frozen=True)
class Command:
    """Declare what is measured: its arguments behind `armid`, the target [CPU s], whether the cache is empty.

    {studies} stands for the studies of the checkout, {out} for a new folder, {stranger} and {six} for campaigns that
    are made, {effect} for a file that is made.
    """

    what: str
    arguments: tuple[str, ...]
    target: float
    cold: bool = False


IDENTIFY = ("identify", "{studies}/campaigns/paper_arm", "--identifier", "least_squares", "--fitness", "rmse")
LOOP = ("close-loop", "{studies}/campaigns/rocking_shell", "--out", "{out}")
# Undeclared effects of a campaign of the arm, SYNTHETIC, which the simulator of each checkout makes.
SIX = ("--manoeuvres", "lower,raise,short,empty", "--effect", "coulomb=40", "drag=15", "tilt_deg=3", "brush_drop=1.5",
       "supply_sag=0.01", "rocking_hz=10")  # fmt: skip
PLANT = ("--plugin", "{studies}/your_own_machine/plant.py:boom")
COMMANDS = (
    Command("armid --version", ("--version",), 0.2),
    Command("armid list fitness", ("list", "fitness"), 0.35),
    Command("identify, warm", IDENTIFY, 1.2),
    Command("identify --out, warm", (*IDENTIFY, "--out", "{out}"), 3.0),
    Command("close-loop rocking shell, warm", LOOP, 6.0),
    Command("close-loop rocking shell, cold", LOOP, 30.0, cold=True),
    Command("check of a one-line effect, cold", ("check", "{effect}:wear"), 8.0, cold=True),
    Command("close-loop stranger's machine, warm", ("close-loop", "{stranger}", *PLANT, "--out", "{out}"), 60.0),
    Command("close-loop arm with six effects, warm", ("close-loop", "{six}", "--out", "{out}"), 60.0),
    Command("study table1_short, cold", ("study", "{studies}/table1_short.toml", "--out", "{out}"), 61.0, True),
)  # fmt: skip
COLUMNS = ("what", "cpu_s", "before_cpu_s", "target_cpu_s", "of_reference", "ratio", "target_ratio", "met")
MET = {True: "yes", False: "no"}
EFFECT = '''"""Friction in proportion to the speed."""

from armid import Effect, Parameter


def torque(omega, level):
    return -level * omega


wear = Effect("wear", parameters=(Parameter("level", "effort/speed", 0.0, 0.5, null=0.0),), adds={"torque": torque})
'''


def cpu_seconds(command: Sequence[str], **environment: str) -> float:
    """Return the CPU time of a command and its children [s].

    Raises ArmidError with the last thing it said when it fails.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run_apart(command, **environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def measure(commands: Sequence[Command], folder: Path, before: Path | None = None) -> Iterator[dict[str, str]]:
    """Yield the reference, then one row a command.

    It is the shortest of three warm runs, of one where it takes more than 20 s, and of one cold run. Above 150 s it is
    the run that fills the cache: compiling is a small part of it.
    """
    trees: dict[str, tuple[Path, dict[str, str]]] = {"cpu_s": (STUDIES, {})}
    if before is not None:
        path = f"{before / 'src'}{os.pathsep}{child_environment()['PYTHONPATH']}"
        trees["before_cpu_s"] = before / "studies", {"PYTHONPATH": path}
    reference = min(cpu_seconds(REFERENCE) for _ in range(3))
    yield {"what": "reference computation", "cpu_s": number(reference)}
    made = {"effect": folder / "wear.py", "stranger": folder / "stranger"}
    made["effect"].write_text(EFFECT, encoding="utf-8")
    if any("{stranger}" in c.arguments for c in commands):
        write_strangers_machine(made["stranger"])
    for tree, (studies, own) in trees.items() if any("{six}" in c.arguments for c in commands) else ():
        cpu_seconds([sys.executable, str(studies / "test_stand.py"), str(folder / f"six_{tree}"), *SIX], **own)
    for k, command in enumerate(commands):
        best = {}
        for tree, (studies, own) in trees.items():
            times: list[float] = []
            while len(times) < needed(command, times):
                own_place = {"studies": studies, "six": folder / f"six_{tree}"}
                place = made | own_place | {"out": folder / f"out{k}_{tree}_{len(times)}"}
                cache = folder / (f"cold{k}_{tree}" if command.cold else f"cache_{tree}")
                given = [part.format(**place) for part in command.arguments]
                times.append(cpu_seconds([*ARMID, *given], **own, ARMID_CACHE=str(cache)))
            best[tree] = min(times[1:] or times)
        yield {"what": command.what, "target_cpu_s": number(command.target),
               "of_reference": number(best["cpu_s"] / reference), "met": MET[best["cpu_s"] <= command.target],
               **{tree: number(seconds) for tree, seconds in best.items()}}  # fmt: skip


def needed(command: Command, times: Sequence[float]) -> int:
    """Return how many runs of a command there are to be; the first warm one fills the cache and counts above 150 s."""
    if command.cold or (times and max(times) >= 150.0):
        return 1
    return 2 if times and max(times) >= 20.0 else 4


def measure_engine() -> Iterator[dict[str, str]]:
    """Yield a row for each ratio of the engine: to scipy, to a plain loop, of two threads to one."""
    rows = [*(row for row in engine_rows() if row.ratio is not None), threads_row()]
    for row, target in zip(rows, (4500.0, 30.0, 1.87), strict=True):
        yield {"what": f"engine: {row.what.removeprefix('engine, ')}", "ratio": number(row.ratio),
               "target_ratio": number(target), "met": MET[row.ratio >= target]}  # fmt: skip


# Effects that the boom gets beside its own (friction of its load, a late speed signal, a supply that sags).
COULOMB, DRAG, MISFIT, SMOOTH = 0.25, 0.12, 0.1, 60
DURATION_S, N_SAMPLES = 6.0, 1100


def write_strangers_machine(folder: Path, seed: int = 3) -> None:
    """Write a campaign of the boom: 8 records to train on, 2 held out, each 6 s and 1,100 samples. SYNTHETIC.

    The truth: what make_records.py gives the boom, Coulomb friction and quadratic drag, and a smooth disturbance of a
    tenth of the signal that differs in every record, so that no effect explains it.
    """
    sys.path.insert(0, str(MACHINE))
    import make_records as boom  # noqa: PLC0415 - it lies beside its plant, outside of this package

    rng = np.random.default_rng(seed)

    def rates(time: float, y: Array, run: boom.Run) -> list[float]:
        position, speed, recorded = boom.rates(time, y, run)
        friction = COULOMB * y[1] / np.hypot(y[1], boom.SHARP) + DRAG * y[1] * abs(y[1])
        return [position, speed - friction / boom.TRUTH["inertia"], recorded]

    folder.mkdir()
    text, times = 'name = "stranger"\nplant = "boom"\n', np.linspace(0.0, DURATION_S, N_SAMPLES)
    for k in range(10):
        moves, begin, position = [], 0.2, 0.0
        while begin < DURATION_S - 1.0:
            length, by = rng.uniform(0.2, 0.9), rng.uniform(-100.0, 100.0)
            by = -by if abs(position + by) > 120.0 else by
            moves.append((begin, begin + length, by))
            begin, position = begin + length + rng.uniform(0.1, 0.6), position + by
        run = boom.Run(rng.uniform(35.0, 120.0), rng.uniform(1.0, 4.0), tuple(moves))
        found = solve_ivp(rates, (0.0, DURATION_S), np.zeros(3), "LSODA", times, args=(run,), rtol=1e-8, max_step=5e-3)
        q, v, recorded = found.y
        smooth = np.convolve(rng.normal(size=N_SAMPLES), np.hanning(SMOOTH), "same")
        recorded = recorded + smooth * MISFIT * np.std(recorded) / np.std(smooth)
        columns = {
            "time_s": times,
            "angular_velocity_deg_s": np.rad2deg(recorded) + rng.normal(0.0, boom.NOISE_DEG_S, N_SAMPLES),
            "angle_deg": np.rad2deg(q), "target_deg": np.rad2deg(boom.target(run, times)),
            "supply_V": boom.electric(run, times, q, v)[1], "drive_on": np.ones(N_SAMPLES),
        }  # fmt: skip
        values = np.array(list(columns.values())).T
        np.savetxt(folder / f"r{k}.csv", values, "%.7g", ",", header=",".join(columns), comments="")
        text += f'\n[[records]]\nfile = "r{k}.csv"\nrole = "{"train" if k < 8 else "holdout"}"\n'
        text += f"[records.constants]\nkp = {run.kp}\nkd = {run.kd}\n"
    (folder / "campaign.toml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m bench.commands", description=str(__doc__).splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", default="", help="lines that hold this word; `engine` for those of the engine")
    parser.add_argument("--before", type=Path, metavar="TREE", help="another checkout, to be measured beside this one")
    options = parser.parse_args()
    try:
        file = options.out.open("w", newline="", encoding="utf-8")
    except OSError as error:
        parser.error(f"{options.out} cannot be written: {error.strerror or error}")
    with file, TemporaryDirectory(prefix="armid-bench-") as place:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        chosen = [c for c in COMMANDS if options.only in c.what]
        engine = measure_engine() if options.only in ("", "engine") else ()
        for row in chain(measure(chosen, Path(place), options.before), engine):
            writer.writerow(row)
            file.flush()
            print(", ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    print(system_text())
