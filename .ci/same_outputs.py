"""Run two commits side by side on one machine and tell which of their outputs differ in a byte.

    python .ci/same_outputs.py make TREE FOLDER [--data DATA]   # what the package in TREE/src gives, into FOLDER
    python .ci/same_outputs.py compare BEFORE AFTER             # the outputs of two trees; exit code 1 where any differ

DATA holds the measured records, a folder a machine; what needs them is left out without it.
Times and versions are the only values that are left out of the comparison.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

CAMPAIGNS = ("paper_arm", "one_stroke", "four_strokes", "rocking_shell")
IDENTIFIERS = ("pso", "de", "cmaes", "bobyqa", "least_squares", "pso+least_squares")
LEFT_OUT = {"versions", "seconds", "wall_s", "cpu_s", "made_by", "duration_s"}
ENGINE = """
from pathlib import Path
import armid
from armid.engine.generate import kernel_parts
plant = armid.PLANTS["shell_transfer_arm"]
for name in ("", "coulomb", "shell_rocking"):
    model = armid.Model(plant)
    model = model + armid.EFFECTS[name] if name else model
    Path({folder!r}, f"engine_{{name or 'arm'}}.txt").write_text(kernel_parts(model, 8).text())
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make")
    making.add_argument("tree", type=Path)
    making.add_argument("folder", type=Path)
    making.add_argument("--data", type=Path)
    making.add_argument("--only", default="", help="make those only whose name holds this text")
    comparing = commands.add_parser("compare")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    options = parser.parse_args()
    if options.command == "compare":
        return compare(options.before, options.after)
    return make(options.tree.resolve(), options.folder.resolve(), options.data, options.only)


def make(tree: Path, folder: Path, data: Path | None, only: str) -> int:
    """Run every command on the package of a tree; return 1 where one failed."""
    folder.mkdir(parents=True, exist_ok=True)
    failed = 0
    for name, commands in jobs(tree, folder, data).items():
        if only not in name or (folder / f"{name}.done").exists():
            continue
        ended = [run(tree, *command) for command in commands]
        failed += any(ended)
        if not any(ended):
            (folder / f"{name}.done").touch()
        print(name, "failed" if any(ended) else "made", flush=True)
    return int(failed > 0)


def jobs(tree: Path, folder: Path, data: Path | None) -> dict[str, list[list[str]]]:
    """Return the commands by name."""
    armid = [sys.executable, "-m", "armid"]
    campaigns = tree / "studies" / "campaigns"
    loops = {name: str(campaigns / name) for name in CAMPAIGNS}
    done: dict[str, list[list[str]]] = {}
    done["engine"] = [[sys.executable, "-c", ENGINE.format(folder=str(folder))]]
    for name in IDENTIFIERS:
        fitness = "rmse" if "least_squares" in name else "similarity"
        words = ["--identifier", name, "--fitness", fitness, "--budget", "1500", "--seed", "3"]
        out = str(folder / f"identify_{name}")
        done[f"identify_{name}"] = [[*armid, "identify", loops["paper_arm"], *words, "--out", out]]
    for name, campaign in loops.items():
        done[f"loop_{name}"] = [[*armid, "close-loop", campaign, "--out", str(folder / f"loop_{name}")]]
    done["identifiability"] = [
        [*armid, "identifiability", loops["paper_arm"], "--out", str(folder / "identifiability")]
    ]
    short, out = tree / "studies" / "table1_short.toml", str(folder / "table1_short")
    done["table1_short"] = [[*armid, "study", str(short), "--out", out], [*armid, "report", out]]
    blind, out = tree / "studies" / "blind_short.toml", str(folder / "blind_short")
    stand = [sys.executable, str(tree / "studies" / "test_stand.py"), "blind", str(campaigns / "blind_short"),
             "--seed", "1", "--suite", str(blind)]  # fmt: skip
    done["blind_short"] = [stand] if not (campaigns / "blind_short").exists() else []
    done["blind_short"] += [
        [*armid, "study", str(blind), "--out", out],
        [*armid, "export", "reports", out, out + "_reports"],
    ]
    for machine, source in (("dfki", "dfki_simple_pendulum"), ("emps", "emps")) if data is not None else ():
        made = str(folder / f"campaign_{machine}")
        done[f"loop_{machine}"] = [[*armid, "import", machine, str(data / source), "--out", made],
                                   [*armid, "close-loop", made, "--out", str(folder / f"loop_{machine}")]]  # fmt: skip
    return done


def run(tree: Path, *command: str) -> int:
    """Run a command on the package of a tree."""
    environment = {**os.environ, "PYTHONPATH": str(tree / "src"), "COLUMNS": "120"}
    return subprocess.run(command, env=environment, cwd=tree, stdout=subprocess.DEVNULL, check=False).returncode


def compare(before: Path, after: Path) -> int:
    """Tell which outputs differ; return 1 where any does."""
    files = sorted(f.relative_to(before) for f in before.rglob("*") if f.suffix in {".json", ".csv", ".txt"})
    files = [f for f in files if f.name != "details.json"]
    different = [f for f in files if not (after / f).exists() or content(before / f) != content(after / f)]
    for file in different:
        print("differs:", file, *first_difference(before / file, after / file))
    print(f"{len(files) - len(different)} of {len(files)} outputs are the same")
    return int(bool(different))


def content(file: Path) -> Any:
    if file.suffix != ".json":
        return file.read_bytes()
    return without(json.loads(file.read_text(encoding="utf-8")))


def without(value: Any) -> Any:
    """Return a value without times and versions."""
    if isinstance(value, dict):
        return {k: without(v) for k, v in value.items() if k not in LEFT_OUT}
    return [without(v) for v in value] if isinstance(value, list) else value


def first_difference(before: Path, after: Path) -> list[str]:
    if not after.exists():
        return ["is missing"]
    texts = [json.dumps(content(f), indent=1, sort_keys=True).splitlines() if f.suffix == ".json"
             else f.read_text(encoding="utf-8").splitlines() for f in (before, after)]  # fmt: skip
    pairs = [(a.strip(), b.strip()) for a, b in zip(*texts, strict=False) if a != b]
    return [f"{len(pairs)} lines, first: {pairs[0][0]!r} -> {pairs[0][1]!r}"] if pairs else ["in length"]


if __name__ == "__main__":
    sys.exit(main())
