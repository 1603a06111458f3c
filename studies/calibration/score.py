"""Score the closed campaigns: tables and a reliability diagram.

python studies/calibration/score.py FOLDER --out results/calibration
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import matplotlib as mpl
import pandas as pd

from calibration.campaigns import HIDDEN, MACHINE, Task, file_of, former_file, tasks, truth_file
from calibration.scores import Closed, Score, reliability, scores_of
from calibration.truth import truth_of

mpl.use("Agg")
from matplotlib import pyplot as plt


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="score.py", description="Score the closed campaigns of a study.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(words)
    plan, every, failed = read(options.folder)
    options.out.mkdir(parents=True, exist_ok=True)
    lines = scores_of(every)
    table(lines).to_csv(options.out / "scores.csv", index=False, lineterminator="\n", float_format="%.4g")
    campaigns(every).to_csv(options.out / "campaigns.csv", index=False, lineterminator="\n", float_format="%.4g")
    diagram(every, options.out / "reliability.png")
    n_planned, n_closed = len(list(tasks(plan["size"]))), len(every) + len(failed)
    (options.out / "report.md").write_text(page(plan, n_planned, n_closed, failed, lines))
    print(table(lines).to_string(index=False))
    return 0


def read(folder: Path) -> tuple[dict[str, Any], list[Closed], list[str]]:
    """Return the plan of a study, its closed campaigns as far as there are any, and names of those that failed."""
    if not (folder / "plan.json").is_file():
        sys.exit(f"{folder / 'plan.json'} is not there: a folder of studies/calibration/run.py is expected")
    plan, every, failed = json.loads((folder / "plan.json").read_text()), [], []
    for task in tasks(plan["size"]):
        if file_of(folder, task).exists():
            answer = json.loads(file_of(folder, task).read_text())
            if "failed" in answer:
                failed.append(task.name)
            else:
                one = closed_of(task, json.loads(truth_file(folder, task).read_text()), answer)
                every.append(replace(one, former=former_of(folder, task)))
    return plan, every, failed


def former_of(folder: Path, task: Task) -> dict[str, Any] | None:
    path = former_file(folder, task)
    answer = json.loads(path.read_text()) if path.exists() else {"failed": ""}
    return None if "failed" in answer else answer


def closed_of(task: Task, entry: dict[str, Any], answer: dict[str, Any]) -> Closed:
    if task.family != MACHINE:
        return Closed(task.name, task.family, "arm", "arm", truth_of(entry, task.family == HIDDEN), entry, answer)
    family = (
        "fault" if entry["fault"] and not entry["effects"] else {"single": "one"}.get(entry["class"], entry["class"])
    )
    if any(not effect["listed"] for effect in entry["effects"]):
        family = "unlisted"
    group = "left out" if entry["left_out"] else "machines"
    return Closed(task.name, family, group, entry["machine"], truth_of(entry, False), entry, answer)


def table(lines: Sequence[Score]) -> pd.DataFrame:
    return pd.DataFrame([
        {"score": s.score, "group": s.group, "question": s.question, "campaigns": s.n, "value": s.value, "low": s.low,
         "high": s.high, "target": s.target, "met": {True: "yes", False: "no", None: ""}[s.met]}
        for s in lines
    ])  # fmt: skip


def campaigns(every: Sequence[Closed]) -> pd.DataFrame:
    """Return one line a campaign, truth and answer."""
    rows = []
    for one in every:
        chances, answer = one.answer["probabilities"], one.answer
        rows.append({
            "campaign": one.name, "machine": one.machine, "family": one.family,
            "truth": " + ".join(e["name"] for e in one.entry["effects"]), "fault": one.truth.fault.get("kind", ""),
            "verdict": answer["verdict"], "claims": "; ".join(" or ".join(sorted(g)) for g in one.groups),
            "probable": ", ".join(f"{n} {p:.2f}" for n, p in list(chances["effects"].items())[:4]),
            "nothing": chances["nothing"], "unknown": chances["unknown"],
            "suspects": "; ".join(f"{s['record']} {s['kind']}" for s in answer["suspects"]),
            "outside": sum(not (low <= 1.0 <= high) for _, low, high in one.held()), "cpu_s": answer["cpu_s"],
        })  # fmt: skip
    return pd.DataFrame(rows)


def diagram(every: Sequence[Closed], path: Path) -> None:
    """Draw how often a name is right against its probability."""
    figure, axes = plt.subplots(figsize=(4.2, 4.0))
    axes.plot([0, 1], [0, 1], color="0.7", lw=1)
    for group in dict.fromkeys(one.group for one in every):
        pairs = [pair for one in every if one.group == group for pair in one.pairs()]
        if len(pairs) >= 20:
            bins = reliability(pairs)
            axes.plot(
                [p for _, p, _ in bins], [true for _, _, true in bins], "o-", ms=4, label=f"{group}, {len(pairs)}"
            )
    axes.set(xlabel="probability of a name", ylabel="share that is right", xlim=(0, 1.02), ylim=(-0.02, 1.02))
    if axes.get_legend_handles_labels()[0]:
        axes.legend(title="campaigns of, names", frameon=False)
    figure.tight_layout()
    figure.savefig(path, dpi=150, metadata={"Software": None})


def page(plan: dict[str, Any], n_planned: int, n_closed: int, failed: Sequence[str], lines: Sequence[Score]) -> str:
    rows = [[s.score, s.group, s.question, str(s.n), f"{s.value:.3g}", f"{s.low:.3g} to {s.high:.3g}", s.target,
             {True: "yes", False: "no", None: ""}[s.met]] for s in lines]  # fmt: skip
    head = ["score", "group", "question", "campaigns", "value", "95 % interval", "target", "met"]
    asked = [s for s in lines if s.met is not None]
    few = [
        "The run was cut: of so few campaigns the intervals are wide, and a target that they touch may yet be missed."
    ]
    text = [
        "# Are the probabilities to be bet on, and do the intervals hold?", "",
        f"{sum(bool(s.met) for s in asked)} of {len(asked)} targets are met: the interval touches the target.",
        f"Seed {plan['seed']}: {n_closed} of {n_planned} planned campaigns were closed; {len(failed)} ended in an "
        "error. All campaigns are synthetic. Intervals come from a bootstrap over campaigns.",
        *(few if n_closed < n_planned else []),
        "", "![how often a name is right against its probability](reliability.png)", "",
        "| " + " | ".join(head) + " |", "|" + "---|" * len(head), *("| " + " | ".join(row) + " |" for row in rows), "",
        f"`python studies/calibration/run.py FOLDER --seed {plan['seed']} --size {plan['size']}` closes the campaigns, "
        "`python studies/calibration/score.py FOLDER --out results/calibration` makes this page. `campaigns.csv` has a "
        "line for each campaign.", "",
    ]  # fmt: skip
    return "\n".join(text)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
