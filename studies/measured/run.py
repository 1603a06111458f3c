"""Close the loop on the measured machines, one command each without a hint, and print one table.

    python studies/measured/run.py --data FOLDER --out DIR

FOLDER holds a folder for each machine, as named below; a machine whose files are not there is named and left out. DIR
gets campaigns, reports and table.md. A report that DIR holds already is not made again: delete it to run it again.
"""

import argparse
import json
import math
import resource
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
# Names of one step in the table.
MOST_NAMED = 3
DEG = 180.0 / math.pi
Report = Mapping[str, Any]


@dataclass(frozen=True)
class Case:
    """Hold one line of the table.

    machine: folder of its make_campaign.py, and of its data. imported: what `armid import` calls the set, with options,
    where that makes the campaign. plant: attribute of the folder's plant.py. ready: the campaign in the data's folder,
    where it stands there already, with its plant.py.
    role, unit, factor: which rmse is shown, of every record of the role or of all together, and in which unit.
    published: what others reached on the same records, in that unit.
    """

    name: str
    machine: str
    judged: str
    role: str
    unit: str
    factor: float
    published: str
    imported: tuple[str, ...] = ()
    plant: str = ""
    ready: str = ""


CASES = (
    Case("emps", "emps", "velocity held out", "holdout", "mm/s", 1e3, "4.45 (a direct fit)",
         ("emps",)),
    Case("dfki", "dfki_simple_pendulum", "speed, both records fitted", "train", "rad/s", 1.0, "0.18 (a direct fit)",
         ("dfki",)),
    *(Case(f"dfki_without_{record}", "dfki_simple_pendulum", f"speed, {record} held out", "holdout", "rad/s", 1.0, "",
           ("dfki", "--holdout", record)) for record in ("direct_collocation", "ddp")),
    Case("quarter_drone", "quarter_drone", "angle held out: multisine, steps, swept sine", "holdout", "deg", DEG,
         "grey box 2.16, 4.08, 3.18; best Neural ODE 1.55, 4.00, 2.56", plant="quarter_drone"),
    Case("quanser_flexible_link", "quanser_flexible_link", "held out: hub angle, deflection", "holdout", "deg", DEG,
         "1.36, 0.27 and 0.41, 0.17 (direct fits)"),
    Case("bam_xl330", "bam_xl330", "speed held out, all records", "holdout_all", "rad/s", 1.0,
         "0.300 to 0.328 (direct fits)",
         plant="servo", ready="camp"),
    Case("cluj_bldc", "cluj_bldc", "speed held out", "holdout", "rad/s", 1.0, "5.02 (a direct fit)", ready="."),
)  # fmt: skip
HEADING = ("| machine | judged | unit | declared | after | published or found elsewhere | named | verdict | CPU, s |",
           "|---|---|---|---|---|---|---|---|---|")  # fmt: skip


def closed(case: Case, data: Path, out: Path) -> tuple[Report, float]:
    """Make the campaign, close the loop, and return its report with the processor time [s]; stored ones are read."""
    campaign, result = campaign_of(case, data, out), out / case.name
    cost = result / "cpu_s.txt"
    if not cost.is_file():
        if not campaign.is_dir():
            own = (str(HERE / case.machine / "make_campaign.py"), "--data")
            made_by = ("-m", "armid", "import", *case.imported) if case.imported else own
            call(*made_by, str(data / case.machine), "--out", str(campaign))
        beside = (data if case.ready else HERE) / case.machine / "plant.py"
        plugin = ("--plugin", f"{beside}:{case.plant}") if case.plant else ()
        seconds = call("-m", "armid", "close-loop", str(campaign), "--out", str(result), *plugin)
        cost.write_text(f"{seconds:.0f}\n", encoding="utf-8")
    return json.loads((result / "report.json").read_text(encoding="utf-8")), float(cost.read_text(encoding="utf-8"))


def campaign_of(case: Case, data: Path, out: Path) -> Path:
    return data / case.machine / case.ready if case.ready else out / "campaigns" / case.name


def call(*words: str) -> float:
    """Run Python with some words, and return the processor time it took [s]; a failure ends the program."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=False)
    if done.returncode:
        sys.exit(f"run.py: python {' '.join(words)} ended with {done.returncode}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def row(case: Case, report: Report, cpu: float, roles: Mapping[str, str]) -> str:
    shown = [" ".join(f"{value * case.factor:.3g}" for value in errors_of(report, case, when, roles)) for when in
             ("before", "after")]  # fmt: skip
    named = [
        any_of((s["effect"], *s["alternatives"])) + ("" if s.get("claimed", True) else " (candidate)")
        for s in report["steps"]
        if s["effect"] in report["effects"]
    ]
    return (f"| {case.name} | {case.judged} | {case.unit} | {' | '.join(shown)} | {case.published} | "
            f"{'; '.join(named) or 'nothing'} | {report['verdict']} | {cpu:.0f} |")  # fmt: skip


def any_of(names: Sequence[str]) -> str:
    """Return the names of which one holds, the first ones where there are many."""
    left = len(names) - MOST_NAMED
    return " or ".join([*names[:MOST_NAMED], *([f"{left} other{'s' if left > 1 else ''}"] if left > 0 else [])])


def errors_of(report: Report, case: Case, when: str, roles: Mapping[str, str]) -> Iterator[float]:
    """Yield the rmse (SI) of each output of each record of the role; of several train records of all together."""
    error = report["error"][when]
    if case.role in ("train", "holdout_all"):
        yield error[case.role.removesuffix("_all")]["rmse"]
        return
    for file, of_record in error["records"].items():
        if roles[file] == case.role:
            yield from (each["rmse"] for each in of_record.get("outputs", {"": of_record}).values())


def table(data: Path, out: Path, only: Sequence[str]) -> list[str]:
    """Return the lines of the table, as far as the data is there; only: names of lines, none for all."""
    lines = list(HEADING)
    for case in (c for c in CASES if not only or c.name in only):
        if not (data / case.machine).is_dir():
            print(f"{case.name}: {data / case.machine} is not there, left out", file=sys.stderr, flush=True)
            continue
        print(f"{case.name}: closing the loop", file=sys.stderr, flush=True)
        report, cpu = closed(case, data, out)
        sheet = tomllib.loads((campaign_of(case, data, out) / "campaign.toml").read_text(encoding="utf-8"))
        lines.append(row(case, report, cpu, {entry["file"]: entry["role"] for entry in sheet["records"]}))
    return lines


def main() -> None:
    """Print the table and write it to table.md."""
    parser = argparse.ArgumentParser(description="Close the loop on the measured machines.", allow_abbrev=False)
    parser.add_argument("--data", type=Path, required=True, help="holds a folder for each machine")
    parser.add_argument("--out", type=Path, required=True, help="campaigns, reports, table.md")
    parser.add_argument("--only", nargs="+", default=(), choices=[c.name for c in CASES], help="lines of the table")
    options = parser.parse_args()
    lines = table(options.data, options.out, options.only)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "table.md").write_text("\n".join([*lines, ""]), encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
